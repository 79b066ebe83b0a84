"""The report on members: what it says of good, of bad and of unfactored ones, and the command that writes it."""

import json
import re
from dataclasses import replace
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest

from dsfab.app.cli import main
from dsfab.core.errors import PresetError, StaticsError
from dsfab.members.eurocode import Rules, utilisation
from dsfab.members.frame import MemberForces
from dsfab.preset.file import load_preset
from dsfab.report import members
from dsfab.report.html_pages import CaptionNumbers, ReportFigure
from dsfab.report.members import force_diagrams
from tests.app.pdf_text import pdf_words
from tests.members.bars import bar

PICTURE = ReportFigure("", b"", (1, 1), missing="none")


def found(N=-10e3, material="S235", **more):
    return utilisation(bar(0.1, 0.01, 0.2, N=N, My=3.0), Rules(material, 210e9, 81e9, 20e6, **more))


@pytest.mark.parametrize(
    ("given", "status", "title"),
    [
        (found(), "pass", "Each of 1 members is loaded below its resistance"),
        (
            found(combined=False),
            "unknown",
            "Each of 1 members is loaded below its resistance. These loads have no partial factors",
        ),
        (found(N=-1e6), "fail", "1 of 1 members exceed their resistance"),
        (found(N=-1e6, combined=False), "fail", "1 of 1 members exceed their resistance"),
        (found(material="PLA"), "unknown", "No standard: stress / strength"),
    ],
)
def test_the_banner_passes_only_if_the_code_passes_with_its_factors(given, status, title):
    banner = members.summary_section(given, PICTURE).blocks[0]
    assert (banner.status, banner.title) == (status, title)
    assert given.standard in banner.text


def test_the_worst_are_listed_with_clause_and_forces_in_one_unit():
    decisive, sizes = members.worst_section(found(N=[-10e3, -10e3, -12e3, -10e3, 0]), CaptionNumbers()).blocks
    name, bay, check, clause, case, share = decisive.rows[0]
    assert (name, bay, check, case) == ("A1", "N1 N2", "buckling and bending", "load")
    assert clause == "EN 1993-1-1 6.3.3 (6.61), (6.62)"
    assert re.fullmatch(r"\d+(\.\d)? %", share)
    assert sizes.head[3:] == ("N, kN", "Vy, kN", "Vz, kN", "Mt, N m", "My, N m", "Mz, N m")
    assert sizes.rows[0] == ("A1", "100 mm × 10 mm", "200 mm", "-10.00", "0.00", "0.00", "0.000", "3.000", "0.000")


def test_each_check_has_its_largest():
    (table,) = members.checks_section(found(), CaptionNumbers()).blocks
    rows = {row[0]: row for row in table.rows}
    assert rows["tension"][2:] == ("-", "0 %")
    assert rows["compression"][2:] == ("A1", "4.3 %")
    assert len(rows) == 8


def test_diagrams_show_six_forces_of_each_member_in_the_case_that_is_named(monkeypatch):
    monkeypatch.setattr("dsfab.report.members.png_with_size", lambda figure: figure)
    s = np.array([0.0, 1.0, 2.0])
    size = np.array([1e3, 2.0, 3e3, 4.0, 5e3, 6.0])  # N and N m
    forces = {"wind": np.outer([1, -1, 2], size), "snow": np.outer([3, 0, 1], size)}
    one = MemberForces("A1", s, ("N1 N2",) * 3, np.full(3, 0.1), forces)
    node = SimpleNamespace(at=(0.0, 1.0), members=("A1", "A2"))
    design = SimpleNamespace(
        member_forces={"A1": one, "A2": one}, members=SimpleNamespace(nodes_along={"A1": [node], "A2": [node]})
    )
    figure = force_diagrams(design, [("A1", "wind"), ("A2", "snow")])
    names = [axes.get_title(loc="right") for axes in figure.axes]
    assert names == 2 * ["N, kN", "Vy, N", "Vz, kN", "Mt, N m", "My, kN m", "Mz, N m"]
    for axes, (case, column) in zip(figure.axes, product(("wind", "snow"), range(6)), strict=True):
        unit = 1e3 if column % 2 == 0 else 1.0
        assert axes.lines[0].get_ydata() == pytest.approx(forces[case][:, column] / unit), (case, column)
    words = [[text.get_text() for text in axes.texts] for axes in figure.axes]
    assert words == [["A1", "wind"], *[[]] * 5, ["A2", "snow"], *[[]] * 5]


