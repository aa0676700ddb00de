#!/usr/bin/env python3
"""Builds the site of abbe, static HTML, from its own documents.

site.py ROOT PROGRAM OUT: the READMEs, the tour, formats and figures unchanged, the help of every
command as printed by PROGRAM, the reference of `import abbe` from the module next to it, and that of
the C++ headers from Doxygen. Needs mkdocs with the theme "material"; without the module or Doxygen
their references are omitted with a message. A broken link is an error.
"""
import importlib.util
import inspect
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

root, program, out = (pathlib.Path(word).resolve() for word in sys.argv[1:4])

PAGES = [  # title, file or list of them
    ("abbe", "README.md"),
    ("Tour", "scenes/TOUR.md"),
    ("Using it", [
        ("Scenes and files", "scenes/README.md"),
        ("Studies", "scenes/studies/README.md"),
        ("Commands", "commands.md"),
        ("Python", "sim/python/README.md"),
        ("Python reference", "python.md"),
        ("Compensators", "sim/compensation/README.md"),
        ("Programs and dialects", "sim/dialects/README.md"),
        ("Parts", "scenes/parts/README.md"),
        ("Figures of the scenes", "scenes/FIGURES.md"),
        ("Glossary", "scenes/GLOSSARY.md"),
    ]),
    ("How it works", [
        ("Kinematics", "kinematics/README.md"),
        ("Errors", "errors/README.md"),
        ("Metrology", "errors/metrology/README.md"),
        ("Identification", "errors/identification/README.md"),
        ("Cutting", "cutting/README.md"),
        ("Programs", "sim/program/README.md"),
        ("Study engine", "sim/study/README.md"),
    ]),
    ("Verification", [
        ("Contributing", "CONTRIBUTING.md"),
        ("Tests", "tests/README.md"),
        ("Oracles", "tests/oracles/README.md"),
        ("Golden programs", "tests/golden/README.md"),
    ]),
    ("中文", [("说明", "README.zh.md"), ("导览", "scenes/TOUR.zh.md")]),
    ("Changes", "CHANGELOG.md"),
]

CONFIG = """site_name: abbe
site_description: a virtual five-axis machine tool that is wrong on purpose
docs_dir: {docs}
site_dir: {out}
use_directory_urls: false
theme:
  name: material
  font: false
  palette:
    - media: "(prefers-color-scheme: light)"
      scheme: default
    - media: "(prefers-color-scheme: dark)"
      scheme: slate
  features: [navigation.tabs, navigation.top, toc.follow]
plugins: [search]
markdown_extensions: [tables, fenced_code, sane_lists, attr_list, toc: {{permalink: true}}]
nav:
{nav}"""


def say(text):
    print(f"abbe docs: {text}", file=sys.stderr)


def pages_of(entries):
    for _, page in entries:
        yield from pages_of(page) if isinstance(page, list) else [page]


def nav_of(entries, indent="  "):
    text = ""
    for title, page in entries:
        if isinstance(page, list):
            text += f"{indent}- {title}:\n" + nav_of(page, indent + "    ")
        else:
            text += f"{indent}- {title}: {page}\n"
    return text


LINK = re.compile(r"(!?\[[^\]]*\])\(([^)#\s]*)(#[^)]*)?\)")


def stage(page, docs, missing):
    """Copies a page with its pictures and linked files; a link to a folder becomes one to its README."""
    source, target = root / page, docs / page
    target.parent.mkdir(parents=True, exist_ok=True)

    def linked(match):
        text, link, place = match.group(1), match.group(2), match.group(3) or ""
        if not link or "://" in link or link.startswith("mailto:"):
            return match.group(0)
        file = (source.parent / link).resolve()
        if file.is_dir() and (file / "README.md").is_file():
            return f"{text}({link.rstrip('/')}/README.md{place})"
        if file.is_dir():
            return text[1:-1] if not text.startswith("!") else text  # no README in the folder
        if not file.is_file() or root not in file.parents:
            missing.append(f"{page}: {link}")
            return match.group(0)
        copy = docs / file.relative_to(root)
        if file.suffix != ".md" and not copy.exists():
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(file, copy)
        return match.group(0)

    target.write_text(LINK.sub(linked, source.read_text(encoding="utf-8")), encoding="utf-8")


