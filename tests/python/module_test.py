#!/usr/bin/env python3
"""`import abbe` held against the program of the same build.

module_test.py PROGRAM SCENES: figures, maps, tracks, poses, beliefs and budgets must be those that
the commands write, to the last digit; a compensator as a function must do what its twin as a
program does, bit for bit; arrays are views that cannot be written and outlive their owners; faults
carry file, line and column; other threads of Python run while abbe works; and what a callback
raises, or Ctrl-C, ends the work. Exit code 77 (skipped) without NumPy or the module.
"""
import gc
import json
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import threading
import time

program, scenes = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
sys.path.insert(0, str(program.parent))
try:
    import numpy as np
    import abbe
except ImportError as missing:
    print(f"skipped: {missing} (./abbe setup --python)")
    sys.exit(77)

failures = checks = 0
dome = scenes / "gantry_dome.toml"
small = {"part.vertices": 3000, "program.step_over_mm": 2.0}
typed = [f"--set={key}={value}" for key, value in small.items()]
folder = pathlib.Path(tempfile.mkdtemp(prefix="abbe-python-"))


def expect(right, what):
    global failures, checks
    checks += 1
    if not right:
        print(f"wrong: {what}")
        failures += 1


def expect_raises(kind, call, what):
    try:
        call()
    except kind as raised:
        return raised
    except BaseException as other:
        expect(False, f"{what}: {other!r}")
        return None
    expect(False, f"{what}: nothing was raised")


def same(a, b):
    return a.shape == b.shape and np.array_equal(a, b, equal_nan=a.dtype.kind == "f")


def run(*words):
    done = subprocess.run([program, *map(str, words)], capture_output=True, text=True)
    expect(done.returncode in (0, 1), f"{words}: {done.stderr}")
    return done.stdout


def without_times(figures):
    """What a clock says differs between any two runs."""
    if isinstance(figures, dict):
        return {k: without_times(v) for k, v in figures.items() if k != "timing_s"}
    if isinstance(figures, list):
        return [without_times(one) for one in figures]
    return figures


# ---- comparison.json to the last digit, and the maps of its cases

run("compare", dome, *typed, "--save", "npz,track", "--out", folder / "dome")
written = json.loads((folder / "dome/comparison.json").read_text())
heard = []
beside = abbe.compare(dome, set=small, track=True, progress=lambda text, share: heard.append(share))
expect(without_times(beside.figures) == without_times(written), "comparison.json")
expect(list(beside.cases) == [one["name"] for one in written["cases"]], "names of the cases")
expect(heard and all(0 <= a <= 1 for a in heard if a >= 0), "progress between 0 and 1")
expect(str(beside).count("\n") > 5 and "<pre>" in beside._repr_html_(), "a table of a comparison")
for name, result in beside.cases.items():
    saved = np.load(folder / "dome" / name / "residual.npz")
    expect(same(result.residual_mm * 1e3, saved["residual_um"]) or
           np.nanmax(np.abs(result.residual_mm * 1e3 - saved["residual_um"])) <
           1e-12 * np.nanmax(np.abs(saved["residual_um"])), f"{name}: map")
    expect(same(np.isnan(result.residual_mm), np.isnan(saved["residual_um"])), f"{name}: not cut")
    expect(same(result.status, saved["status"]), f"{name}: status")
    expect(same(result.cut_line, saved["cut_line"]), f"{name}: line")
    expect(same(result.cut_time_s, saved["cut_time_s"]), f"{name}: time")
    summary = json.loads((folder / "dome" / name / "summary.json").read_text())
    expect(without_times(result.figures) == without_times(summary), f"{name}: summary.json")
    track = np.load(folder / "dome" / name / "track.npz")
    expect(same(result.track.q, track["q"]) and same(result.track.line, track["line"]) and
           same(result.track.time_s, track["time_s"]), f"{name}: track")
    apart = np.linalg.norm(result.track.actual_tip - result.track.nominal_tip, axis=1)
    saved_apart = np.linalg.norm(track["actual_tip"] - track["nominal_tip"], axis=1)
    expect(np.max(np.abs(apart - saved_apart)) < 1e-12, f"{name}: tips of the track")
    tip = summary["tip_error_um"]["max"] if "tip_error_um" in summary else None
    if tip is not None:
        expect(abs(1e3 * apart.max() - tip) < 1e-9, f"{name}: largest tip error {tip}")
    length = np.linalg.norm(result.track.actual_direction, axis=1)
    expect(np.max(np.abs(length - 1)) < 1e-12, f"{name}: unit directions")
