"""The z-map of peers_bench: heights above the vertices of a raster, in NumPy.

Reads what `peers_bench --write` writes, answers on standard output as the peers there do: seconds,
seconds of the processor, bytes of growth, then the deviations; all float64. Every vertex keeps the
lowest place of the tool above it. A ball end is swept exactly; of a tilted bull nose as many poses
a move as MOST_STEP asks are held against what lies within WINDOW of the contact. A height is a
deviation once it is multiplied by the normal's z, which is right to first order. Exits with 77
without NumPy.
"""

import resource
import sys
import time

try:
    import numpy as np
except ImportError:
    sys.exit(77)

WINDOW = 2.0  # mm about the contact
MOST_STEP = 0.1  # mm between two poses
NEWTON_STEPS = 6
START_BELOW = 0.05  # mm below the design, from where Newton starts


def read(file):
    numbers = np.frombuffer(file.read())
    radius, corner, moves, vertices, per_side = numbers[:5]
    sizes = 3 * np.array([0, moves, moves, vertices, vertices], dtype=int)
    ends = 5 + np.cumsum(sizes)
    tip, axis, vertex, normal = (numbers[a:b].reshape(-1, 3) for a, b in zip(ends, ends[1:]))
    return radius, corner, tip, axis, vertex, normal, int(per_side)


def window(x, y, low, high):
    """The rows and columns of the raster within a box."""
    rows = slice(*np.searchsorted(y, (low[1], high[1])))
    columns = slice(*np.searchsorted(x, (low[0], high[0])))
    return rows, columns


def ball_height(x, y, a, b, radius):
    """Lowest place above (x, y) of a ball whose centre goes from a to b."""
    step = b - a
    length = np.linalg.norm(step)
    def ends(centre):
        left = radius**2 - (x - centre[0]) ** 2 - (y - centre[1]) ** 2
        return np.where(left >= 0, centre[2] - np.sqrt(np.maximum(left, 0)), np.inf)
    height = np.minimum(ends(a), ends(b))
    if length == 0:
        return height
    d = step / length
    # (x, y, z) from a, across d: |p|^2 - (p.d)^2 = R^2, quadratic in z
    px, py = x - a[0], y - a[1]
    flat = px * d[0] + py * d[1]
    qa = 1 - d[2] ** 2
    qb = -flat * d[2]
    qc = px**2 + py**2 - flat**2 - radius**2
    left = qb**2 - qa * qc
    z = (-qb - np.sqrt(np.maximum(left, 0))) / qa
    along = flat + z * d[2]
    side = (left >= 0) & (along >= 0) & (along <= length)
    return np.minimum(height, np.where(side, a[2] + z, np.inf))


def bull_nose_height(x, y, start, tip, axis, radius, corner):
    """Lowest place above (x, y) of one pose: Newton from below on a convex distance."""
    z = start.copy()
    for _ in range(NEWTON_STEPS):
        px, py, pz = x - tip[0], y - tip[1], z - tip[2]
        h = px * axis[0] + py * axis[1] + pz * axis[2]
        ax, ay, az = px - h * axis[0], py - h * axis[1], pz - h * axis[2]
        rho = np.sqrt(ax**2 + ay**2 + az**2)
        out = np.maximum(rho - (radius - corner), 0)
        under = np.maximum(corner - h, 0)
        core = np.maximum(np.hypot(out, under), 1e-12)
        slope = (out * az / np.maximum(rho, 1e-12) - under * axis[2]) / core
        z = np.where(slope < 0, z - (core - corner) / np.minimum(slope, -1e-6), np.inf)
    return z


def swept_balls(radius, tip, axis):
    """Each move's box, and the heights of its ball."""
    centre = tip + radius * axis
    for a, b, tip_a, tip_b in zip(centre, centre[1:], tip, tip[1:]):
        low, high = np.minimum(tip_a, tip_b) - WINDOW, np.maximum(tip_a, tip_b) + WINDOW
        yield low, high, lambda x, y, start: ball_height(x, y, a, b, radius)


def contact_of(tip, axis, ring, normal_at):
    """Where a tilted cutter touches, which its own normal there decides."""
    at = tip[:2]
    for _ in range(4):
        normal = normal_at(at)
        across = normal - normal.dot(axis) * axis
        at = tip[:2] - ring * across[:2] / np.linalg.norm(across)
    return at


def posed_bull_noses(radius, corner, tip, axis, normal_at):
    """The same of poses along the moves."""
    for i in range(len(tip) - 1):
        steps = int(np.ceil(np.linalg.norm(tip[i + 1] - tip[i]) / MOST_STEP))
        for u in (np.arange(steps) + 0.5) / steps:
            at = (1 - u) * tip[i] + u * tip[i + 1]
            direction = (1 - u) * axis[i] + u * axis[i + 1]
            direction /= np.linalg.norm(direction)
            contact = contact_of(at, direction, radius - corner, normal_at)
            yield (
                contact - WINDOW,
                contact + WINDOW,
                lambda x, y, start: bull_nose_height(x, y, start, at, direction, radius, corner),
            )


def z_map(radius, corner, tip, axis, vertex, normal, per_side):
    x, y = vertex[:per_side, 0], vertex[::per_side, 1]
    normals = normal.reshape(per_side, per_side, 3)

    def normal_at(at):
        column = min(np.searchsorted(x, at[0]), per_side - 1)
        return normals[min(np.searchsorted(y, at[1]), per_side - 1), column]

    design = vertex[:, 2].reshape(per_side, per_side)
    height = np.full((per_side, per_side), np.inf)
    if corner == radius:
        sweep = swept_balls(radius, tip, axis)
    else:
        sweep = posed_bull_noses(radius, corner, tip, axis, normal_at)
    np.seterr(invalid="ignore")  # of places that the cutter is not above
    for low, high, heights in sweep:
        cells = window(x, y, low, high)
        xs, ys = np.meshgrid(x[cells[1]], y[cells[0]])
        height[cells] = np.minimum(height[cells], heights(xs, ys, design[cells] - START_BELOW))
    return height - design


def main():
    radius, corner, tip, axis, vertex, normal, per_side = read(sys.stdin.buffer)
    with open("/proc/self/clear_refs", "w") as refs:
        refs.write("5")
    with open("/proc/self/statm") as sizes:
        before = int(sizes.read().split()[1]) * resource.getpagesize()
    start, start_cpu = time.perf_counter(), time.process_time()
    deviation = z_map(radius, corner, tip, axis, vertex, normal, per_side).ravel() * normal[:, 2]
    seconds, cpu = time.perf_counter() - start, time.process_time() - start_cpu
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    sys.stdout.buffer.write(np.concatenate(([seconds, cpu, peak - before], deviation)).tobytes())


main()
