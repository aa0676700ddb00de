#!/usr/bin/env python3
"""Counts the product without its documents and holds the counts below the budgets of tests/budget.toml.

budget.py              fails if a count exceeds its budget, or if a commit raised a budget without a reason
budget.py --lower      writes the counts as the new budgets wherever they are lower
budget.py OLD [NEW]    prints the counts of two checkouts side by side; NEW is this one unless given

A budget may only fall. The commit that raises one says why in a line of its message that begins with
"Budget:".
"""
import collections
import pathlib
import re
import subprocess
import sys

try:
    import tomllib
except ModuleNotFoundError:
    print("budget: needs Python 3.11")
    sys.exit(77)

PRODUCT = ["kinematics", "errors", "cutting", "render", "sim"]
CODE = {".h", ".cpp", ".c"}
TYPE = re.compile(r"^\s*(?:template <.*> )?(?:struct|class|enum|enum class|union) (?:\[\[\w+\]\] )?(\w+)[^;()]*\{")
SHORT = 30  # lines; a file that is no longer is seldom a concept
HERE = pathlib.Path(__file__).resolve().parent.parent


def git(folder, *arguments):
    """What git prints; empty where it fails: an archive of the sources has no history."""
    try:
        return subprocess.run(["git", *arguments], cwd=folder, capture_output=True, text=True, check=True).stdout
    except (subprocess.CalledProcessError, FileNotFoundError):
        return ""


def files_below(root, folders):
    """Files of the checkout that git tracks or would take, as paths relative to its root."""
    listed = git(root, "ls-files", "--cached", "--others", "--exclude-standard", *folders).splitlines() or \
        [str(p.relative_to(root)) for f in folders for p in (root / f).rglob("*")]
    return sorted({name for name in listed if (root / name).is_file()})


def lines_of(path):
    return path.read_text(encoding="utf-8", errors="replace").splitlines()


def is_comment(line):
    return line.lstrip().startswith(("//", "/*", "*"))


def installed_headers(root):
    """Headers that sim/commands/install.cmake brings: those it names and all that they include, or all of every room."""
    text = (root / "sim/commands/install.cmake").read_text()
    named = re.search(r"set\(public_headers ([^)]*)\)", text)
    if not named:
        return len([name for name in files_below(root, PRODUCT) if name.endswith(".h") and "/python/" not in name])
    reached = set()
    unread = named.group(1).split()
    while unread:
        header = unread.pop()
        if header not in reached:
            reached.add(header)
            unread += re.findall(r'^\s*#\s*include "([^"]+)"', (root / header).read_text(), re.M)
    return len(reached)


def counts(root):
    """Every count of a checkout by its name, as in budget.toml."""
    found = {}
    total = collections.Counter()
    rooms = collections.defaultdict(collections.Counter)
    comments = {"header": [0, 0], "source": [0, 0]}  # lines of them, and all that are not blank
    for name in files_below(root, PRODUCT):
        path = root / name
        if path.suffix == ".md":
            continue
        room = rooms[str(path.parent.relative_to(root))]
        lines = lines_of(path)
        types = sum(1 for line in lines if TYPE.match(line)) if path.suffix in CODE else 0
        for sum_ in (room, total):
            sum_["files"] += 1
            sum_["lines"] += len(lines)
            sum_["types"] += types
            sum_["short"] += len(lines) <= SHORT and path.suffix in CODE
        if path.suffix in (".h", ".cpp"):
            kind = comments["header" if path.suffix == ".h" else "source"]
            kind[0] += sum(map(is_comment, lines))
            kind[1] += sum(1 for line in lines if line.strip())
    found["product.lines"] = total["lines"]
    found["product.files"] = total["files"]
    found["product.types"] = total["types"]
    found["product.short_files"] = total["short"]
    found["product.installed_headers"] = installed_headers(root)
    found["tests.lines"] = sum(len(lines_of(root / name)) for name in files_below(root, ["tests"])
                               if pathlib.Path(name).suffix in (".h", ".cpp", ".c", ".py", ".sh"))
    for room in sorted(rooms):
        for what in ("lines", "types", "files"):
            found[f"{room}.{what}"] = rooms[room][what]
    return found, {kind: 100.0 * n / max(1, of) for kind, (n, of) in comments.items()}


