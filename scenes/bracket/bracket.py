#!/usr/bin/env python3
"""Writes bracket.stl and bracket.nc: a part with three features and the program that a CAM system would post for it.

The plate of 60 x 40 x 20 mm has its top at z = 0. It has a pocket with a vertical wall, rounded corners and a fillet at
the foot of the wall, a smooth hollow, and a drilled blind hole. The tools are T1, a flat end mill R5, which faces the top
and leaves 0.3 mm elsewhere, T2, a ball R2, which finishes pocket and hollow, and T3, a drill of 6 mm with a point of 118
degrees. Paths are those of the exact offset surfaces: arcs are arcs, chords deviate by at most --chord-um.

    bracket.py --stl bracket.stl --nc bracket.nc
"""
import argparse
import math
import struct

X, Y, FLOOR = 30.0, 20.0, -20.0  # half lengths of the plate, height of its lower face
POCKET = (-15.0, 0.0)            # centre
POCKET_X, POCKET_Y = 11.0, 13.0  # half lengths of its outline
CORNER, FILLET, DEPTH = 6.0, 2.5, 6.0
HOLLOW = (14.0, -6.0)            # centre
HOLLOW_SIZE, HOLLOW_DEPTH = 11.0, 1.5  # half length, largest depth
HOLE = (15.0, 13.0)
DRILL, HOLE_TIP = 3.0, -12.0     # radius, height of the tip of its cone
HOLE_FOOT = HOLE_TIP + DRILL / math.tan(math.radians(59.0))  # where cylinder and cone meet
FLAT, BALL, ALLOWANCE = 5.0, 2.0, 0.3


# --- the shape

def hollow(x, y):
    """Returns height and slopes of the hollow: the product of two bumps with continuous curvature at the border."""
    u, v = (x - HOLLOW[0]) / HOLLOW_SIZE, (y - HOLLOW[1]) / HOLLOW_SIZE
    if abs(u) >= 1.0 or abs(v) >= 1.0:
        return 0.0, 0.0, 0.0
    p, q = 1.0 - u * u, 1.0 - v * v
    scale = -6.0 * HOLLOW_DEPTH / HOLLOW_SIZE
    return -HOLLOW_DEPTH * (p * q) ** 3, -u * scale * p * p * q ** 3, -v * scale * q * q * p ** 3


def outline(inset):
    """Returns the corners of the pocket's outline moved inwards, counter-clockwise from the middle of the right side:
    (x, y) for a line, (x, y, centre x, centre y) for an arc that ends there."""
    x, y, r = POCKET_X - inset, POCKET_Y - inset, max(CORNER - inset, 0.0)
    path = [(x, 0.0)]
    for (sx, sy), turns in (((1, 1), False), ((-1, 1), True), ((-1, -1), False), ((1, -1), True)):
        ends = [(sx * x, sy * (y - r)), (sx * (x - r), sy * y)]
        first, second = reversed(ends) if turns else ends
        path.append(first)
        if r > 0.0:
            path.append((*second, sx * (x - r), sy * (y - r)))
    path.append((x, 0.0))
    return [tuple(c + POCKET[i % 2] for i, c in enumerate(point)) for point in path]


# --- the mesh

def outline_points(inset, z, arc_steps=8, line_step=1.5):
    """Returns points of the pocket's outline, equally many for every inset, with one at each end of an arc."""
    points, last = [], None
    for point in outline(inset):
        if last and len(point) == 2:
            # the lines between the arcs keep their lengths
            across = (point[0] - last[0], point[1] - last[1])
            steps = max(1, round(math.hypot(*across) / line_step))
            points += [(last[0] + across[0] * k / steps, last[1] + across[1] * k / steps, z) for k in range(steps)]
        elif last:
            cx, cy = point[2:]
            r, a = math.hypot(last[0] - cx, last[1] - cy), math.atan2(last[1] - cy, last[0] - cx)
            points += [(cx + r * math.cos(a + math.pi / 2 * k / arc_steps),
                        cy + r * math.sin(a + math.pi / 2 * k / arc_steps), z) for k in range(arc_steps)]
        last = point[:2]
    return points


def circle_points(radius, z, steps=48):
    return [(HOLE[0] + radius * math.cos(2 * math.pi * k / steps), HOLE[1] + radius * math.sin(2 * math.pi * k / steps), z)
            for k in range(steps)]


