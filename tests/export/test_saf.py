"""Structural Analysis Format: the published tables, and what another program finds of the file alone."""

from dataclasses import replace

import numpy as np
import pytest

from dsfab.app.build import Files
from dsfab.app.cli import main
from dsfab.app.export import format_suffix
from dsfab.core.errors import ExportError
from dsfab.design import Design
from dsfab.design.member_model import action_cases
from dsfab.export import FORMATS, Details
from dsfab.members.frame import solve_frame
from dsfab.preset.file import load_preset
from dsfab.surface import Cladding, Combination, Pressure, SelfWeight, Snow
from tests.designs import coarse_design
from tests.export.saf_members import ACTIONS, crooked, written
from tests.opensees import solved_script
from tests.pynite import solved_from
from tests.saf import faults, read, sums


def test_the_workbook_has_the_columns_of_the_published_tables(tmp_path):
    book = read(written(crooked(), tmp_path / "crooked.saf.xlsx"))
    assert faults(book) == []
    assert book["Project"][0]["Name"] == "crooked"
    assert book["StructuralMaterial"][0] == pytest.approx(
        {
            "Name": "material of the preset",
            "Type": "Other",
            "Quality": "material of the preset",
            "Unit mass [kg/m3]": 7850,
            "E modulus [MPa]": 200e3,
            "G modulus [MPa]": 200e3 / 2.6,
            "Poisson Coefficient": 0.3,
            "Thermal expansion [1/K]": None,
        }
    )
    (section,) = book["StructuralCrossSection"]
    assert section["Parameters [mm]"] == "50; 123"  # as high as the sheet is thick, as wide as the rib
    assert section["Iz [m4]"] == pytest.approx(0.05 * 0.123**3 / 12)
    assert section["Iy [m4]"] == pytest.approx(0.123 * 0.05**3 / 12)
    member = book["StructuralCurveMember"][2]
    assert (member["Name"], member["Nodes"], member["Layer"]) == ("A1.3", "K2; K3", "A1")
    assert [member[f"Coordinate {axis} [m]"] for axis in "XYZ"] == pytest.approx(crooked().axes[2, 2])
    support = {row["Node"]: row for row in book["StructuralPointSupport"]}
    assert [support["K4"][word] for word in ("ux", "uy", "uz", "fix", "fiy", "fiz")] == ["Rigid"] * 3 + ["Free"] * 3
    assert (support["K0"]["Type"], support["K4"]["Type"], support["K5"]["Type"]) == ("Fixed", "Hinged", "Custom")
    assert support["K5"]["Stiffness Z [MN/m]"] == pytest.approx(2)
    assert [row["Load type"] for row in book["StructuralLoadCase"]] == ["Standard", "Snow", "Standard"]
    assert book["StructuralLoadCombination"][1]["Load factor 2"] == -1.5
    assert sum(row["Value [kN]"] for row in book["StructuralPointAction"] if row["Direction"] == "Z") == pytest.approx(
        -10
    )
    assert [(row["Direction"], row["Value [kNm]"]) for row in book["StructuralPointMoment"]] == [
        ("Mx", 0.01),
        ("My", -0.02),
    ]


@pytest.mark.parametrize(
    ("sheet", "column", "value", "said"),
    [
        ("StructuralCurveMember", "LCS", "z by eye", "LCS is 'z by eye'"),
        ("StructuralCurveMember", "Cross section", "CS9", "'CS9' is in no StructuralCrossSection"),
        ("StructuralPointSupport", "ux", "Flexible", "ux is Flexible and Stiffness X"),
        ("StructuralPointConnection", "Name", "K1", "names come twice"),
        ("Model", "SAF Version", "1.0", "SAF Version is '1.0'"),
    ],
)
def test_the_checker_of_the_tests_finds_planted_faults(tmp_path, sheet, column, value, said):
    book = read(written(crooked(), tmp_path / "crooked.saf.xlsx"))
    book[sheet][0][column] = value
    assert any(said in fault for fault in faults(book))


def test_another_program_solves_the_file_alone(tmp_path):
    made = replace(crooked(), spring=np.zeros((6, 6)))
    rounded = replace(made, width=np.full(5, 0.123))  # as the file has it
    ours, theirs = solve_frame(rounded, shear=False), solved_from(read(written(made, tmp_path / "x.saf.xlsx")))
    for name in ("dead", "snow", "crowd", "ULS 1", "lifted"):
        for k, node in enumerate(made.nodes):
            assert theirs[name][node].u == pytest.approx(ours[name].u[k], abs=1e-6 * np.abs(ours[name].u).max())


def test_another_program_solves_the_script_for_opensees(tmp_path):
    """Springs among them; without shear, as PyNite's beams are."""
    made = crooked()
    found, ours = solved_script(written(made, tmp_path / "crooked.tcl")), solve_frame(made, shear=False)
    assert tuple(found) == tuple(ours) == ("dead", "snow", "crowd", "ULS 1", "lifted")
    for name in found:
        assert found[name].u == pytest.approx(ours[name].u, abs=1e-9 * np.abs(ours[name].u).max())
        largest = np.abs(ours[name].reaction).max()
        assert found[name].reaction[[0, 4]] == pytest.approx(ours[name].reaction[[0, 4]], abs=1e-9 * largest)


