"""The page of a sweep, used as a person does: brush an axis, sort a column, click on a design."""

import json
import re

import numpy as np
import pytest

from dsfab.preset.file import load_preset
from dsfab.report.sweep_pages import sweep_page
from dsfab.study.sweeps.folder import SweepFolder
from dsfab.study.sweeps.plan import plan_from
from dsfab.study.sweeps.runs import RunRow
from tests.app.editor_page import until
from tests.browser import browser, opened
from tests.presets import DOME_MODES

ASKED = {
    "preset": DOME_MODES,
    "vary": {
        "pattern.major.frequency": {"from": 4.0, "to": 12.0},
        "pattern.width.rule": ["plain", "constant", "graded"],
    },
    "sampling": "sobol:5000",
    "metrics": ["compliance", "sheet_mass", "pieces"],
    "constraints": ["pieces == 1"],
}
"""A sweep whose numbers are made up below: 5000 designs would take an hour."""


def rows(count: int) -> list[RunRow]:
    """Every 50th failed, every 10th is in two pieces; run 7 is the stiffest, run 9 the lightest."""
    draw, found = np.random.default_rng(1), []
    for n in range(1, count + 1):
        mass = 1e4 + 3e4 * draw.random()
        if n == 9:
            mass = 5e3
        compliance = 1.0 if n == 7 else 1e6 / mass * (1 + draw.exponential())
        changes = {
            "pattern.major.frequency": round(4 + 8 * n / count, 4),
            "pattern.width.rule": ("plain", "constant", "graded")[n % 3],
        }
        values = {"compliance": compliance, "sheet_mass": mass, "pieces": 2.0 if n % 10 == 5 else 1.0}
        if n % 50 == 0:
            found.append(RunRow(n, changes, "failed", {}, "the sheet </script> falls apart & carries <nothing>"))
        else:
            found.append(RunRow(n, changes, "done", values, "", (f"pictures/{n:05}.png",), 0.5))
    return found


def folder_at(path) -> SweepFolder:
    return SweepFolder(path, plan_from(ASKED), load_preset(DOME_MODES))


def test_the_page_holds_every_run_and_asks_nobody_for_anything(tmp_path):
    text = sweep_page(folder_at(tmp_path / "my sweep"), rows(100), "compliance", "sheet_mass")
    facts = json.loads(re.search(r'id="facts">(.*?)</script>', text, re.DOTALL)[1])
    assert [run[0] for run in facts["runs"]] == list(range(1, 101))
    assert [run[1] for run in facts["runs"]].count("failed") == 2
    assert facts["runs"][49][3] == [None, None, None]
    assert facts["runs"][49][7] == rows(100)[49].error
    assert sum(run[4] for run in facts["runs"]) == 88
    assert facts["command"] == f"dsfab sweep '{tmp_path / 'my sweep'}' --build "
    assert "http" not in text.replace("https://", "http://").split('id="facts"')[0]
    assert not re.search(r"""(src|href)=["'](?!data:)""", text)


def test_numbers_that_are_none_do_not_break_the_page(tmp_path):
    odd = [RunRow(1, {"a.b": float("inf")}, "done", {"compliance": float("inf"), "sheet_mass": 1.0})]
    text = sweep_page(
        folder_at(tmp_path), [RunRow(1, {"a.b": "x"}, "done", odd[0].metrics)], "compliance", "sheet_mass"
    )
    assert "Infinity" not in re.search(r'id="facts">(.*?)</script>', text, re.DOTALL)[1]


needs_browser = pytest.mark.skipif(browser() is None, reason="no Chromium or Chrome is installed")


@pytest.fixture(scope="module")
def tab(tmp_path_factory):
    """The page of 5000 runs in a browser."""
    from PIL import Image

    folder = tmp_path_factory.mktemp("sweep")
    (folder / "pictures").mkdir()
    for row in rows(5000):
        if row.files and row.number < 60:
            Image.new("RGB", (480, 360), (220, 156, 122)).save(folder / row.files[0])
    (folder / "index.html").write_text(
        sweep_page(folder_at(folder), rows(5000), "compliance", "sheet_mass"), encoding="utf-8"
    )
    with opened(tmp_path_factory.mktemp("browser")) as one:
        one.open((folder / "index.html").as_uri(), "document.body && document.body.dataset.ready === '1'")
        yield one


def page_box(tab, name: str) -> dict[str, float]:
    return tab.run(f"JSON.parse(JSON.stringify(document.getElementById('{name}').getBoundingClientRect()))")


def shown(tab) -> int:
    return int(tab.run("document.getElementById('shown').textContent").split()[0])


@needs_browser
def test_the_page_selects_the_best_run_and_counts_failed_runs(tab):
    assert tab.run("document.getElementById('title').textContent") == "dome_modes"
    line = tab.run("document.getElementById('line').textContent")
    assert line == "5000 runs: 4900 done, 100 failed; 4400 meet pieces == 1"
    assert tab.run("document.querySelector('#detail h2').textContent") == "Run 7"
    assert shown(tab) == 5000
    assert tab.errors == []