def joined(outer, inner):
    """Returns the triangles between a ring and one with as many points inside or below it."""
    n = len(outer)
    return [t for k in range(n) for t in ((outer[k], outer[(k + 1) % n], inner[k]),
                                          (inner[k], outer[(k + 1) % n], inner[(k + 1) % n]))]


def merged(outer, inner, centre):
    """Returns the triangles between two rings around a centre, whose points are joined in the order of their angles."""
    def sorted_ring(ring):
        angles = [math.atan2(p[1] - centre[1], p[0] - centre[0]) for p in ring]
        first = min(range(len(ring)), key=lambda k: angles[k])
        return [ring[(first + k) % len(ring)] for k in range(len(ring))], sorted(angles)
    (a, angle_a), (b, angle_b) = sorted_ring(outer), sorted_ring(inner)
    triangles, i, j = [], 0, 0
    while i < len(a) or j < len(b):
        if j == len(b) or (i < len(a) and angle_a[i] <= angle_b[j]):
            triangles.append((a[i], a[(i + 1) % len(a)], b[j % len(b)]))
            i += 1
        else:
            triangles.append((a[i % len(a)], b[(j + 1) % len(b)], b[j]))
            j += 1
    return triangles


def grid_lines(end, fine_from, fine_to, fine, coarse, marks):
    """Returns coordinates from -end to end through the marks, in steps of `fine` in the hollow, else of `coarse`."""
    corners = sorted({-end, end, fine_from, fine_to, *marks})
    lines = [-end]
    for a, b in zip(corners, corners[1:]):
        steps = math.ceil((b - a) / (fine if fine_from <= a < fine_to else coarse) - 1e-9)
        lines += [a + (b - a) * (k + 1) / steps for k in range(steps)]
    return lines


def mesh(fine):
    """Returns the triangles of the closed surface, counter-clockwise seen from outside."""
    holes = [(*POCKET, POCKET_X + 2.0, POCKET_Y + 2.0), (*HOLE, 5.0, 5.0)]  # centre, half lengths of a rectangle
    low, high = HOLLOW[0] - HOLLOW_SIZE, HOLLOW[0] + HOLLOW_SIZE
    xs = grid_lines(X, low, high, fine, 2.5, [h[0] + s * h[2] for h in holes for s in (-1, 1)])
    low, high = HOLLOW[1] - HOLLOW_SIZE, HOLLOW[1] + HOLLOW_SIZE
    ys = grid_lines(Y, low, high, fine, 2.5, [h[1] + s * h[3] for h in holes for s in (-1, 1)])
    triangles = []

    def in_hole(x, y):
        return any(abs(x - h[0]) < h[2] and abs(y - h[1]) < h[3] for h in holes)

    def border(x_low, x_high, y_low, y_high):
        """Returns the points of the grid along a rectangle, counter-clockwise."""
        x_in, y_in = ([c for c in xs if x_low <= c <= x_high], [c for c in ys if y_low <= c <= y_high])
        return ([(c, y_low) for c in x_in[:-1]] + [(x_high, c) for c in y_in[:-1]] +
                [(c, y_high) for c in x_in[:0:-1]] + [(x_low, c) for c in y_in[:0:-1]])

    for x0, x1 in zip(xs, xs[1:]):
        for y0, y1 in zip(ys, ys[1:]):
            if in_hole((x0 + x1) / 2, (y0 + y1) / 2):
                continue
            a, b, c, d = ((x, y, hollow(x, y)[0]) for x, y in ((x0, y0), (x1, y0), (x1, y1), (x0, y1)))
            triangles += [(a, b, c), (a, c, d)]
    rings = [outline_points(0.0, z) for z in (0.0, -1.75, FILLET - DEPTH)]
    for k in range(1, 9):
        angle = math.pi / 2 * k / 8
        rings.append(outline_points(FILLET * (1 - math.cos(angle)), FILLET * (1 - math.sin(angle)) - DEPTH))
    floor = rings[-1]
    for part in (0.75, 0.5, 0.25):
        rings.append([(POCKET[0] + part * (p[0] - POCKET[0]), POCKET[1] + part * (p[1] - POCKET[1]), -DEPTH) for p in floor])
    hole_rings = [circle_points(DRILL, HOLE_FOOT * k / 4) for k in range(5)]
    hole_rings += [circle_points(DRILL * part, HOLE_TIP + (HOLE_FOOT - HOLE_TIP) * part) for part in (0.75, 0.5, 0.25)]
    for (cx, cy, hx, hy), loops, end in ((holes[0], rings, (*POCKET, -DEPTH)), (holes[1], hole_rings, (*HOLE, HOLE_TIP))):
        outer = [(x, y, 0.0) for x, y in border(cx - hx, cx + hx, cy - hy, cy + hy)]
        triangles += merged(outer, loops[0], (cx, cy))
        for a, b in zip(loops, loops[1:]):
            triangles += joined(a, b)
        triangles += [(loops[-1][k], loops[-1][(k + 1) % len(loops[-1])], end) for k in range(len(loops[-1]))]
    rim = [(x, y, 0.0) for x, y in border(-X, X, -Y, Y)]
    foot = [(x, y, FLOOR) for x, y, _ in rim]
    middle = [(x, y, FLOOR / 2) for x, y, _ in rim]  # so that sides have points away from their edges
    triangles += joined(foot, middle) + joined(middle, rim)
    triangles += [(foot[(k + 1) % len(foot)], foot[k], (0.0, 0.0, FLOOR)) for k in range(len(foot))]
    return triangles


