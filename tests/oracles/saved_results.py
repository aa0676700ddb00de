#!/usr/bin/env python3
"""Reads what `--save` writes with NumPy and VTK, and computes the figures of summary.json from it.

saved_results.py PROGRAM SCENES: compares a dome under several cases, and runs parts that are cut,
uncut, gouged and left out of the judged region, and a mesh; every statistic must agree to 1e-9
with the definitions of cutting/map/residual.h written here a second time, from residual.npz alone and,
read by VTK, from residual.vtp. All other files must hold the same numbers, to the bits that their
format has. Exit code 77 (skipped) where Python has no numpy; without vtk the .vtp is left out, and
that is said.
"""
import json
import math
import pathlib
import subprocess
import sys
import tempfile
import zipfile

try:
    import numpy as np
except ImportError as missing:
    print(f"skipped: {missing} (apt-get install python3-numpy python3-vtk9)")
    sys.exit(77)
try:
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOXML import vtkXMLPolyDataReader
except ImportError as missing:
    vtk_to_numpy = None
    print(f"residual.vtp is not read: {missing} (apt-get install python3-vtk9)")

program, scenes = sys.argv[1], pathlib.Path(sys.argv[2])
failures, compared, worst = 0, 0, 0.0
columns = ["x_mm", "y_mm", "z_mm", "nx", "ny", "nz", "residual_um", "form_um", "texture_um", "status",
           "cut_time_s", "cut_line", "area_mm2"]


def expect(right, what):
    global failures
    if not right:
        print(f"wrong: {what}")
        failures += 1


def expect_near(seen, wanted, what):
    """Both none, or within 1e-9 of each other, beside 1 or their own size."""
    global compared, worst
    compared += 1
    if seen is None or wanted is None:
        return expect(seen is None and wanted is None, f"{what}: {seen}, summary.json has {wanted}")
    apart = abs(seen - wanted) / max(1.0, abs(wanted))
    worst = max(worst, apart)
    expect(apart <= 1e-9, f"{what}: {seen!r}, summary.json has {wanted!r}")


def same(a, b):
    return a.shape == b.shape and np.array_equal(a, b, equal_nan=a.dtype.kind == "f")


# ---- the figures, from fields

def samples(values, middles, fields):
    """What is cut and what it stands for: vertices, then middles of triangles."""
    area, cut = fields["area_mm2"].copy(), fields["status"] == 0
    if middles is None:
        return values[cut], area[cut]
    has = np.isfinite(middles)
    triangles = fields["triangles"][has]
    a, b, c = (fields["vertices"][triangles[:, k]] for k in range(3))
    whole = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    share = 1 if "random_um" in fields else 0.75
    np.subtract.at(area, triangles.ravel(), np.repeat(share * whole / 3, 3))
    expect((area[cut] > -1e-12).all(), "vertices that stand for less than nothing")
    area = np.maximum(area, 0)
    return np.concatenate([values[cut], middles[has]]), np.concatenate([area[cut], share * whole])


def within(fields):
    """What was looked at within triangles, None where nobody did."""
    return fields.get("middle_um", fields.get("random_um"))


