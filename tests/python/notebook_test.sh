#!/bin/sh
# The script and the notebook of scenes/python run as they stand; 77 (skipped) without what they need.
#   notebook_test.sh PROGRAM SCENES
set -eu
program=$1 scenes=$2
PYTHONPATH=$(dirname "$program")
export PYTHONPATH
/usr/bin/python3 -c 'import abbe, matplotlib, nbconvert, ipykernel' 2>/dev/null || {
  echo "skipped: ./abbe setup --python; apt-get install jupyter-nbconvert python3-ipykernel"
  exit 77
}
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
/usr/bin/python3 "$scenes/python/dome.py" "$out" part.vertices=1000 program.step_over_mm=4
[ -s "$out/scale.png" ] && [ -s "$out/comparison.json" ]
/usr/bin/python3 -m nbconvert --to notebook --execute --output-dir "$out" --output tour "$scenes/python/tour.ipynb"
/usr/bin/python3 - "$out/tour.ipynb" <<'END'
import json, sys
cells = [cell for cell in json.load(open(sys.argv[1]))["cells"] if cell["cell_type"] == "code"]
shown = [out for cell in cells for out in cell["outputs"]]
assert not [out for out in shown if out["output_type"] == "error"]
pictures = sum("image/png" in out.get("data", {}) for out in shown)
pages = sum("text/html" in out.get("data", {}) for out in shown)
print(len(cells), "cells,", pictures, "pictures,", pages, "tables")
assert pictures == 3 and pages == 2, (pictures, pages)
END