def commands():
    def said(*words):
        return subprocess.run([program, *words], capture_output=True, text=True, check=True).stdout

    whole = said("--help")
    text = f"# Commands\n\n```text\n{whole}```\n"
    for name in re.findall(r"^  ([a-z]+) {2,}\S", whole, re.MULTILINE):
        text += f"\n## abbe {name}\n\n```text\n{said(name, '--help')}```\n"
    return text


def python_reference():
    """Returns every class and function of the module with its docstring."""
    found = sorted(program.parent.glob("abbe.*.so"))
    if not found:
        say("Python reference omitted: the module is not built (./abbe setup --python)")
        return "# Python reference\n\nThis site was built without the module: `./abbe setup --python`.\n"
    spec = importlib.util.spec_from_file_location("abbe", found[0])
    abbe = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(abbe)

    def block(text):
        return f"```text\n{inspect.cleandoc(text or '')}\n```\n\n"

    text = f"# Python reference\n\n{block(abbe.__doc__)}## Functions\n\n"
    public = {name: value for name, value in vars(abbe).items() if not name.startswith("_")}
    for name, value in public.items():
        if not inspect.isclass(value):
            text += f"### {name}\n\n{block(value.__doc__)}"
    for name, value in public.items():
        if not inspect.isclass(value):
            continue
        text += f"## {name}\n\n{inspect.cleandoc(value.__doc__ or '')}\n\n"
        if issubclass(value, BaseException):
            continue
        text += "| name | meaning |\n|---|---|\n"
        for member, held in vars(value).items():
            if member.startswith("_"):
                continue
            said = " ".join(inspect.cleandoc(held.__doc__ or "").split()).replace("|", "\\|")
            text += f"| `{member}` | {said} |\n"
        text += "\n"
    return text


def cpp_reference(folder):
    if not shutil.which("doxygen"):
        return say("C++ reference omitted: doxygen is not installed")
    folder.mkdir(parents=True)
    settings = {
        "PROJECT_NAME": "abbe", "OUTPUT_DIRECTORY": folder.parent, "HTML_OUTPUT": folder.name,
        "INPUT": " ".join(str(root / one) for one in ("kinematics", "errors", "cutting", "render", "sim")),
        "FILE_PATTERNS": "*.h", "RECURSIVE": "YES", "EXTRACT_ALL": "YES", "GENERATE_LATEX": "NO",
        "STRIP_FROM_PATH": root, "QUIET": "YES", "WARNINGS": "NO", "WARN_IF_DOC_ERROR": "NO", "WARN_IF_INCOMPLETE_DOC": "NO", "JAVADOC_AUTOBRIEF": "YES",
        "HAVE_DOT": "NO", "SORT_MEMBER_DOCS": "NO", "FULL_PATH_NAMES": "YES", "VERBATIM_HEADERS": "NO", "HTML_TIMESTAMP": "NO",
    }
    text = "".join(f"{key} = {value}\n" for key, value in settings.items())
    subprocess.run(["doxygen", "-"], input=text, text=True, check=True, stdout=subprocess.DEVNULL)


def main():
    if not shutil.which("mkdocs"):
        say("expected mkdocs with the theme material (apt-get install mkdocs-material), seen none")
        return 2
    with tempfile.TemporaryDirectory(prefix="abbe-docs-") as scratch:
        docs, missing = pathlib.Path(scratch) / "docs", []
        generated = {"commands.md": commands, "python.md": python_reference}
        docs.mkdir()
        for page in pages_of(PAGES):
            if page in generated:
                (docs / page).write_text(generated[page](), encoding="utf-8")
            else:
                stage(page, docs, missing)
        if missing:
            say("broken links:\n  " + "\n  ".join(missing))
            return 3
        built = pathlib.Path(scratch) / "site"
        config = pathlib.Path(scratch) / "mkdocs.yml"
        nav = nav_of(PAGES)
        if shutil.which("doxygen"):
            nav += "  - C++ reference: cpp/index.html\n"
            cpp_reference(docs / "cpp")
        config.write_text(CONFIG.format(docs=docs, out=built, nav=nav), encoding="utf-8")
        done = subprocess.run(["mkdocs", "build", "--strict", "--quiet", "-f", config])
        if done.returncode != 0:
            return 3
        if out.exists():
            if not (out / "sitemap.xml").is_file():
                say(f"{out}: expected a new folder or one with an earlier site")
                return 5
            shutil.rmtree(out)
        out.parent.mkdir(parents=True, exist_ok=True)
        shutil.move(built, out)
    say(f"{out}/index.html")
    return 0


if __name__ == "__main__":
    sys.exit(main())