def test_weight_is_in_no_group_of_snow(tmp_path):
    """Of a case with both: each a case of its own, and the case their sum."""
    preset = load_preset("slab", {"surface.edge": 0.5})
    given = preset.surface
    loads = (SelfWeight(), Cladding(250.0), Snow(1000.0), Pressure(500.0, case="crowd"))
    sums = (Combination("ULS", {"load": 1.35, "crowd": 1.5}),)
    said = preset.model_copy(update={"surface": given.model_copy(update={"load": loads, "combination": sums})})
    design = Design.from_preset(said)
    cases = action_cases(said, design.surface, design.statics)
    assert {name: (one.case, one.action) for name, one in cases.items()} == {
        "load permanent": ("load", "permanent"),
        "load snow": ("load", "snow"),
        "crowd": ("crowd", "variable"),
    }
    area, weight = design.surface.area, said.statics.area_weight
    for name, pressure in (("load permanent", weight + 250), ("load snow", 1000), ("crowd", 500)):
        assert np.linalg.norm(cases[name].load.force.sum(axis=0)) == pytest.approx(pressure * area), name
    told = said.model_copy(update={"surface": said.surface.model_copy(update={"actions": {"load": "permanent"}})})
    assert list(action_cases(told, design.surface, design.statics)) == ["load", "crowd"]


def test_of_cases_of_snow_one_acts_at_a_time(tmp_path):
    groups = {row["Name"]: row for row in read(written(crooked(), tmp_path / "x.saf.xlsx"))["StructuralLoadGroup"]}
    assert [groups[f"LG {kind}"]["Relation"] for kind in ("permanent", "snow", "variable")] == [
        "Standard",
        "Exclusive",
        "Standard",
    ]


def test_the_same_design_gives_the_same_bytes(tmp_path):
    one, two = (written(crooked(), tmp_path / f"{k}.saf.xlsx").read_bytes() for k in range(2))
    assert one == two


def test_a_file_that_reads_back_different_is_refused(tmp_path, monkeypatch):
    form = FORMATS[".saf.xlsx"]
    other = replace(crooked(), points=crooked().points + 1e-3)

    def elsewhere(part):
        yield from form.encode(replace(part, details=Details(frame=replace(other, actions=ACTIONS))))

    monkeypatch.setitem(FORMATS, ".saf.xlsx", replace(form, encode=elsewhere))
    with pytest.raises(ExportError, match="the nodes of 'crooked' have other coordinates"):
        written(crooked(), tmp_path / "x.saf.xlsx")
    assert list(tmp_path.iterdir()) == []


def test_people_say_saf(tmp_path, capsys):
    assert format_suffix("saf") == format_suffix("saf.xlsx") == ".saf.xlsx"
    assert Files(format_="stl, saf").preset_overrides() == ('export.formats=["stl", "saf.xlsx"]',)
    assert main(["export", "barrel_vault", "--to", "saff"]) != 0
    assert "did you mean saf?" in capsys.readouterr().err


@pytest.mark.slow
def test_export_writes_saf_and_reports_the_accuracy_of_beams(tmp_path, capsys):
    path = tmp_path / "vault.saf.xlsx"
    coarse = ["--set", "surface.edge=0.5"]
    assert main(["export", "barrel_vault", "--to", "saf", "-o", str(path), *coarse]) == 0
    book = read(path)
    assert faults(book) == []
    assert [(row["Name"], row["Load group"]) for row in book["StructuralLoadCase"]] == [
        ("load permanent", "LG permanent"),
        ("load variable", "LG variable"),
    ]
    assert sums(book["StructuralLoadCombination"][0]) == {"load permanent": 1.0, "load variable": 1.0}
    assert "beam model compared with the sheet, load: 1.0" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize("name", ["barrel_vault", "slab"])
def test_presets_are_solved_again_from_the_file(tmp_path, name):
    """Reactions hold what lies on the sheet to .1 %; displacements are within 10 % of the sheet's, whose ribs twist as
    bars: as a thin sheet ribs of .1 x .3 m have eleven times their torsion."""
    design = coarse_design(name)
    said = []
    path = design.write(tmp_path / f"{name}.saf.xlsx", note=said.append)
    found = solved_from(read(path))["load"]
    load = design.cut_loads["load"].force.sum(axis=0)
    reaction = sum(one.reaction[:3] for one in found.values())
    assert reaction == pytest.approx(-load, abs=1e-3 * np.linalg.norm(load))
    (agreed,) = design.frame_agreement()
    largest = max(np.linalg.norm(one.u[:3]) for one in found.values())
    ours = np.linalg.norm(solve_frame(design.frame, shear=False)["load"].u[:, :3], axis=1).max()
    assert largest == pytest.approx(ours, rel=0.01)  # sections are rounded to millimetres
    sheet = np.linalg.norm(solve_frame(design.frame)["load"].u[:, :3], axis=1).max() / agreed.displacement
    assert largest == pytest.approx(sheet, rel=0.1)
    assert agreed.slender == (name != "slab")
    assert ("ribs of the sheet twist like bars" in said[0]) == (name != "barrel_vault")