def mixed(state):
    """SplitMix64."""
    state = (state ^ (state >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    state = (state ^ (state >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return state ^ (state >> np.uint64(31))


def chance(seed, count):
    """Numbers from 0 to 1, one a triangle, of a stream of its own."""
    golden = np.uint64(0x9E3779B97F4A7C15)
    start = mixed(np.array([seed], dtype=np.uint64) + golden)
    return (mixed(start + golden * np.arange(count, dtype=np.uint64)) >> np.uint64(11)) * 2.0**-53


def blended(values, fields):
    """Values of vertices at the place within every triangle."""
    corners = values[fields["triangles"]]
    if "random_um" not in fields:
        return corners.mean(axis=1)
    root, share = np.sqrt(chance(0, len(corners))), chance(1, len(corners))
    return (np.stack([1 - root, root * (1 - share), root * share], axis=1) * corners).sum(axis=1)


def statistics(values, middles, fields, tolerance):
    area, status = fields["area_mm2"], fields["status"]
    r, w = samples(values, middles, fields)
    missed = area[(status == 1) | (status == 3)]
    result = dict.fromkeys(["pv", "rms", "mean", "std", "min", "max", "p95_abs", "in_tolerance_percent"])
    total = math.fsum(w)
    judged = total + math.fsum(missed)
    if tolerance is not None and judged > 0:
        result["in_tolerance_percent"] = 100 * math.fsum(w[(r >= tolerance[0]) & (r <= tolerance[1])]) / judged
    if not r.size:
        return result
    order = np.argsort(np.abs(r), kind="stable")
    upto = np.cumsum(w[order].astype(np.longdouble))
    mean = math.fsum(w * r) / total
    result.update(min=r.min(), max=r.max(), pv=r.max() - r.min(), mean=mean,
                  rms=math.sqrt(math.fsum(w * r * r) / total),
                  std=math.sqrt(math.fsum(w * (r - mean) ** 2) / total),
                  p95_abs=np.abs(r)[order][np.searchsorted(upto, 0.95 * upto[-1])])
    return result


def heights(texture, w):
    """Of ISO 25178-2, about the mean."""
    if not texture.size:
        return None
    w = w / math.fsum(w)
    z = texture - math.fsum(w * texture)
    return {"Sa": math.fsum(w * np.abs(z)), "Sq": math.sqrt(math.fsum(w * z * z)), "Sp": z.max(),
            "Sv": -z.min(), "Sz": z.max() - z.min()}


def expect_figures(fields, free, summary, tolerance, name):
    status, middles, form = fields["status"], within(fields), fields["form_um"]
    found = {"residual_um": statistics(fields["residual_um"], middles, fields, tolerance),
             "form_um": statistics(form, None, fields, tolerance)}
    if free is not None:
        both = dict(fields, status=np.where((status == 0) & (free["status"] == 0), 0, 1))
        found["machine_um"] = statistics(fields["residual_um"] - free["residual_um"],
                                         None if middles is None else middles - within(free), both, None)
    for key, figures in found.items():
        for one, value in figures.items():
            expect_near(value, summary[key][one], f"{name}: {one} of {key}")
    texture_middles = None if middles is None else middles - blended(form, fields)
    if summary["texture_um"] is None:  # places at random, too few to carry a form
        expect("random_um" in fields, f"{name}: texture_um is missing")
        fields = dict(fields, status=np.full_like(status, 1))
        texture_middles = None
    for one, value in (heights(*samples(fields["texture_um"], texture_middles, fields)) or {}).items():
        expect_near(value, summary["texture_um"][one], f"{name}: {one} of texture_um")
    for key, value in (("cut", 0), ("uncut", 1), ("outside", 2), ("gouged", 3)):
        expect(np.count_nonzero(status == value) == summary[f"{key}_vertices"], f"{name}: number that is {key}")


# ---- the files

def read_npz(file):
    with zipfile.ZipFile(file) as archive:
        expect(archive.testzip() is None, f"{file}: checksums")
    with np.load(file, allow_pickle=False) as archive:
        return {key: archive[key] for key in archive.files}


# ---- profiles along a line


def mean_line(z, step, index):
    """Gaussian profile filter of ISO 16610-21 with lines fitted at the ends, by sparse brute force."""
    reach = int(index / step * (1 + 1e-12))
    d = np.arange(-reach, reach + 1)
    w = np.exp(-math.pi * (d * step / index) ** 2 / (math.log(2) / math.pi))
    padded, there = np.pad(z, reach), np.pad(np.ones(z.size), reach)
    moments = [np.convolve(there, (w * d ** k)[::-1], "valid") for k in range(3)]
    first = [np.convolve(padded, (w * d ** k)[::-1], "valid") for k in range(2)]
    return (moments[2] * first[0] - moments[1] * first[1]) / (moments[0] * moments[2] - moments[1] ** 2)


def expect_profile(folder, line):
    """What `render --line` writes: from the residual of the table everything else."""
    about = json.loads((folder / f"profile-{line}.json").read_text())
    table = np.loadtxt(folder / f"profile-{line}.csv", delimiter=",", skiprows=1)
    step, z = about["step_um"] * 1e-3, table[:, 4]
    expect(about["places"] == len(table) and np.allclose(np.diff(table[:, 0]), step, atol=2e-6),
           f"{folder}: places of profile-{line}.csv")
    through = mean_line(z, step, about["Nis_um"] * 1e-3)
    primary = through - np.polyval(np.polyfit(np.arange(z.size), through, 1), np.arange(z.size))
    waviness = mean_line(primary, step, about["Nic_mm"])
    for column, one in ((5, primary), (6, waviness), (7, primary - waviness)):
        expect(np.abs(table[:, column] - one).max() < 5e-6, f"{folder}: column {column} of profile-{line}.csv")
    for letter, one in (("P", primary), ("W", waviness), ("R", primary - waviness)):
        has, of = about[letter], about["evaluation"][letter]
        at = [of["from_mm"] + k * of["section_mm"] for k in range(of["sections"] + 1)]
        bounds = [min(one.size, math.ceil(x / step - 1e-6)) for x in at]
        if letter != "R":
            bounds[-1] = one.size
        h = one[bounds[0]:bounds[-1]]
        q = math.sqrt(np.mean(h * h))
        sections = [one[a:b] for a, b in zip(bounds, bounds[1:])]
        for name, value in (("a_um", np.mean(np.abs(h))), ("q_um", q), ("t_um", np.ptp(h)),
                            ("sk", np.mean((h / q) ** 3)), ("ku", np.mean((h / q) ** 4)),
                            ("p_um", np.mean([s.max() for s in sections])),
                            ("v_um", -np.mean([s.min() for s in sections])),
                            ("zx_um", max(np.ptp(s) for s in sections))):
            apart = abs(value - has[letter + name]) / max(1.0, abs(value))
            expect(apart < 5e-5, f"{folder}: {letter}{name} is {value}, profile-{line}.json has {has[letter + name]}")


def expect_reductions(folder):
    """Of comparison.json, from the figures beside them."""
    cases = {c["name"]: c for c in json.loads((folder / "comparison.json").read_text())["cases"]}
    before, count = cases["uncompensated"], 0
    for name, case in cases.items():
        own = json.loads((folder / name / "summary.json").read_text())
        for key in ("form_um", "texture_um", "form_cutoff_mm"):
            expect(case[key] == own[key], f"{folder}: {key} of {name}")
        for key, reduction in (case["reduction_percent"] or {}).items():
            of, one = key.split("_") if "_" in key else ("residual", key)
            one = one.capitalize() if of == "texture" else one
            wanted = 100 * (1 - case[f"{of}_um"][one] / before[f"{of}_um"][one])
            expect_near(wanted, reduction, f"{folder}: {key} of {name}")
            count += 1
    each = 9 if before["texture_um"] else 6  # without a texture there is none of it
    expect(count == each * (len(cases) - 2), f"{folder}: {count} reductions")


def expect_npz(fields, name):
    n, m = len(fields["vertices"]), len(fields["triangles"])
    shapes = {"vertices": ("<f8", (n, 3)), "normals": ("<f8", (n, 3)), "triangles": ("<i4", (m, 3)),
              "status": ("|u1", (n,)), "cut_line": ("<i4", (n,))}
    for key in ("middle_um", "random_um"):
        if key not in fields:
            continue
        shapes[key] = ("<f8", (m,))
        has = np.isfinite(fields[key])
        expect(not (has & (fields["status"][fields["triangles"]] != 0).any(axis=1)).any(),
               f"{name}: {key} between vertices that are not cut")
    for key in ("area_mm2", "residual_um", "form_um", "texture_um", "cut_time_s"):
        shapes[key] = ("<f8", (n,))
    for key, (kind, shape) in shapes.items():
        expect(fields[key].dtype == np.dtype(kind) and fields[key].shape == shape, f"{name}: {key}")
    corners = fields["vertices"][fields["triangles"]]
    third = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 6
    area = np.bincount(fields["triangles"].ravel(), np.repeat(third, 3), n)
    expect(np.allclose(area, fields["area_mm2"], rtol=1e-9, atol=1e-12), f"{name}: area_mm2")
    expect(np.allclose(np.linalg.norm(fields["normals"], axis=1), 1, atol=1e-12), f"{name}: normals")
    expect(same(fields["residual_um"] - fields["form_um"], fields["texture_um"]), f"{name}: texture_um")
    expect(np.isfinite(fields["residual_um"][fields["status"] == 0]).all(), f"{name}: residual where cut")


def read_vtp(file):
    """Its fields under the names of the .npz, and its facts."""
    reader = vtkXMLPolyDataReader()
    reader.SetFileName(str(file))
    reader.Update()
    mesh = reader.GetOutput()
    data = mesh.GetPointData()
    array = {data.GetArrayName(i): vtk_to_numpy(data.GetArray(i)) for i in range(data.GetNumberOfArrays())}
    array["residual_um"] = array.pop("deviation_um")
    array["normals"] = array.pop("Normals")
    data = mesh.GetCellData()
    array.update({data.GetArrayName(i): vtk_to_numpy(data.GetArray(i)) for i in range(data.GetNumberOfArrays())})
    array["vertices"] = vtk_to_numpy(mesh.GetPoints().GetData())
    array["triangles"] = vtk_to_numpy(mesh.GetPolys().GetConnectivityArray()).reshape(-1, 3).astype("<i4")
    about = mesh.GetFieldData()
    facts = {about.GetAbstractArray(i).GetName(): about.GetAbstractArray(i).GetValue(0)
             for i in range(about.GetNumberOfArrays())}
    return array, facts


def as_text(value):
    return value if isinstance(value, str) else "none" if value is None else json.dumps(value)


def expect_facts(seen, meta, name):
    expect(set(seen) >= set(meta), f"{name}: facts {sorted(seen)}")
    for key, value in meta.items():
        if isinstance(value, float):
            expect(float(seen.get(key, "nan")) == value, f"{name}: {key} is {seen.get(key)}")
        elif isinstance(value, list):
            expect(json.loads(seen.get(key, "null")) == value, f"{name}: {key} is {seen.get(key)}, not {value}")
        else:
            expect(seen.get(key) == as_text(value), f"{name}: {key} is {seen.get(key)!r}, not {as_text(value)!r}")


def expect_csv(file, fields, meta):
    lines = file.read_text(encoding="utf-8").split("\n")
    head = next(i for i, line in enumerate(lines) if not line.startswith("#"))
    expect(lines[head] == ",".join(columns), f"{file}: head {lines[head]}")
    expect_facts(dict(line[2:].split(": ", 1) for line in lines[:head]), meta, file)
    table = np.loadtxt(file, delimiter=",", skiprows=head + 1, encoding="utf-8", ndmin=2)
    wanted = [*fields["vertices"].T, *fields["normals"].T] + [fields[name] for name in columns[6:]]
    for name, column, one in zip(columns, table.T, wanted):
        expect(same(column, one.astype("<f8")), f"{file}: {name}")


def expect_ply(file, fields, meta):
    text, _, data = file.read_bytes().partition(b"end_header\n")
    lines = text.decode().split("\n")
    expect(lines[:2] == ["ply", "format binary_little_endian 1.0"], f"{file}: {lines[:2]}")
    expect_facts(dict(line[8:].split(": ", 1) for line in lines if line.startswith("comment ") and ": " in line),
                 meta, file)
    kinds = {"double": "<f8", "float": "<f4", "uchar": "|u1"}
    words = [line.split() for line in lines]
    vertex = np.dtype([(w[2], kinds[w[1]]) for w in words if w[0:1] == ["property"] and w[1] != "list"])
    count = {w[1]: int(w[2]) for w in words if w[0:1] == ["element"]}
    face = np.dtype([("corners", "|u1"), ("vertex", "<i4", 3)])
    expect(len(data) == count["vertex"] * vertex.itemsize + count["face"] * face.itemsize, f"{file}: length")
    v = np.frombuffer(data, vertex, count["vertex"])
    f = np.frombuffer(data, face, count["face"], count["vertex"] * vertex.itemsize)
    for k, axis in enumerate("xyz"):
        expect(same(v[axis], fields["vertices"][:, k]), f"{file}: {axis}")
        expect(same(v["n" + axis], fields["normals"][:, k].astype("<f4")), f"{file}: n{axis}")
    expect(same(v["quality"], fields["residual_um"].astype("<f4")), f"{file}: quality")
    expect(same(v["status"], fields["status"]), f"{file}: status")
    expect((f["corners"] == 3).all() and same(f["vertex"], fields["triangles"]), f"{file}: faces")


def expect_stl(file, fields, meta):
    bytes_ = file.read_bytes()
    facet = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    count = int.from_bytes(bytes_[80:84], "little")
    head = bytes_[:80].decode("ascii")
    expect(not head.startswith("solid") and "mm" in head and meta["version"] in head and f"seed {meta['seed']}" in head
           and meta["case"] in head, f"{file}: head {head}")
    expect(count == len(fields["triangles"]) and len(bytes_) == 84 + 50 * count, f"{file}: length")
    facets = np.frombuffer(bytes_, facet, count, 84)
    cut = fields["status"] == 0
    moved = fields["vertices"].copy()
    moved[cut] += 1e-3 * fields["residual_um"][cut, None] * fields["normals"][cut]
    wanted = moved[fields["triangles"]]
    step = np.spacing(np.abs(wanted).astype("<f4"))
    expect((np.abs(facets["corners"] - wanted) <= step).all(), f"{file}: corners")
    turned = np.cross(wanted[:, 1] - wanted[:, 0], wanted[:, 2] - wanted[:, 0])
    turned /= np.linalg.norm(turned, axis=1)[:, None]
    expect(np.allclose(facets["normal"], turned, atol=1e-6), f"{file}: normals")


def expect_folder(folder, free):
    """@return its fields"""
    fields = read_npz(folder / "residual.npz")
    meta = json.loads(fields.pop("meta").item())
    summary = json.loads((folder / "summary.json").read_text())
    for key in ("scene", "case", "seed"):
        expect(meta[key] == summary[key], f"{folder}: {key} of meta")
    expect(meta["version"] == summary["versions"]["abbe"], f"{folder}: version of meta")
    expect(meta["unit"] == "mm" and meta["residual_unit"] == "um" and "+ material left" in meta["sign"],
           f"{folder}: units and sign")
    expect_npz(fields, folder)
    machine = json.loads((folder.parent / "comparison.json").read_text()) if free is not None else None
    if machine:
        summary["machine_um"] = next(c["machine_um"] for c in machine["cases"] if c["name"] == meta["case"])
    expect_figures(fields, free, summary, meta["tolerance_um"], f"{folder}, npz")
    expect_csv(folder / "residual.csv", fields, meta)
    expect_ply(folder / "residual.ply", fields, meta)
    expect_stl(folder / "residual.stl", fields, meta)
    about = json.loads((folder / "residual.json").read_text())
    expect(all(about[key] == value for key, value in meta.items()), f"{folder}: facts of residual.json")
    expect(all(about[key] == summary[key] for key in ("residual_um", "form_um", "texture_um", "cut_vertices")),
           f"{folder}: figures of residual.json")
    expect(sorted(about["files"]) == sorted(path.name for path in folder.glob("residual.*") if path.suffix != ".png"),
           f"{folder}: files {about['files']}")
    if vtk_to_numpy and (folder / "residual.vtp").exists():
        of_vtk, facts = read_vtp(folder / "residual.vtp")
        for key, values in fields.items():
            expect(same(of_vtk[key], values.astype("<f4") if key in ("normals", "texture_um") else values),
                   f"{folder}: {key} of residual.vtp")
        expect_facts(facts, meta, folder / "residual.vtp")
        of_vtk["texture_um"] = of_vtk["residual_um"] - of_vtk["form_um"]
        expect_figures(of_vtk, None, summary, meta["tolerance_um"], f"{folder}, vtp")
    return fields


def abbe(*words):
    done = subprocess.run([program, *map(str, words)], capture_output=True, text=True)
    if done.returncode not in (0, 1):
        print(f"abbe {' '.join(map(str, words))}: exit {done.returncode}\n{done.stderr}")
        sys.exit(1)


formats = "ply,stl,csv,npz,json"
if subprocess.run([program, "run", "--help"], capture_output=True, text=True).stdout.count("vtp,"):
    formats = "vtp," + formats
few = ["--set", 'part.sampling="vertices"', "--set", "part.vertices=2000", "--save", formats]
with tempfile.TemporaryDirectory() as temporary:
    out = pathlib.Path(temporary)
    abbe("compare", scenes / "gantry_dome.toml", *few, "--out", out / "dome",
         "--set", 'title="Kuppel Ø 100, \\"1:1\\" # α"', "--set", "seed=7",
         "--set", 'compare.cases=["perfect-position-ideal", "perfect-iterated-ideal"]')
    free = expect_folder(out / "dome" / "error_free", None)
    for case in ("uncompensated", "perfect-position-ideal", "perfect-iterated-ideal"):
        expect_folder(out / "dome" / case, free)
    expect_reductions(out / "dome")
    # in a band narrower than the errors, to either side of the design
    seen = set()
    for name, scale, band in (("proud", 1, 0.012), ("gouged", -0.5, 0.012)):
        abbe("run", scenes / "gantry_dome.toml", *few, "--out", out / name, "--set", "part.tolerance_um=3",
             "--set", f"errors.scale={scale}", "--set", f"search.band_mm={band}", "--set", "part.judged_radius_max_mm=40")
        seen |= set(expect_folder(out / name, None)["status"].tolist())
    expect(seen == {0, 1, 2, 3}, f"status of every kind, not only {seen}")
    abbe("compare", scenes / "gantry_dome.toml", "--out", out / "sampled", "--save", formats,
         "--set", "part.vertices=3000", "--set", 'part.sampling="adaptive"', "--set", "part.judged_radius_max_mm=6", "--set", "part.resolution_um=1",
         "--set", "part.tolerance_um=3", "--set", 'compare.cases=["perfect-position-ideal"]')
    free = expect_folder(out / "sampled" / "error_free", None)
    expect(np.isfinite(free["middle_um"]).any(), "middles of an adaptive map")
    expect_folder(out / "sampled" / "uncompensated", free)
    if "vtp" in formats:
        for line in ("x", "y", "radius"):
            abbe("render", out / "dome" / "uncompensated", "--line", line, "--nis", 500)
            expect_profile(out / "dome" / "uncompensated", line)
        abbe("render", out / "sampled" / "uncompensated", "--line", "y", "--nic", 0.8, "--sections", 9)
        expect_profile(out / "sampled" / "uncompensated", "y")
    abbe("run", scenes / "gantry_mesh.toml", "--set", 'part.sampling="vertices"', "--save", formats, "--out", out / "mesh")
    expect_folder(out / "mesh", None)
print(f"{compared} figures compared, the farthest {worst:.1e} apart")
sys.exit(1 if failures else 0)