def read_budgets(text):
    table = tomllib.loads(text)
    return {f"{room}.{what}": value for room, row in table["at_most"].items() for what, value in row.items()}, \
        table["at_least"]


def write_budgets(path, budgets, least):
    rooms = {}
    for name, value in budgets.items():
        room, what = name.rsplit(".", 1)
        rooms.setdefault(room, []).append(f"{what} = {value}")
    text = ("# Budgets of the product, which tests/budget.py holds. They may only fall: the commit that raises one\n"
            "# says why in a line that begins with \"Budget:\". `tests/budget.py --lower` writes lower counts.\n"
            "[at_most]\n")
    text += "".join(f'"{room}" = {{ {", ".join(row)} }}\n' for room, row in rooms.items())
    text += "\n# Comment lines in a hundred lines that are not blank.\n[at_least]\n"
    text += "".join(f"{kind} = {value}\n" for kind, value in least.items())
    path.write_text(text)


def rises(root, commits=20):
    """Commits among the last that raised a budget and do not say why."""
    found = []
    file = "tests/budget.toml"
    for revision in git(root, "log", f"-{commits}", "--format=%H", "--", file).split():
        before, after = (git(root, "show", f"{which}:{file}") for which in (f"{revision}~1", revision))
        if not before or not after:
            continue  # the first version of the table
        before, after = read_budgets(before)[0], read_budgets(after)[0]
        raised = [name for name, value in after.items() if name in before and value > before[name]]
        message = git(root, "log", "-1", "--format=%B", revision)
        if raised and not re.search(r"^Budget:", message, re.M):
            found.append(f"{revision[:10]} raises {', '.join(raised)} without a line that begins with \"Budget:\"")
    return found


def compare(old, new):
    (a, shares_a), (b, shares_b) = counts(old), counts(new)
    for name in list(b) + [name for name in a if name not in b]:
        print(f"{name:40} {a.get(name, '-'):>8} {b.get(name, '-'):>8}")
    for side, found in (("old", a), ("new", b)):
        print(f"types per 1000 lines, {side}: {1000 * found['product.types'] / found['product.lines']:.1f}")
    for kind in shares_a:
        print(f"{'comments of a ' + kind + ', %':40} {shares_a[kind]:8.1f} {shares_b[kind]:8.1f}")
    return 0


def main(arguments):
    table = HERE / "tests/budget.toml"
    if arguments and arguments[0] != "--lower":
        return compare(pathlib.Path(arguments[0]), pathlib.Path(arguments[1]) if len(arguments) > 1 else HERE)
    found, shares = counts(HERE)
    if arguments:
        budgets, least = read_budgets(table.read_text()) if table.exists() else ({}, {})
        lowered = {name: min(value, budgets.get(name, value)) for name, value in found.items()}
        raised = {kind: max(round(share - 0.05, 1), least.get(kind, 0.0)) for kind, share in shares.items()}
        write_budgets(table, lowered, raised)
        return 0
    budgets, least = read_budgets(table.read_text())
    problems = [f"{name} is {value}, its budget is {budgets[name]}" for name, value in found.items()
                if name in budgets and value > budgets[name]]
    problems += [f"{name} has no budget: {value}" for name, value in found.items() if name not in budgets]
    problems += [f"{kind} files have {shares[kind]:.1f} % comments, at least {share} % are wanted"
                 for kind, share in least.items() if shares[kind] < share]
    problems += rises(HERE)
    for problem in problems:
        print("budget:", problem)
    print(f"product: {found['product.lines']} lines, {found['product.files']} files, "
          f"{1000 * found['product.types'] / found['product.lines']:.1f} types per 1000 lines, "
          f"{found['product.installed_headers']} installed headers; {len(problems)} problems")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