expect(np.max(np.abs(beside["error_free"].track.actual_tip -
                     beside["error_free"].track.nominal_tip)) == 0, "the error-free tip is nominal")

# ---- a job, its cases one by one, and what it lets be seen

job = abbe.prepare(dome, set=small)
expect(job.axes == str(np.load(folder / "dome/uncompensated/track.npz")["axes"]), "axes")
case = "perfect-iterated-ideal"
alone = job.cut(case)
expect(same(alone.residual_mm, beside[case].residual_mm), "a case alone has the map of the comparison")
expect(same(job.cut().residual_mm, beside["uncompensated"].residual_mm), "uncompensated")
expect(same(job.cut("error_free").residual_mm, beside["error_free"].residual_mm), "error_free")
expect(alone.track is None, "no track where none was asked for")
expect(same(job.q, beside["error_free"].track.q), "commands of the program")
expect(job.T_wt.shape == (len(job.time_s), 4, 4), "poses")
expect(same(np.ascontiguousarray(job.T_wt[:, :3, 3]), beside["error_free"].track.nominal_tip),
       "tips of the poses")
for owner, names in ((job, ("vertices", "normals", "triangles", "area_mm2", "q", "time_s", "line",
                            "T_wt")),
                     (alone, ("residual_mm", "form_mm", "status", "cut_time_s", "cut_line"))):
    for name in names:
        array = getattr(owner, name)
        expect(not array.flags.owndata and not array.flags.writeable, f"{name}: a view for reading")
        again = getattr(owner, name)
        expect(array.__array_interface__["data"][0] == again.__array_interface__["data"][0],
               f"{name}: the same memory")
kept = alone.residual_mm
value, before = kept[7], kept.copy()
expect_raises(ValueError, lambda: kept.__setitem__(7, 1.0), "writing into a map")
del alone
gc.collect()
expect(same(kept, before) and kept[7] == value, "a map outlives its result")
html = job.cut(case)._repr_html_()
expect("data:image/png;base64," in html and "<pre>" in html, "picture and table of a result")

free = job.with_errors({"errors.scale": 0})
expect(np.nanmax(np.abs(free.cut().residual_mm - job.cut("error_free").residual_mm)) < 1e-12,
       "errors scaled to nothing")
twice = abbe.prepare(dome, set={**small, "errors.scale": 2}).cut()
expect(same(job.with_errors({"errors.scale": 2}).cut().residual_mm, twice.residual_mm),
       "other errors on one job")

job.cut(case).save(folder / "saved", formats=["npz", "json"])
expect(same(np.load(folder / "saved/residual.npz")["residual_um"],
            np.load(folder / f"dome/{case}/residual.npz")["residual_um"]), "save")
expect((folder / "saved/summary.json").exists(), "save writes every file of a case")
expect_raises(ValueError, lambda: job.cut(case).save(folder / "saved", formats=["nps"]), "a format")
expect_raises(ValueError, lambda: job.cut(case).save(folder / "saved", formats=["track"]),
              "a track that was not kept")
(folder / "theirs").mkdir()
(folder / "theirs/notes.txt").write_text("mine")
expect_raises(abbe.OutputFailure, lambda: job.cut(case).save(folder / "theirs"), "a folder of others")

# ---- a compensator as a function, and its twin as a program

