#!/usr/bin/env python3
"""Holds `abbe schema` against an independent validator (python3-jsonschema).

Every shipped scene and study, and every file that they name as a section, must be valid; each of
ten broken scenes must not. Exit code 77 (skipped) where Python has no jsonschema or tomllib.
"""
import copy
import json
import pathlib
import subprocess
import sys

try:
    import jsonschema
    import tomllib
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)

program, scenes = sys.argv[1], pathlib.Path(sys.argv[2])
schemas = {}


def validator(section):
    if section not in schemas:
        text = subprocess.run([program, "schema", "--of", section], check=True, capture_output=True).stdout
        schema = json.loads(text)
        jsonschema.Draft7Validator.check_schema(schema)
        schemas[section] = jsonschema.Draft7Validator(schema)
    return schemas[section]


def read(file):
    with open(file, "rb") as opened:
        return tomllib.load(opened)


def faults(section, tree):
    return list(validator(section).iter_errors(tree))


def report(name, found):
    for fault in found[:5]:
        place = ".".join(str(part) for part in fault.absolute_path)
        print(f"{name}: {place}: {fault.message[:300]}")
    return len(found)


def named_sections(tree, folder):
    """Files that stand for a section, with its name."""
    for key in ("machine", "errors", "tool", "part", "program", "thermal", "compliance", "material"):
        for value in tree.get(key) if isinstance(tree.get(key), list) else [tree.get(key)]:
            if isinstance(value, str) and value.endswith(".toml"):
                yield key, folder / value
    identified = tree.get("belief", {}).get("identified")
    if isinstance(identified, str):
        yield "errors", folder / identified


failures, files = 0, {}
for file in sorted(scenes.glob("*.toml")):
    tree = read(file)
    files[file.resolve()] = "scene"
    for section, other in named_sections(tree, file.parent):
        files[other.resolve()] = section
for file in sorted((scenes / "studies").glob("*.toml")):
    files[file.resolve()] = "study"
for file, section in files.items():
    failures += report(f"{section} {file.name}", faults(section, read(file)))
print(f"{len(files)} files are valid" if not failures else f"{failures} faults in valid files")

good = read(scenes / "gantry_dome.toml")


def broken(change):
    tree = copy.deepcopy(good)
    change(tree)
    return tree


breaks = {
    "unknown key": lambda t: t.update(surprise=1),
    "unknown key of a section": lambda t: t.update(view={"form": [0, 0, 1]}),
    "other unit": lambda t: t.update(search={"band_um": 2000}),
    "text for a number": lambda t: t.update(search={"band_mm": "2"}),
    "number for a text": lambda t: t.update(title=3),
    "out of range": lambda t: t.update(sampling={"max_step_mm": -1}),
    "word that is none": lambda t: t.update(alignment="best"),
    "required key missing": lambda t: t.pop("tool"),
    "too few numbers": lambda t: t.update(view={"from": [0, 1]}),
    "key of another kind": lambda t: t.update(
        tool={"kind": "ball", "radius_mm": 5, "corner_radius_mm": 1, "flank_length_mm": 20, "length_mm": 90}),
    "fraction for a whole number": lambda t: t.update(seed=1.5),
    "neither file nor surface": lambda t: t.update(part={"vertices": 1000}),
}
for name, change in breaks.items():
    if not faults("scene", broken(change)):
        print(f"not refused: {name}")
        failures += 1
print(f"{len(breaks)} broken scenes tried")
sys.exit(1 if failures else 0)