def write_stl(path, triangles):
    with open(path, "wb") as out:
        out.write(b"bracket, mm".ljust(80) + struct.pack("<I", len(triangles)))
        for a, b, c in triangles:
            u, v = [b[i] - a[i] for i in range(3)], [c[i] - a[i] for i in range(3)]
            n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
            length = math.sqrt(sum(k * k for k in n))
            out.write(struct.pack("<12fH", *(k / length for k in n), *a, *b, *c, 0))


# --- the program

class Program:
    """Blocks of a Fanuc program. X, Y and Z are modal, as are G0 to G3 and F."""

    def __init__(self, name):
        self.lines, self.number = ["%", name], 0
        self.modal = {}

    def block(self, text):
        self.number += 5
        self.lines.append(f"N{self.number} {text}")

    def comment(self, text):
        self.lines += ["", f"({text})"]

    def move(self, code, x=None, y=None, z=None, feed=None, extra=""):
        texts = {letter: decimal(v) for letter, v in (("X", x), ("Y", y), ("Z", z), ("F", feed)) if v is not None}
        new = {letter: text for letter, text in texts.items()
               if self.modal.get(letter) != text or (extra and letter in "XY")}
        if not new.keys() & set("XYZ"):
            return
        words = [code] if self.modal.get("G") != code else []
        self.block(" ".join(words + [letter + text for letter, text in new.items()] + ([extra] if extra else [])))
        self.modal |= new | {"G": code}

    def rapid(self, **to):
        self.move("G0", **to)

    def feed(self, **to):
        self.move("G1", **to)

    def contour(self, path, feed):
        """Follows an outline on which the tool stands."""
        last = path[0]
        for point in path[1:]:
            if len(point) == 2:
                self.feed(x=point[0], y=point[1], feed=feed)
            else:
                centre = f"I{decimal(point[2] - last[0])} J{decimal(point[3] - last[1])}"
                self.move("G3", point[0], point[1], feed=feed, extra=centre)
            last = point

    def tool(self, number, speed, x, y):
        self.block(f"T{number} M6")
        self.block(f"S{speed} M3")
        self.block("G54")
        self.block("M8")
        self.modal = {}
        self.rapid(x=x, y=y)
        self.block(f"G43 Z15. H{number}")
        self.modal["Z"] = "15."

    def end_of_tool(self):
        self.rapid(z=15.0)
        for text in ("M9", "M5", "G28 G91 Z0.", "G90"):
            self.block(text)


def decimal(value):
    """Returns a number as posts write it, with a decimal point and without trailing zeros."""
    text = f"{value:.4f}".rstrip("0")
    return "0." if text in ("-0.", "0.") else text


