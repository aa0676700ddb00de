#!/usr/bin/env python3
"""bracket_program.py PROGRAM SCENES: holds what abbe says of scenes/bracket after its correction against the text of the corrected program.

The program is read again, the slides are moved by a second chain with the curves of the file of errors, and each of the
three tools, as it is and not as the control believes, is swept by brute force: the first place on the normal of a vertex
that lies in a tool at any instant. Nothing is shared with abbe. Mesh and program must be those that bracket.py writes. ABBE_LONG=1 looks
at more vertices of a finer program, of 16 379 lines.
"""
import csv
import math
import os
import pathlib
import random
import re
import subprocess
import sys
import tempfile

program, scenes = sys.argv[1], pathlib.Path(sys.argv[2])
BAND = 0.3  # mm, in which a removal is sought
BOUND = 1e-6  # mm
LONG = bool(os.environ.get("ABBE_LONG"))
PER_FEATURE = 60 if LONG else 5
MAX_STEP = 0.05 if LONG else 0.1  # mm between samples: an error of 0.75 um that repeats every 10 mm bends by 0.37 nm within 0.1 mm
OFFSET, PART = (60.0, -40.0, -30.0), (60.0, -40.0, 70.0)  # G54, place of the part
LENGTHS, RADII = {1: 95.005, 2: 80.003, 3: 109.996}, {1: 5.0, 2: 1.998, 3: 3.0}  # the tools as they are
DRILL_SLOPE = math.tan(math.radians(59.0))
NEVER, ALWAYS = (math.inf, -math.inf), (-math.inf, math.inf)


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


# --- the machine with its errors

def read_errors(path):
    """Returns the location errors and the curves of every element, as written."""
    location, curves, curve = {}, {}, None
    for line in path.read_text().splitlines():
        line = line.split("#")[0].strip()
        if match := re.match(r"\[+([A-Z]{3})", line):
            curve = {}
            curves.setdefault(match[1], []).append(curve)
        elif "=" in line and '"' not in line:
            key, values = (text.strip() for text in line.split("="))
            values = [float(text) for text in values.strip("[]").split(",")]
            if curve is None:
                location[key[:4]] = values[0] * 1e-6
            else:
                curve[key] = values
    return location, curves


LOCATION, CURVES = read_errors(scenes / "errors/three_axis_typical.toml")


def legendre(coefficients, x):
    p, q, total = 1.0, x, coefficients[0]
    for n, c in enumerate(coefficients[1:], 1):
        total += c * q
        p, q = q, ((2 * n + 1) * x * q - n * p) / (n + 1)
    return total


def deviation(element, q):
    total = 0.0
    for curve in CURVES.get(element, []):
        if "period_mm" in curve:
            angle = 2 * math.pi * q / curve["period_mm"][0]
            total += curve["a_um"][0] * math.cos(angle) + curve["b_um"][0] * math.sin(angle)
        else:
            x = (q - curve.get("centre_mm", [0.0])[0]) / curve["half_range_mm"][0]
            total += legendre(curve.get("coefficients_um") or curve["coefficients_urad"], x)
    return total


def six(axis, q):
    return [deviation("E" + motion + axis, q) * (1e-3 if motion in "XYZ" else 1e-6) for motion in "XYZABC"]