@needs_browser
def test_only_rows_that_are_seen_are_in_the_table(tab):
    assert 5 < tab.run("document.querySelectorAll('#body tr[data-run]').length") < 40
    tab.run("document.getElementById('frame').scrollTop = 59 * 2500")
    until(tab, "!!document.querySelector('#body tr[data-run=\"2501\"]')")
    numbers = tab.run("[...document.querySelectorAll('#body tr[data-run]')].map((row) => Number(row.dataset.run))")
    assert 5 < len(numbers) < 40
    tab.run("document.getElementById('frame').scrollTop = 0")


@needs_browser
def test_brushing_an_axis_selects(tab):
    parallel = page_box(tab, "parallel")
    x, top, bottom = tab.run("[layout.x[0], layout.top, layout.bottom]")
    left, up = parallel["left"] + x, parallel["top"]
    tab.drag(left, up + bottom, up + (top + bottom) / 2)  # the lower half of the frequencies
    assert shown(tab) == pytest.approx(2500, abs=15)
    rules = tab.run("layout.x[1]")
    tab.drag(parallel["left"] + rules, up + bottom + 4, up + bottom - 12)  # constant, the first by name
    assert shown(tab) == pytest.approx(2500 / 3, abs=15)
    tab.click(left, up + (top + bottom) / 2)  # a click takes the brush away
    assert shown(tab) == pytest.approx(5000 / 3, abs=2)
    tab.run("document.getElementById('clear').click()")
    assert shown(tab) == 5000


@needs_browser
def test_brushing_a_metric_hides_failed_runs_without_this_metric(tab):
    parallel = page_box(tab, "parallel")
    i = tab.run("axes.findIndex((one) => one.name === 'compliance')")
    x, top, bottom = tab.run(f"[layout.x[{i}], layout.top, layout.bottom]")
    tab.drag(parallel["left"] + x, parallel["top"] + top - 3, parallel["top"] + bottom + 2)
    assert shown(tab) == 4900
    tab.run("document.getElementById('clear').click()")


@needs_browser
def test_sorting_by_a_column(tab):
    head = "[...document.querySelectorAll('#head th')].find((one) => one.textContent.startsWith('sheet_mass'))"
    first = "Number(document.querySelector('#body tr[data-run]').dataset.run)"
    place = tab.run(f"JSON.parse(JSON.stringify({head}.getBoundingClientRect()))")
    middle = (place["left"] + place["width"] / 2, place["top"] + place["height"] / 2)
    tab.click(*middle)
    assert tab.run(first) == 9
    assert tab.run(f"{head}.getAttribute('aria-sort')") == "ascending"
    tab.click(*middle)
    assert tab.run(f"{head}.getAttribute('aria-sort')") == "descending"
    heaviest = max((row for row in rows(5000) if row.metrics), key=lambda row: row.metrics["sheet_mass"])
    assert tab.run(first) == heaviest.number
    assert tab.run("visible.at(-1).state") == "failed"  # what has no number comes last either way


@needs_browser
def test_clicking_a_row_shows_the_design_its_parameters_and_its_command(tab):
    tab.run("document.querySelectorAll('#head button')[0].click()")  # by number
    tab.run("document.querySelector('#body tr[data-run=\"3\"]').scrollIntoView({block: 'center'})")
    place = tab.run(
        "JSON.parse(JSON.stringify(document.querySelector('#body tr[data-run=\"3\"]').getBoundingClientRect()))"
    )
    tab.click(place["left"] + 200, place["top"] + 20)
    assert tab.run("document.querySelector('#detail h2').textContent") == "Run 3"
    assert tab.run("document.querySelector('#detail code').textContent").endswith(" --build 3")
    terms = dict(
        tab.run(
            "[...document.querySelectorAll('#detail dl div')].map((one) => [...one.children].map((d) => d.textContent))"
        )
    )
    assert terms["pattern.major.frequency"] == "4.005"
    assert terms["pattern.width.rule"] == "plain"
    assert until(tab, "document.querySelector('#detail img').naturalWidth") == 480
    tab.key("ArrowDown")
    assert tab.run("document.querySelector('#detail h2').textContent") == "Run 4"


@needs_browser
def test_clicking_a_point_of_the_scatter(tab):
    place, (x, y) = page_box(tab, "scatter"), tab.run("dots.find((dot) => dot[2].number === 9).slice(0, 2)")
    tab.click(place["left"] + x, place["top"] + y)
    assert tab.run("document.querySelector('#detail h2').textContent") == "Run 9"
    assert "Pareto front" in tab.run("document.querySelector('#detail .note').textContent")


@needs_browser
def test_the_front_is_that_of_the_results(tab):
    from dsfab.study.sweeps.folder import pareto

    expected = [row.number for row in pareto(rows(5000), "sheet_mass", "compliance", plan_from(ASKED).limits)]
    assert tab.run("frontRuns.map((run) => run.number)") == expected
    tab.run("document.getElementById('only').click()")
    assert shown(tab) == len(expected)
    tab.run("document.getElementById('clear').click()")


@needs_browser
def test_a_failed_run_shows_its_reason_as_text(tab):
    tab.run("choose(byNumber.get(50))")
    assert tab.run("document.querySelector('#detail .none').textContent") == rows(50)[49].error
    assert tab.run("document.querySelectorAll('#detail nothing').length") == 0


@needs_browser
def test_the_page_makes_no_network_request_and_no_error(tab):
    assert [url for url in tab.requests if not url.startswith(("file:", "data:"))] == []
    assert [error for error in tab.errors if "ERR_FILE_NOT_FOUND" not in error] == []