def face(program):
    """Faces the top with the flat end mill at its final height."""
    ys = [-Y + 1.0 + k * 2 * (Y - 1.0) / 5 for k in range(6)]
    program.rapid(x=-X - FLAT - 2.0, y=ys[0])
    program.rapid(z=2.0)
    program.feed(z=0.0, feed=600)
    for k, y in enumerate(ys):
        side = (X + FLAT + 2.0) * (-1 if k % 2 else 1)
        program.feed(y=y, feed=1600)
        program.feed(x=side, feed=1600)
    program.rapid(z=15.0)


def rough_pocket(program):
    """Roughs the pocket level by level from a helix in its middle."""
    program.rapid(x=POCKET[0] + 2.0, y=POCKET[1])
    program.rapid(z=1.0)
    height = 1.0
    for level in (-2.0, -4.0, -5.0, ALLOWANCE - DEPTH):
        above = level + DEPTH
        inset = ALLOWANCE  # of the sharp corner from the wall
        if above < FILLET:
            inset = FILLET - math.sqrt((FILLET - ALLOWANCE) ** 2 - (FILLET - above) ** 2) + 1e-9
        outer = min(FLAT + math.ceil(1e4 * inset) / 1e4, FLAT + FILLET)
        while height > level:
            height = max(height - 1.0, level)
            program.move("G3", POCKET[0] + 2.0, POCKET[1], height, 500, extra="I-2. J0.")
        program.move("G3", POCKET[0] + 2.0, POCKET[1], feed=900, extra="I-2. J0.")
        for offset in (9.0, outer):
            path = outline(offset)
            program.feed(x=path[0][0], y=path[0][1], feed=1200)
            program.contour(path, 1200)
        program.feed(x=POCKET[0] + 2.0, y=POCKET[1])
    program.rapid(z=15.0)


def rough_hollow(program, step=0.5):
    """Roughs the hollow along lines, as deep as the flat end mill stays clear of it by the allowance."""
    def height(x, y):
        rim = [(x + FLAT * math.cos(a), y + FLAT * math.sin(a)) for a in (math.pi * k / 36 for k in range(72))]
        # its level curves are convex, so the highest point under the disc lies on the rim
        return max(hollow(*p)[0] for p in rim) + ALLOWANCE

    for y in (HOLLOW[1] - 2.0, HOLLOW[1] + 2.0):
        xs = [HOLLOW[0] - 4.0 + k * step for k in range(int(8.0 / step) + 1)]
        points = [(x, height(x, y)) for x in xs if height(x, y) < 0.0]
        program.rapid(x=points[0][0], y=y)
        program.rapid(z=1.0)
        for x, z in points:
            program.feed(x=x, z=z, feed=700)
        program.rapid(z=15.0)


def finish_pocket(program, step_over):
    """Finishes wall, fillet and floor with the ball, along outlines from the top to the middle of the floor."""
    passes = []  # inset and height of the tip
    steps = math.ceil((DEPTH - FILLET) / step_over)
    passes += [(BALL, -BALL - (DEPTH - FILLET) * k / steps) for k in range(steps)]
    steps = math.ceil(FILLET * math.pi / 2 / step_over)
    arm = FILLET - BALL  # of the ball's centre about that of the fillet
    for k in range(steps):
        angle = math.pi / 2 * k / steps
        passes.append((FILLET - arm * math.cos(angle), FILLET - arm * math.sin(angle) - BALL - DEPTH))
    middle = min(POCKET_X, POCKET_Y)
    steps = math.ceil((middle - FILLET) / step_over)
    passes += [(FILLET + (middle - FILLET) * k / steps, -DEPTH) for k in range(steps + 1)]
    start = outline(BALL + 2.0)[0]
    program.rapid(x=start[0], y=start[1])
    program.rapid(z=1.0)
    program.feed(z=passes[0][1], feed=400)
    for inset, z in passes:
        path = outline(inset)
        program.feed(x=path[0][0], y=path[0][1], z=z, feed=800)
        program.contour(path, 1500)
    program.rapid(z=15.0)


def ball_tip(x, y):
    """Returns the tip of the ball that touches the hollow at (x, y)."""
    z, slope_x, slope_y = hollow(x, y)
    n = math.sqrt(1.0 + slope_x ** 2 + slope_y ** 2)
    return x - BALL * slope_x / n, y - BALL * slope_y / n, z + BALL / n - BALL