twin = folder / "twin.py"
twin.write_text('''#!/usr/bin/env python3
import json, sys
task = json.loads(sys.stdin.readline())
answers = sys.argv[0].endswith("deviation.py") and "deviation" or "correction"
print(json.dumps({"abbe": 1, "kind": "ready", "name": "twin", "answers": answers}), flush=True)
for line in sys.stdin:
    ask = json.loads(line)
    if ask["kind"] != "ask":
        break
    rows = []
    for q, T, d in zip(ask["q"], ask["T_wt"], ask["direction"]):
        if answers == "correction":
            rows.append([1e-5 * min(max(x, -400.0), 400.0) + 1e-4 * s for x, s in zip(q, d)])
        else:
            rows.append([1e-5 * T[3], -2e-5 * T[7], 1e-5 * T[11], 1e-6 * T[2], 0.0, 1e-6])
    print(json.dumps({"id": ask["id"], answers: rows}), flush=True)
''')
(folder / "deviation.py").write_text(twin.read_text())
batches = []


def correction(task, batch):
    batches.append((len(batch), task.structure, [joint.name for joint in task.joints]))
    return 1e-5 * np.clip(batch.q, -400.0, 400.0) + 1e-4 * batch.direction


def deviation(task, batch):
    T, n = batch.T_wt, len(batch)
    return np.column_stack([1e-5 * T[:, 0, 3], -2e-5 * T[:, 1, 3], 1e-5 * T[:, 2, 3],
                            1e-6 * T[:, 0, 2], np.zeros(n), np.full(n, 1e-6)])


for function, file in ((correction, twin), (deviation, folder / "deviation.py")):
    mine, other = job.cut(function, answers=function.__name__), job.cut(str(file))
    expect(same(mine.residual_mm, other.residual_mm), f"{function.__name__}: the map of its twin")
    expect(np.nanmax(np.abs(mine.residual_mm - job.cut().residual_mm)) > 1e-4,
           f"{function.__name__} does something")
    expect(mine.name == function.__name__, "called by its name")
expect(max(n for n, _, _ in batches) == 1000 and sum(n for n, _, _ in batches) == len(job.time_s),
       "every sample in batches")
expect("".join(batches[0][2]) == job.axes and " t" in batches[0][1], "the task")
both = abbe.compare(dome, set={**small, "compare.cases": []}, compensators=[correction, twin])
points = abbe.compare(dome, set={**small, "compare.cases": []}, compensators=[deviation], answers="deviation")
expect(same(points["deviation"].residual_mm, job.cut(deviation, answers="deviation").residual_mm),
       "deviations in a comparison")
expect(same(both["correction"].residual_mm, both["twin.py"].residual_mm), "both in a comparison")


def wrong(task, batch):
    return np.zeros((len(batch), 2))


def absurd(task, batch):
    return np.full(batch.q.shape, 1e6)


def breaks(task, batch):
    raise ZeroDivisionError("by hand")


expect("rows of" in str(expect_raises(abbe.PlugInFailure, lambda: job.cut(wrong), "two columns")),
       "the text of a wrong shape")
expect("at most" in str(expect_raises(abbe.PlugInFailure, lambda: job.cut(absurd), "a kilometre")),
       "the text of a wrong size")
expect("by hand" in str(expect_raises(ZeroDivisionError, lambda: job.cut(breaks), "what it raises")),
       "what a function raises comes through")
expect("failed" in both.figures or both.failed == {}, "nothing failed")
failing = abbe.compare(dome, set={**small, "compare.cases": []}, compensators=[wrong])
expect(list(failing.failed) == ["wrong"] and "wrong" not in failing.cases, "a failed case is named")

# ---- poses

said = json.loads(run("pose", dome, "--json", "--at", "X=12.5 Y=-30 Z=40 A=10 C=25"))
q = np.zeros(len(job.axes))
for axis, position in {"X": 12.5, "Y": -30, "Z": 40, "A": np.radians(10), "C": np.radians(25)}.items():
    q[job.axes.index(axis)] = position
nominal, actual = abbe.pose(dome, q)
for seen, key in ((nominal, "T_wt_nominal"), (actual, "T_wt_actual")):
    apart = np.max(np.abs(seen[0] - np.array(said[key])))
    expect(apart < 1e-12, f"{key}: {apart} from what the program says")
expect(np.max(np.abs(nominal[:, :3, :3] @ nominal[:, :3, :3].transpose(0, 2, 1) - np.eye(3))) < 1e-14,
       "a rotation")
expect_raises(ValueError, lambda: abbe.pose(dome, np.zeros((4, 2))), "positions of two axes")

# ---- faults

