"""Several presets compared one after the other: all that can be, a sentence for the rest, and a page at the end."""

import csv
import json
import re

import pytest

from dsfab.app import compare
from dsfab.app.cli import main
from dsfab.report.compliance import summary_document
from dsfab.report.html_pages import document_html

COARSE = ["--level", "quick", "--against", "thinner", "--set", "surface.edge=0.1", "--no-report"]
THREE = ["compare", "cantilever", "domme", "cantilever_light", *COARSE]


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    folder = tmp_path_factory.mktemp("many") / "out"
    assert main([*THREE, "-o", str(folder)]) == 4
    return folder


def rows_of(folder):
    with open(folder / "summary.csv", newline="", encoding="utf-8") as file:
        return {row["name"]: row for row in csv.DictReader(file)}


def test_a_refused_preset_gets_an_error_row_and_the_comparison_continues(compared):
    rows = rows_of(compared)
    assert list(rows) == ["cantilever", "domme", "cantilever_light"]
    assert "did you mean dome?" in rows["domme"]["error"]
    for name in ("cantilever", "cantilever_light"):
        told = json.loads((compared / name / "results.json").read_text(encoding="utf-8"))
        design, thinner = (
            next(row for row in told["competitors"] if row["name"] == of) for of in ("design", "thinner")
        )
        assert float(rows[name]["compliance_J"]) == design["compliance_J"]
        assert float(rows[name]["thinner_ratio"]) == thinner["ratio_to_design"]
        assert rows[name]["verdict"] == "unknown"  # one solve shows no convergence
        assert told["command"].startswith(f"dsfab compare {name} --set surface.edge=0.1")
    text = (compared / "summary.html").read_text(encoding="utf-8")
    assert "Of 3 designs: 2 unknown and 1 refused." in text
    assert "did you mean dome?" in text
    assert not re.search(r'(src|href)="(http|//)', text)


@pytest.mark.slow
def test_resuming_computes_missing_rows_and_rows_with_other_options(compared, monkeypatch, capsys):
    made, real = [], compare.compare_one

    def noted(given, *rest, **named):
        made.append(given.name)
        return real(given, *rest, **named)

    monkeypatch.setattr(compare, "compare_one", noted)
    before = (compared / "cantilever" / "results.json").read_bytes()
    assert main([*THREE, "--resume", "-o", str(compared)]) == 4
    assert made == []
    assert capsys.readouterr().err.count("compared already") == 2
    (compared / "cantilever_light" / "results.json").write_text("{", encoding="utf-8")
    assert main([*THREE, "--resume", "-o", str(compared)]) == 4
    assert made == ["cantilever_light"]
    assert (compared / "cantilever" / "results.json").read_bytes() == before
    assert main([*THREE, "--set", "statics.thickness=0.02", "--resume", "-o", str(compared)]) == 4
    assert made == ["cantilever_light", "cantilever", "cantilever_light"]


def test_two_presets_of_one_name_do_not_overwrite_each_other(tmp_path, monkeypatch, capsys):
    found = {"verdict": "pass", "reason": "", "mass_kg": 1.0, "area_fraction": 0.5, "compliance_J": 1.0, "bound": 0.01}
    row = {"name": "design", "volume": None, **found, "ratio_to_full": 2.0, "seconds": 1.0}

    def compared_in_no_time(preset, task, folder, *_, **__):
        folder.mkdir(exist_ok=True)
        (folder / "results.json").write_text(json.dumps({"competitors": [row]}), encoding="utf-8")

    monkeypatch.setattr(compare, "compare_one", compared_in_no_time)
    assert main(["compare", "cantilever", "cantilever", "-o", str(tmp_path), "--json"]) == 4
    first, second = json.loads(capsys.readouterr().out)
    assert (first["verdict"], first["error"]) == ("pass", "")
    assert second["error"].startswith("two presets have the name cantilever")
    assert main(["compare", "cantilever", "dome", "-o", str(tmp_path), "--quiet"]) == 0


def test_the_page_links_reports_and_says_why_designs_fail(tmp_path):
    report = tmp_path / "a b" / "report.html"
    report.parent.mkdir()
    report.write_text("", encoding="utf-8")
    sound = {"verdict": "pass", "reason": "", "mass_kg": 2.0, "area_fraction": 0.4, "compliance_J": 3.0, "bound": 0.01}
    lost = {**dict.fromkeys(sound), "verdict": "fail", "reason": "the load <finds> nothing", "ratio_to_full": None}
    rows = [
        {
            "name": "a b",
            "folder": report.parent,
            "error": "",
            **sound,
            "ratio_to_full": 1.5,
            "simp_ratio": 0.8,
            "seconds": 4,
        },
        {"name": "b", "folder": tmp_path / "b", "error": "", **lost, "seconds": 1},
    ]
    text = document_html(summary_document(rows, ("simp",), tmp_path))
    assert '<a href="a%20b/report.html">a b</a>' in text
    assert "0.800 ×" in text
    assert "the load &lt;finds&gt; nothing" in text
    assert "Of 2 designs: 1 pass and 1 fail." in text
