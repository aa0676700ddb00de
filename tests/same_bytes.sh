#!/bin/sh
# same_bytes.sh OLD NEW: runs two abbe programs over every scene and study, on few vertices, and over
# measure, identify, evaluate, export, rewrite, pose and check, and compares every file and every
# word. Run from the folder of the project. Timings, versions and marks are left out. Exit 1 where
# anything differs; what differs is listed. About ten minutes of two cores.
set -eu
[ $# -eq 2 ] || { echo "usage: tests/same_bytes.sh OLD NEW" >&2; exit 2; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
few="--set part.vertices=400"

# run NAME ARGUMENTS...: both programs write to one and the same folder, one after the other
run() {
  item=$1
  shift
  for side in old new; do
    [ "$side" = old ] && program=$old || program=$new
    rm -rf "$work/out"
    code=0
    (cd "$root" && "$program" "$@") >"$work/text" 2>"$work/errors" </dev/null || code=$?
    mkdir -p "$work/$side/$item"
    { echo "exit $code"; cat "$work/text"; grep -v '\[[0-9]*/[0-9]*\]' "$work/errors" || true; } \
      >"$work/$side/$item/said"
    [ -e "$work/out" ] && mv "$work/out" "$work/$side/$item/out"
    # figures of the run itself, and of the very program
    find "$work/$side/$item" \( -name .abbe-result -o -name journal.sqlite \) -delete
    find "$work/$side/$item" \( -name '*.json' -o -name said \) -exec sed -i \
      -e '/"timing_s": {/,/}/d' -e '/"versions": {/,/}/d' -e '/"seconds":/d' -e '/_s": [0-9.e-]*,\{0,1\}$/d' {} +
  done
  if diff -r "$work/old/$item" "$work/new/$item" >"$work/difference" 2>&1; then
    printf 'same    %s\n' "$item"
  else
    printf 'DIFFERS %s\n' "$item"
    head -n 5 "$work/difference" | cut -c 1-160
    differs=1
  fi
  keep=$work/old/$item/out
}

root=$(pwd)
old=$(realpath "$1")
new=$(realpath "$2")
differs=0
out=$work/out
for scene in scenes/*.toml; do
  name=$(basename "$scene" .toml)
  run "check-$name" check "$scene" --json
  run "compare-$name" compare "$scene" $few --out "$out"
done
for study in scenes/studies/*.toml; do
  name=$(basename "$study" .toml)
  run "study-$name" study "$study" --set monte_carlo.cases=64 --set set.part.vertices=400 --out "$out"
done
for scene in gantry_calibration platform_calibration yang_axis step_diagonal; do
  run "measure-$scene" measure "scenes/$scene.toml" --out "$out"
  readings=$work/readings-$scene
  [ -d "$keep" ] && cp -r "$keep" "$readings" || continue
  for file in "$readings"/*.csv; do
    run "evaluate-$scene-$(basename "$file" .csv)" evaluate "$file" --out "$out"
  done
  run "identify-$scene" identify "$readings"/*.csv --out "$out/belief.toml"
done
belief="--set belief.identified=beliefs/gantry.toml"
for format in linuxcnc isg siemens heidenhain; do
  run "export-$format" export scenes/gantry_dome.toml $few $belief --format "$format" --out "$out"
done
run rewrite rewrite scenes/gantry_dome.toml $few $belief --case identified-iterated-program --out "$out/dome.ngc"
run pose-at pose scenes/gantry_dome.toml --at "X=100 Y=-50 Z=120 A=30 C=90" --json
run pose-grid pose scenes/gantry_dome.toml --grid "X=::4 Y=::4 Z=::3" --out "$out"
exit $differs
