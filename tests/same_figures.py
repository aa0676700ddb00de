#!/usr/bin/env python3
"""Holds one program against another on whole scenes, vertex by vertex.

same_figures.py BEFORE AFTER SCENE...: runs every scene with both, and compares what they leave: the
status of each vertex and its residual (residual.npz), and every number of summary.json. Prints the
largest difference of each scene; exit code 1 where a residual or a length differs by more than
0.1 nm, a status differs, or a run does. Of Python's own library alone.
"""
import array
import ast
import json
import math
import pathlib
import subprocess
import sys
import tempfile
import zipfile

tolerance_um = 1e-4
seldom_alike = ("_s", "version", "versions", "seconds", "memory", "commit", "command", "folder", "out")


def column(archive, name):
    data = archive.read(name + ".npy")
    size = 2 if data[6] == 1 else 4
    length = int.from_bytes(data[8:8 + size], "little")
    kind = ast.literal_eval(data[8 + size:8 + size + length].decode())["descr"]
    values = array.array({"<f8": "d", "<f4": "f", "<i4": "i", "<i8": "q", "|u1": "B", "|i1": "b"}[kind])
    values.frombytes(data[8 + size + length:])
    return values


def run(program, scene, folder):
    done = subprocess.run([program, "run", scene, "--out", folder, "--save", "npz", "--trust"],
                          capture_output=True, text=True)
    return done.returncode, done.stderr


def numbers(tree, path=""):
    if isinstance(tree, dict):
        for key, value in tree.items():
            if not any(key.endswith(word) for word in seldom_alike):
                yield from numbers(value, f"{path}.{key}")
    elif isinstance(tree, list):
        for i, value in enumerate(tree):
            yield from numbers(value, f"{path}[{i}]")
    elif isinstance(tree, (int, float)) and not isinstance(tree, bool):
        yield path, tree


def compared(scene, before, after, work):
    folders = [pathlib.Path(work) / name for name in ("before", "after")]
    codes = [run(program, scene, str(folder))[0] for program, folder in zip((before, after), folders)]
    if codes[0] != codes[1]:
        return [f"exit codes {codes[0]} and {codes[1]}"], ""
    if codes[0] != 0:
        return [], f"both end with exit code {codes[0]}"
    wrong = []
    archives = [zipfile.ZipFile(folder / "residual.npz") for folder in folders]
    status = [column(archive, "status") for archive in archives]
    residual = [column(archive, "residual_um") for archive in archives]
    if status[0] != status[1]:
        wrong.append(f"{sum(a != b for a, b in zip(*status))} vertices have another status")
    most = max((abs(a - b) for a, b in zip(*residual) if not (math.isnan(a) and math.isnan(b))),
               default=0.0)
    if not most <= tolerance_um:
        wrong.append(f"a residual differs by {1e3 * most:.3g} nm")
    sums = [dict(numbers(json.loads((folder / "summary.json").read_text()))) for folder in folders]
    if sums[0].keys() != sums[1].keys():
        wrong.append("other figures: " + ", ".join(sorted(sums[0].keys() ^ sums[1].keys())[:5]))
    figure, where = 0.0, "none"
    for key in sums[0].keys() & sums[1].keys():
        difference = abs(sums[0][key] - sums[1][key]) / max(1.0, abs(sums[0][key]))
        if difference > figure:
            figure, where = difference, key
    if not figure <= tolerance_um:
        wrong.append(f"{where} differs by {figure:.3g}")
    return wrong, (f"{len(residual[0])} vertices, residuals within {1e3 * most:.2g} nm; {len(sums[0])} "
                   f"figures within {figure:.2g} ({where})")


def main():
    before, after, *scenes = sys.argv[1:]
    failed = 0
    for scene in scenes:
        with tempfile.TemporaryDirectory() as work:
            wrong, what = compared(scene, before, after, work)
        failed += bool(wrong)
        print(f"{scene}: {'; '.join(wrong + [what])}", flush=True)
    sys.exit(1 if failed else 0)


main()
