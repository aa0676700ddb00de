#!/usr/bin/env python3
"""The dome of scenes/gantry_dome.toml from Python: its cases, an error of growing size, a compensator.

PYTHONPATH=build/release /usr/bin/python3 scenes/python/dome.py [FOLDER] [KEY=VALUE ...]
"""
import json
import pathlib
import sys

import matplotlib
import numpy as np

import abbe

matplotlib.use("Agg")
from matplotlib import pyplot

out = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "out/python")
out.mkdir(parents=True, exist_ok=True)
scene = pathlib.Path(__file__).parents[1] / "gantry_dome.toml"
change = {key: json.loads(value) for key, value in (word.split("=") for word in sys.argv[2:])}

beside = abbe.compare(scene, set=change)  # what `abbe compare` cuts
(out / "comparison.json").write_text(json.dumps(beside.figures, indent=2))
print(beside)

job = abbe.prepare(scene, set=change)
scales = np.linspace(0, 2, 20)
results = [job.with_errors({"errors.scale": scale}).cut() for scale in scales]
pv = [result.figures["residual_um"]["pv"] for result in results]


def half(task, batch):
    """Takes away half of what X and Y would be wrong by if their scales were 20 ppm long."""
    return -0.5 * 20e-6 * batch.q * np.isin([joint.name for joint in task.joints], ["X", "Y"])


print("half of 20 ppm taken away:", job.cut(half).figures["residual_um"]["pv"], "um")
pyplot.plot(scales, pv, "o-")
pyplot.xlabel("errors.scale")
pyplot.ylabel("peak to valley of the residual, µm")
pyplot.savefig(out / "scale.png", dpi=120)
