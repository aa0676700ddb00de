#!/usr/bin/env python3
"""Loads the page of a study and that of an identification in Chromium, with the standard library
alone: no request, an empty console, tables as in budget.json and belief.json, values under the
cursor and by the arrow keys, CSV with every digit, both languages, a file that is cut off.

figures_webdriver.py ABBE SCENES [FOLDER]: with a FOLDER its pictures stay there. Leaves with 77
where there is no chromium or no chromedriver."""

import csv
import io
import json
import subprocess
import sys

from webdriver import check_cut_off, check_quiet, open_page, run, save_print

STUDY = """title = "budget"
scene = "%s/gantry_dome.toml"
set = { part.vertices = 300, sampling.max_step_mm = 1000 }
responses = ["pv", "rms"]
limits = { pv_um = 20 }
cases = ["uncompensated", "perfect-iterated-ideal"]
influence = { checks = 1, sheet = true, pictures = ["EX0C"] }
[[inputs]]
every = "element"
of = ["EX0C", "EY0C", "EZZ", "EXX", "EAA", "EZ0A"]
spread = 1
low = -3
high = 3
[one_at_a_time]
[monte_carlo]
cases = 100
[sobol_indices]
base_points = 16
"""


def table(browser, block):
    """Heads and cells of a table as they are shown; a number with every digit."""
    return browser.js(
        f"const t=document.querySelector('#b-{block} table');"
        "return [[...t.tHead.rows[0].cells].map(c=>c.textContent),...[...t.tBodies[0].rows].map(r=>"
        "[...r.cells].map(c=>c.dataset.value===undefined?c.textContent:+c.dataset.value))]")


def check_languages(browser, block, english, chinese, shot):
    title = f"return document.querySelector('#b-{block} h2').textContent"
    assert browser.js(title) == english, browser.js(title)
    browser.js("document.getElementById('language').click()")
    assert browser.js(title) == chinese, browser.js(title)
    assert browser.js("return document.documentElement.lang") == "zh"
    empty = browser.js("return [...document.querySelectorAll('[data-label]')]"
                       ".filter(e=>!e.textContent).map(e=>e.dataset.label)")
    assert not empty, empty
    browser.js("scrollTo(0,0)")
    browser.picture(shot)
    browser.js("document.getElementById('language').click()")
    assert browser.js(title) == english


def check_cursor(browser, block, words):
    """What stands under the cursor over the first bar, and by the arrow keys."""
    browser.js(f"document.querySelector('#b-{block}').scrollIntoView()")
    browser.js(f"const r=document.querySelector('#b-{block} svg rect'),b=r.getBoundingClientRect();"
               "r.dispatchEvent(new PointerEvent('pointermove',{bubbles:true,"
               "clientX:b.x+b.width/2,clientY:b.y+b.height/2}))")
    tip = browser.js("const t=document.getElementById('tip');return t.hidden?'':t.textContent")
    assert all(word in tip for word in words), (tip, words)
    browser.js(f"const s=document.querySelector('#b-{block} svg');"
               "s.dispatchEvent(new PointerEvent('pointerleave'))")
    assert browser.js("return document.getElementById('tip').hidden")
    browser.js(f"const s=document.querySelector('#b-{block} svg');s.focus();"
               "s.dispatchEvent(new KeyboardEvent('keydown',{key:'ArrowDown'}))")
    assert browser.js("return document.getElementById('tip').textContent") == tip