def chord_error(a, b, y, places=9):
    """Returns the largest distance of the path of the tip from a chord of it."""
    p, q = ball_tip(a, y), ball_tip(b, y)
    d = [q[i] - p[i] for i in range(3)]
    dd = sum(k * k for k in d)
    largest = 0.0
    for k in range(1, places + 1):
        r = ball_tip(a + (b - a) * k / (places + 1), y)
        e = [r[i] - p[i] for i in range(3)]
        t = sum(e[i] * d[i] for i in range(3)) / dd
        largest = max(largest, math.dist(e, [t * k for k in d]))
    return largest


def pass_points(y, tolerance):
    """Returns the contacts along x of a pass, as far apart as the tolerance of its chords allows."""
    end = HOLLOW[0] + HOLLOW_SIZE
    xs = [HOLLOW[0] - HOLLOW_SIZE]
    while xs[-1] < end:
        low, high = xs[-1] + 0.02, min(xs[-1] + 4.0, end)
        if chord_error(xs[-1], high, y) > tolerance:
            for _ in range(20):
                mid = (low + high) / 2
                low, high = (low, mid) if chord_error(xs[-1], mid, y) > tolerance else (mid, high)
            high = low
        xs.append(high)
    return xs


def finish_hollow(program, step_over, tolerance):
    """Finishes the hollow along x, to and fro; the passes begin and end on the plane beside it."""
    steps = math.ceil(2 * HOLLOW_SIZE / step_over)
    for k in range(steps + 1):
        y = HOLLOW[1] - HOLLOW_SIZE + 2 * HOLLOW_SIZE * k / steps
        xs = pass_points(y, tolerance)
        points = [(xs[0] - 0.5, y, 0.0)] + [ball_tip(x, y) for x in xs] + [(xs[-1] + 0.5, y, 0.0)]
        if k % 2:
            points.reverse()
        if k == 0:
            program.rapid(x=points[0][0], y=points[0][1])
            program.rapid(z=1.0)
        for x, y_tip, z in points:
            program.feed(x=x, y=y_tip, z=z, feed=1500)
    program.rapid(z=15.0)


def drill(program):
    program.block(f"G98 G83 X{decimal(HOLE[0])} Y{decimal(HOLE[1])} Z{decimal(HOLE_TIP)} R2. Q4. F200.")
    program.block("G80")
    program.modal = {}


def program_text(step_over, tolerance):
    program = Program("O1002 (BRACKET)")
    program.lines += ["(T1 D=10. CR=0. - ZMIN=-5.7 - FLAT END MILL)", "(T2 D=4. CR=2. - ZMIN=-6. - BALL END MILL)",
                      "(T3 D=6. CR=0. TAPER=118DEG - ZMIN=-12. - DRILL)"]
    for text in ("G90 G94 G17 G49 G40 G80", "G21", "G28 G91 Z0.", "G90"):
        program.block(text)
    program.comment("FACE1")
    program.tool(1, 8000, -X - FLAT - 2.0, 1.0 - Y)
    face(program)
    program.comment("POCKET1")
    rough_pocket(program)
    program.comment("ADAPTIVE1")
    rough_hollow(program)
    program.end_of_tool()
    program.comment("CONTOUR1")
    program.tool(2, 12000, *outline(BALL + 2.0)[0])
    finish_pocket(program, step_over)
    program.comment("PARALLEL1")
    finish_hollow(program, step_over, tolerance)
    program.end_of_tool()
    program.comment("DRILL1")
    program.tool(3, 3000, *HOLE)
    drill(program)
    program.end_of_tool()
    program.block("M30")
    return "\n".join(program.lines + ["%", ""])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--stl", metavar="FILE", help="mesh to write")
    parser.add_argument("--nc", metavar="FILE", help="program to write")
    parser.add_argument("--mesh-mm", type=float, default=0.6875, help="edge of the mesh in the hollow")
    parser.add_argument("--step-over-mm", type=float, default=0.4, help="distance between passes of the ball")
    parser.add_argument("--chord-um", type=float, default=0.9, help="largest deviation of a chord")
    options = parser.parse_args()
    if options.stl:
        write_stl(options.stl, mesh(options.mesh_mm))
    if options.nc:
        with open(options.nc, "w", encoding="ascii", newline="\n") as out:
            out.write(program_text(options.step_over_mm, options.chord_um * 1e-3))


if __name__ == "__main__":
    main()