fault = expect_raises(abbe.BadInput, lambda: abbe.prepare(dome, set={"part.vertises": 5}), "a key")
expect("part.vertices" in str(fault) and isinstance(fault, abbe.BadScene), f"the nearest key: {fault}")
broken = folder / "broken.toml"
broken.write_text(dome.read_text().replace('"machines/', f'"{scenes}/machines/')
                  .replace('"errors/', f'"{scenes}/errors/').replace('"tools/', f'"{scenes}/tools/')
                  .replace("radius_mm = 100.0", "radius_mm = -100.0")
                  .replace("step_mm = 0.5", "step_mm = 0"))
faults = expect_raises(abbe.BadScene, lambda: abbe.prepare(broken), "a broken scene")
where = [number for number, line in enumerate(broken.read_text().splitlines(), 1)
         if "radius_mm = -100.0" in line]
expect(len(faults.faults) == 2 and faults.faults[0].line in where and faults.faults[0].column > 0 and
       faults.file == str(broken), f"places of the faults: {faults}")
expect_raises(TypeError, lambda: abbe.prepare(dome, set=[("part.vertices",)]), "half a pair")
expect_raises(TypeError, lambda: abbe.compare(dome, compensators=[3]), "a number as compensator")
expect_raises(TypeError, lambda: abbe.prepare(dome, set={"part.vertices": {}}), "a value of no kind")
expect_raises(ValueError, lambda: job.cut("perfekt-iterated-ideal"), "a case")
expect_raises(ValueError, lambda: job.cut(correction, answers="corrections"), "answers")
expect_raises(ValueError, lambda: abbe.limit(threads=0), "no thread")

# ---- Python goes on meanwhile, and ends the work

counted, stop = [0], threading.Event()


def count():
    while not stop.is_set():
        counted[0] += 1
        time.sleep(0.001)


other = threading.Thread(target=count)
other.start()
began = time.perf_counter()
job.cut("perfect-iterated-ideal")
spent, met = time.perf_counter() - began, counted[0]
stop.set()
other.join()
expect(met > 50 * spent, f"another thread ran {met} times in {spent:.2f} s")


def raises(text, share):
    raise KeyError(text)


expect_raises(KeyError, lambda: job.cut(progress=raises), "what a callback raises")
expect_raises(KeyboardInterrupt, lambda: job.cut(
    progress=lambda text, share: os.kill(os.getpid(), signal.SIGINT)), "Ctrl-C")
expect(same(job.cut(case).residual_mm, beside[case].residual_mm), "the job after all that")

# ---- a belief and a budget

run("measure", scenes / "gantry_calibration.toml", "--instrument", "laser", "--out", folder / "readings")
readings = sorted((folder / "readings").glob("*.csv"))
expect(len(readings) == 1, f"one file of readings: {readings}")
run("identify", *readings, "--out", folder / "its/belief.toml")
found = abbe.identify(readings, out=folder / "ours/belief.toml")
expect((folder / "its/belief.toml").read_text() == (folder / "ours/belief.toml").read_text(),
       "the belief file")
report = json.loads((folder / "its/belief.json").read_text())
differ = [k for k in report if report[k] != found.get(k) and "/its/" not in json.dumps(report[k])]
expect(not differ, f"the report of the fit: {differ}")
expect_raises(ValueError, lambda: abbe.identify(readings, method="chains"), "a method")
expect_raises(ValueError, lambda: abbe.identify([]), "no readings")

study = folder / "study.toml"
study.write_text(f"""title = "a few machines"
scene = "{dome}"
set = {{ part.vertices = 500, program.step_over_mm = 4, sampling.chord_tolerance_nm = 50 }}
proofs = 2
[[inputs]]
every = "element"
spread = 1
[one_at_a_time]
[monte_carlo]
cases = 16
""")
run("study", study, "--set", "monte_carlo.cases=12", "--out", folder / "its_budget")
result = abbe.study(study, folder / "our_budget", set={"monte_carlo.cases": 12})
expect(result == json.loads((folder / "its_budget/budget.json").read_text()), "budget.json")

subprocess.run(["rm", "-r", folder])
print(f"{checks} checks, {failures} failed")
sys.exit(1 if failures else 0)