def check_study(browser, folder, page, shots):
    budget = json.loads((folder / "budget.json").read_text())
    open_page(browser, page)
    browser.picture(shots / "study.png")
    shown = table(browser, "figures")
    responses = [(arm, one) for arm in budget["arms"] for one in arm["responses"]]
    assert len(shown) == 1 + len(responses) == 5, shown
    for row, (arm, one) in zip(shown[1:], responses):
        values = dict(zip(shown[0], row))
        assert values["variant and case"] == arm["name"]
        assert values["base"] == one["base"] and values["sum"] == one["sum"]
        assert values["mean"] == one["monte_carlo"]["mean"]["value"]
        assert values["P95"] == one["monte_carlo"]["p95"]["value"]
    # a chart of one arm at a time, the largest change first
    changes = {one["input"]: one for one in budget["arms"][0]["responses"][0]["contributions"]}
    largest = max(changes.values(), key=lambda c: max(abs(c["low"]), abs(c["high"])))
    check_cursor(browser, "tornado-0-pv", [largest["input"], f"{largest['low']:.4g}".replace("-", "−")])
    visible = "return !document.getElementById('b-tornado-%d-pv').hidden"
    assert browser.js(visible % 0) and not browser.js(visible % 1)
    browser.js("const g=document.getElementById('group');g.selectedIndex=1;"
               "g.dispatchEvent(new Event('change'))")
    assert browser.js(visible % 1) and not browser.js(visible % 0)
    browser.js("const g=document.getElementById('group');g.selectedIndex=0;"
               "g.dispatchEvent(new Event('change'))")
    rows = list(csv.reader(io.StringIO(browser.js("return abbe.csvOf('indices-0-rms')"))))
    assert rows[0] == ["name", "total", "total low", "total high", "alone", "alone low",
                       "alone high"], rows[0]
    of_rms = {one["input"]: one for one in budget["arms"][0]["responses"][1]["contributions"]}
    assert len(rows) == 1 + len(of_rms)
    for row in rows[1:]:
        total = of_rms[row[0]]["sobol_total"]
        assert [float(v) for v in row[1:4]] == [total["value"], total["low"], total["high"]], row
    # a head sorts its table, down first
    browser.js("document.querySelector('#b-inputs-0-pv th:nth-child(5) button').click()")
    column = [row[4] for row in table(browser, "inputs-0-pv")[1:]]
    assert column == sorted(column, reverse=True) and len(column) == 6, column
    assert browser.js("return document.querySelector('#b-influence-maps img').naturalWidth") > 100
    browser.js("document.getElementById('b-distribution-pv').scrollIntoView()")
    browser.picture(shots / "study_distribution.png")
    check_languages(browser, "figures", "Figures by response", "各响应的数值",
                    shots / "study_zh.png")
    save_print(browser, shots / "study.pdf")
    check_quiet(browser, page)
    print(f"{len(responses)} responses and {len(of_rms)} inputs are as in budget.json")


def check_identification(browser, belief, page, shots):
    report = json.loads(belief.read_text())
    open_page(browser, page)
    browser.js("[...document.querySelectorAll('#b-numbers .bar button')]"
               ".find(b=>b.textContent.includes('all'))?.click()")
    shown = table(browser, "numbers")
    assert len(shown) == 1 + len(report["numbers"]) > 20
    for row, one in zip(shown[1:], report["numbers"]):
        u = one["standard_uncertainty"]
        assert row[0] == one["name"] and row[2] == one["value"], row
        assert row[3] == ("–" if u is None else u), row
        assert row[5] or u is not None, row
    curves = browser.js("return abbe.index.blocks.find(b=>b.id==='curves').panels.length")
    assert curves > 3
    browser.js("document.getElementById('b-curves').scrollIntoView()")
    browser.picture(shots / "curves.png")
    browser.js("document.getElementById('b-residuals').scrollIntoView()")
    browser.picture(shots / "residuals.png")
    check_languages(browser, "curves", "Elements along their axes", "各误差元素随轴位置的变化",
                    shots / "identification_zh.png")
    check_quiet(browser, page)
    print(f"{len(report['numbers'])} numbers are as in belief.json, {curves} curves")


def check(browser, abbe, scenes, folder, shots, _port):
    def do(*words):
        subprocess.run([abbe, *map(str, words)], check=True, stdout=subprocess.DEVNULL)

    (folder / "study.toml").write_text(STUDY % scenes)
    study = folder / "study"
    do("study", folder / "study.toml", "--report", "--out", study)
    check_study(browser, study, study / "report.html", shots)
    do("measure", f"{scenes}/gantry_calibration.toml", "--out", folder / "readings")
    do("identify", *[folder / "readings" / f"{name}.csv" for name in ("laser", "square", "level")],
        "--order", "3", "--report", "--out", folder / "belief.toml")
    check_identification(browser, folder / "belief.json", folder / "belief.html", shots)
    check_cut_off(browser, folder / "belief.html", folder)


if __name__ == "__main__":
    sys.exit(run(check))