def rotation(w):
    """Returns the rotation of a rotation vector, by Rodrigues."""
    t = math.sqrt(dot(w, w))
    if t == 0.0:
        return [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
    k = [[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]]
    s, c = math.sin(t) / t, (1 - math.cos(t)) / t ** 2
    return [[(i == j) + s * k[i][j] + c * dot(k[i], [k[m][j] for m in range(3)]) for j in range(3)] for i in range(3)]


def turned(rows, v):
    return [dot(row, v) for row in rows]


def turned_back(rows, v):
    return [sum(rows[i][k] * v[i] for i in range(3)) for k in range(3)]


def plus(a, b, sign=1.0):
    return [x + sign * y for x, y in zip(a, b)]


def pose(q, length):
    """Returns tip and axis of the tool in the workpiece on machines/three_axis_table.toml."""
    x, y, z = (six(axis, value) for axis, value in zip("XYZ", q))
    tip, axis, at_z = [0, -200, -200 - length], [0, 0, 1], [0, 200, 300]  # from the point of Z
    r = rotation(z[3:])
    tip, axis = plus(plus(turned(r, tip), z[:3]), [0, 0, q[2]]), turned(r, axis)
    r = rotation([LOCATION["EA0Z"], LOCATION["EB0Z"], 0.0])
    tip, axis = plus(turned(r, tip), at_z), turned(r, axis)
    y[5] -= LOCATION["EC0Y"]  # what the carriage of Y carries is turned the other way
    for errors, at in ((y, [0, -q[1], -150]), (x, [-q[0], 0, 100])):  # into the carriages of Y and of X
        r = rotation(errors[3:])
        tip, axis = turned_back(r, plus(plus(tip, at, -1), errors[:3], -1)), turned_back(r, axis)
    return plus(tip, [0, 0, -50]), axis


# --- the program

class Move:
    """A line or an arc of the slides, as programmed."""

    def __init__(self, start, end, centre):
        self.start, self.end, self.centre = start, end, centre
        if centre:
            self.angle = math.atan2(start[1] - centre[1], start[0] - centre[0])
            self.sweep = math.atan2(end[1] - centre[1], end[0] - centre[0]) - self.angle
            while self.sweep <= 1e-9:
                self.sweep += 2 * math.pi
            self.radii = [math.dist(p[:2], centre) for p in (start, end)]
        self.length = self.sweep * self.radii[0] if centre else math.dist(start, end)

    def at(self, u):
        q = [a + (b - a) * u for a, b in zip(self.start, self.end)]
        if self.centre:
            r, angle = self.radii[0] + (self.radii[1] - self.radii[0]) * u, self.angle + self.sweep * u
            q[:2] = self.centre[0] + r * math.cos(angle), self.centre[1] + r * math.sin(angle)
        return plus(q, OFFSET)


def read_moves(text):
    """Returns the moves of each tool."""
    moves, at, tool, code = {1: [], 2: [], 3: []}, [None] * 3, 0, "G0"
    for line in text.splitlines():
        to, ij = at[:], [0.0, 0.0]
        for word in re.sub(r"\(.*?\)", "", line).split():
            if word[0] in "XYZ":
                to["XYZ".index(word[0])] = float(word[1:])
            elif word[0] in "IJ":
                ij["IJ".index(word[0])] = float(word[1:])
            elif word[0] == "T":
                tool = int(word[1:])
            elif word in ("G0", "G1", "G3"):
                code = word
            elif word in ("G2", "G43", "G91"):
                sys.exit(f"this reader does not know {line}")
        if None not in at and (to != at or code == "G3" and ij != [0.0, 0.0]):
            moves[tool].append(Move(at, to, [at[0] + ij[0], at[1] + ij[1]] if code == "G3" else None))
        at = to
    return moves


# --- tools, as intersections of convex bodies: (entry, exit) along a ray

def slab(o, d, tip, axis, low, high):
    a, slope = dot(plus(o, tip, -1), axis), dot(d, axis)
    if abs(slope) < 1e-14:
        return ALWAYS if low <= a <= high else NEVER
    ends = ((low - a) / slope, (high - a) / slope)
    return min(ends), max(ends)


def roots(a, b, c):
    """Returns where a s^2 + 2 b s + c <= 0, for a > 0."""
    k = b * b - a * c
    return NEVER if k < 0 else ((-b - math.sqrt(k)) / a, (-b + math.sqrt(k)) / a)


def cylinder(o, d, tip, axis, radius):
    v = plus(o, tip, -1)
    va, da = dot(v, axis), dot(d, axis)
    v, d = [v[i] - va * axis[i] for i in range(3)], [d[i] - da * axis[i] for i in range(3)]
    if dot(d, d) < 1e-24:
        return ALWAYS if dot(v, v) <= radius ** 2 else NEVER
    return roots(dot(d, d), dot(v, d), dot(v, v) - radius ** 2)


def cone(o, d, tip, axis):
    """Of the drill's point, above its tip."""
    v, t = plus(o, tip, -1), 1 + DRILL_SLOPE ** 2
    va, da = dot(v, axis), dot(d, axis)
    a, b, c = dot(d, d) - da * da * t, dot(v, d) - va * da * t, dot(v, v) - va * va * t
    if a > 0:
        ends = roots(a, b, c)
        return ends if ends != NEVER and va + da * (ends[0] + ends[1]) / 2 >= 0 else NEVER
    low, high = roots(-a, -b, -c)
    return (high, math.inf) if da > 0 else (-math.inf, low)


def entry(*bodies):
    low, high = max(b[0] for b in bodies), min(b[1] for b in bodies)
    return low if low <= high else math.inf


def first_removed(tool, o, d, tip, axis):
    """Returns the first place on a ray that is in a tool at a pose."""
    if tool == 1:
        return entry(cylinder(o, d, tip, axis, 5.0), slab(o, d, tip, axis, 0.0, 15.0))
    if tool == 2:
        r = RADII[2]
        v = plus(o, plus(tip, [r * k for k in axis]), -1)
        return min(entry(roots(dot(d, d), dot(v, d), dot(v, v) - r * r)),
                   entry(cylinder(o, d, tip, axis, r), slab(o, d, tip, axis, r, 8.0)))
    height = 3.0 / DRILL_SLOPE
    return min(entry(cone(o, d, tip, axis), slab(o, d, tip, axis, 0.0, height)),
               entry(cylinder(o, d, tip, axis, 3.0), slab(o, d, tip, axis, height, 28.0)))


class Sweep:
    """Poses of all tools 0.1 mm apart; between two of them the least entry is found by golden sections."""

    def __init__(self, moves):
        self.steps = []  # tool, move, from, to, tip, axis at the end
        for tool, of_tool in moves.items():
            for move in of_tool:
                n = 1 + int(move.length / 0.1)
                for k in range(n):
                    self.steps.append((tool, move, k / n, (k + 1) / n, *pose(move.at((k + 1) / n), LENGTHS[tool])))

    def least_in_step(self, o, d, step):
        tool, move, low, high = step[:4]
        golden = (math.sqrt(5) - 1) / 2

        def at(u):
            return first_removed(tool, o, d, *pose(move.at(u), LENGTHS[tool]))
        a, b = high - golden * (high - low), low + golden * (high - low)
        at_a, at_b = at(a), at(b)
        # The rim of a flat end passes the vertex within a step: beyond it no removal is found.
        begins_above = math.isfinite(at(low))
        for _ in range(26):
            if at_a < at_b or (at_a == at_b and begins_above):
                high, b, at_b = b, a, at_a
                a = high - golden * (high - low)
                at_a = at(a)
            else:
                low, a, at_a = a, b, at_b
                b = low + golden * (high - low)
                at_b = at(b)
        return min(at_a, at_b)

    def first_removal(self, o, d):
        near = []
        for i, (tool, _, _, _, tip, axis) in enumerate(self.steps):
            reach = RADII[tool] + BAND
            if abs(tip[0] - o[0]) < reach and abs(tip[1] - o[1]) < reach and tip[2] < o[2] + BAND:
                near.append((first_removed(tool, o, d, tip, axis), i))
        near = sorted(n for n in near if -BAND < n[0] < BAND)
        least, looked_at = near[0][0], set()
        # a flat end is all but equally deep for as long as it covers the vertex
        candidates = len(near) if self.steps[near[0][1]][0] == 1 else 24
        for value, i in near[:candidates]:
            if value > near[0][0] + 1.2e-3:  # of the cusp between two poses
                break
            for k in {i, min(i + 1, len(self.steps) - 1)} - looked_at:
                looked_at.add(k)
                least = min(least, self.least_in_step(o, d, self.steps[k]))
        return least


def feature(x, y, z, nz):
    if math.hypot(x - 15, y - 13) < 3.001 and z < 0:
        return "point of the drill" if abs(nz) > 0.5 else "wall of the hole"
    if x < -3.9 and z < -1e-3:
        return "floor" if z < -5.999 else "fillet" if z < -3.501 else "wall"
    return "hollow" if z < -1e-3 else "top"


def cut(folder):
    """Cuts the corrected bracket on a cold and rigid machine that finds no datum."""
    text = (scenes / "bracket/bracket.toml").read_text()
    text = text[:text.index("[datum]")] + text[text.index("[[fixture]]"):]
    text = text.replace('"../', f'"{scenes}/').replace('"bracket.', f'"{folder}/bracket.')
    (folder / "scene.toml").write_text(text)
    changes = {"thermal.scale": 0, "compliance.scale": 0, "sampling.max_step_mm": MAX_STEP, "sampling.chord_tolerance_nm": 0.3,
               "cutting.spacing_mm": 2, "tool.1.actual.radius_mm": RADII[2]}
    changes |= {f"tool.{number - 1}.actual.length_mm": length for number, length in LENGTHS.items()}
    sets = [word for key, value in changes.items() for word in ("--set", f"{key}={value}")]
    subprocess.run([program, "run", folder / "scene.toml", "--case", "perfect-iterated-program", "--save", "csv", *sets,
                    "--out", folder / "out"], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    with open(folder / "out/residual.csv", encoding="utf-8") as table:
        rows = [row for row in csv.DictReader(line for line in table if not line.startswith("#")) if row["status"] == "0"]
    return (folder / "out/rewritten.nc").read_text(), rows


def generate(*words):
    subprocess.run([sys.executable, scenes / "bracket/bracket.py", *words], check=True)


def is_generated(folder):
    """Returns whether mesh and program are those of the generator."""
    generate("--stl", folder / "bracket.stl", "--nc", folder / "bracket.nc")
    return all((folder / name).read_bytes() == (scenes / "bracket" / name).read_bytes() for name in ("bracket.stl", "bracket.nc"))


def main():
    with tempfile.TemporaryDirectory() as folder:
        if not is_generated(pathlib.Path(folder)):
            sys.exit("scenes/bracket: bracket.py writes another mesh or program")
        if LONG:
            generate("--nc", pathlib.Path(folder) / "bracket.nc", "--step-over-mm", "0.1", "--chord-um", "0.25")
        text, rows = cut(pathlib.Path(folder))
    sweep = Sweep(read_moves(text))
    vertices = {}
    for row in rows:
        x, y, z, nx, ny, nz, residual = (float(row[key]) for key in ("x_mm", "y_mm", "z_mm", "nx", "ny", "nz", "residual_um"))
        vertices.setdefault(feature(x, y, z, nz), []).append((plus((x, y, z), PART), (nx, ny, nz), residual * 1e-3))
    random.seed(3)
    farthest = 0.0
    for name, of_feature in vertices.items():
        chosen = random.sample(of_feature, min(PER_FEATURE, len(of_feature)))
        apart = max(abs(sweep.first_removal(o, [k / math.sqrt(dot(n, n)) for k in n]) - residual) for o, n, residual in chosen)
        print(f"{name}: {len(chosen)} vertices, at most {apart * 1e6:.4f} nm apart")
        farthest = max(farthest, apart)
    sys.exit(0 if len(vertices) == 7 and farthest < BOUND else 1)


main()