def test_the_report_lists_all_unchecked_rules():
    given = found()
    assert list(members.scope_section(given).blocks[3].items) == [
        line[0].upper() + line[1:] + "." for line in given.unchecked
    ]


def test_all_members_are_listed_in_three_columns():
    one = found()
    bays = replace(
        one.bays,
        **{key: getattr(one.bays, key) * 4 for key in ("name",)},
        member=("A1", "A2", "A3", "A4"),
        **{key: np.repeat(getattr(one.bays, key), 4, axis=0) for key in ("s", "width", "length", "curvature")},
        forces={"load": np.repeat(one.bays.forces["load"], 4, axis=0) * np.array([1, 2, 3, 4])[:, None, None]},
    )
    (table,) = members.members_section(utilisation(bays, Rules("S235", 210e9, 81e9, 0.0)), CaptionNumbers()).blocks
    assert [row[0] for row in table.rows] == ["A4", "A3"]
    assert [row[2] for row in table.rows] == ["A2", "A1"]
    assert [row[4] for row in table.rows] == ["", ""]


def test_without_bays_there_is_nothing_to_check():
    empty = replace(
        found().bays,
        **dict.fromkeys(("member", "name"), ()),
        **{
            key: np.zeros((0, *np.shape(getattr(found().bays, key))[1:]))
            for key in ("s", "width", "length", "curvature")
        },
        forces={"load": np.zeros((0, 5, 6))},
    )
    with pytest.raises(StaticsError, match="no member has a bay between two nodes"):
        utilisation(empty, Rules("S235", 210e9, 81e9, 0.0))


@pytest.mark.slow
def test_the_command_writes_a_report_and_its_tables(tmp_path, capsys):
    words = [
        "barrel_vault",
        "--set",
        "surface.edge=0.7",
        "--set",
        "statics.material=GL24h",
        "-o",
        str(tmp_path / "out"),
    ]
    assert main(["report", *words]) == 0
    names = {"report.html", "report.pdf", "barrel_vault.member_utilisation.csv", "barrel_vault.member_forces.csv"}
    assert {path.name for path in (tmp_path / "out").iterdir()} == {*names, "structure.html"}
    said = capsys.readouterr().out
    assert "EN 1995-1-1:2004 with A1 and A2, 6.1 to 6.3; GL24h" in said
    page, printed = (
        (tmp_path / "out" / "report.html").read_text(encoding="utf-8"),
        pdf_words((tmp_path / "out" / "report.pdf").read_bytes()),
    )
    table = (tmp_path / "out" / "barrel_vault.member_utilisation.csv").read_text(encoding="utf-8")
    worst = next(line for line in table.splitlines()[1:] if not line.startswith(("#", "member"))).split(",")[0]
    for text in (page, printed):
        assert "These loads have no partial factors" in text
        assert worst in text
        assert "dsfab report barrel_vault --set surface.edge=0.7" in text
    assert page.count("<img") == 1 + 4  # the structure; diagrams of ten members, three in a figure
    client = (tmp_path / "out" / "structure.html").read_text(encoding="utf-8")
    facts = json.loads(re.search(r'id="facts">(.*?)</script>', client, re.DOTALL)[1])
    assert [one["name"] for one in facts["shades"]] == ["length", "width", "utilisation", "normal force N"]
    most = max(value for value in facts["shades"][2]["values"] if value is not None)
    assert dict(facts["figures"])["most used"] == f"{worst}: {most / 100:.0%} of its capacity"
    assert {part["file"] for part in facts["parts"]} == {""}  # the drawings are in the workshop's folder


def test_a_preset_without_a_strength_is_answered_in_a_sentence_and_nothing_is_written(tmp_path, capsys):
    asked = "neither a material nor a strength, so dsfab cannot check the members; set statics.material"
    assert main(["report", "barrel_vault", "-o", str(tmp_path / "out")]) == 1
    assert asked in capsys.readouterr().err
    name = tmp_path / "x.member_utilisation.csv"
    assert main(["export", "barrel_vault", "--to", "member_utilisation.csv", "-o", str(name)]) == 1
    assert asked in capsys.readouterr().err
    with pytest.raises(PresetError, match=asked):
        load_preset("barrel_vault", {"export.formats": ["stl", "member_utilisation.csv"]})
    assert not list(tmp_path.iterdir())
