"""`dsfab check`: known-bad files each get their sentence, good ones their numbers."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from dsfab.app.cli import main
from dsfab.core.errors import ExportError, SurfaceError
from dsfab.design import run
from dsfab.export import write
from dsfab.export.cad.step.soundness import step_fault
from dsfab.preset.file import load_preset
from dsfab.study import file_check
from dsfab.study.file_check import Clearance, Clearances, FileContents, check_file, read_shipped, soundness
from dsfab.study.file_check.file_geometry import clearances, distance
from dsfab.surface.mesh import Surface
from dsfab.thickening.solid import Solid
from tests.shipped import PLATE, box_mesh, joined_meshes, preset, stl, verdicts


def kinds(checked):
    return {fault.kind: fault.count for fault in checked.soundness.faults}


def test_the_check_of_a_box_gives_its_exact_measures(tmp_path):
    checked = check_file(stl(tmp_path / "a.stl", *PLATE), density=7850.0)
    assert checked.has_passed
    assert checked.soundness.watertight
    assert checked.soundness.pieces == 1
    assert checked.soundness.volume == pytest.approx(0.4 * 0.2 * 0.01, rel=1e-6)
    assert checked.mass == pytest.approx(7850 * 8e-4, rel=1e-6)
    assert checked.clearances.wall.size == pytest.approx(0.01, rel=1e-6)
    assert checked.clearances.gap is None
    assert verdicts(checked) == {"solid": "pass", "unit": "pass"}


def test_walls_and_gaps_of_two_boxes_are_located_exactly():
    two = joined_meshes(box_mesh((0, 0, 0), (1, 1, 0.02)), box_mesh((0, 0, 0.023), (1, 1, 0.03)))
    found = clearances(*two)
    assert found.wall.size == pytest.approx(0.007)
    assert found.wall.place[2] == pytest.approx(0.023) or found.wall.place[2] == pytest.approx(0.03)
    assert found.gap.size == pytest.approx(0.003)
    assert 0.02 - 1e-9 <= found.gap.place[2] <= 0.023 + 1e-9
    assert soundness(*two).pieces == 2


def test_a_hollow_box_is_one_piece_and_its_void_a_gap():
    V, F = box_mesh((0.1, 0.1, 0.1), (0.9, 0.9, 0.9))
    hollow = joined_meshes(box_mesh((0, 0, 0), (1, 1, 1)), (V, F[:, ::-1]))
    found = soundness(*hollow)
    assert found.sound
    assert (found.pieces, found.shells) == (1, 2)
    assert found.volume == pytest.approx(1 - 0.512)
    assert clearances(*hollow).gap.size == pytest.approx(0.8)
    assert clearances(*hollow).wall.size == pytest.approx(0.1)


def test_a_hole_is_reported_with_its_place(tmp_path, capsys):
    V, F = PLATE
    top = (V[F][:, :, 2] == 0.01).all(axis=1)
    path = stl(tmp_path / "hole.stl", V, F[~top | (np.cumsum(top) > 1)])
    checked = check_file(path)
    assert kinds(checked) == {"open": 3}
    assert not checked.soundness.watertight
    assert checked.mass is None
    assert main(["check", str(path), "-q"]) == 1
    assert main(["check", str(path)]) == 1
    text = capsys.readouterr().out
    assert "3 edges have only one triangle: the surface of the solid has a hole, first at (" in text
    assert "is it a solid      fail" in text


def test_one_flipped_face_and_an_inside_out_solid_are_reported(tmp_path):
    V, F = PLATE
    one = F.copy()
    one[3] = one[3, ::-1]
    assert kinds(check_file(stl(tmp_path / "one.stl", V, one))) == {"turned": 3}
    assert kinds(check_file(stl(tmp_path / "all.stl", V, F[:, ::-1]))) == {"inside_out": 1}


def test_crossing_and_touching_boxes_are_reported(tmp_path):
    crossing = joined_meshes(box_mesh((0, 0, 0), (1, 1, 1)), box_mesh((0.5, 0.4, 0.3), (1.5, 0.6, 0.7)))
    checked = check_file(stl(tmp_path / "cross.stl", *crossing))
    assert set(kinds(checked)) == {"crossing"}
    assert checked.soundness.watertight
    along = joined_meshes(box_mesh((0, 0, 0), (1, 1, 1)), box_mesh((1, 1, 0), (2, 2, 1)))
    assert kinds(check_file(stl(tmp_path / "touch.stl", *along)))["crowded"] >= 1


def test_a_file_in_metres_gives_a_warning(tmp_path, capsys):
    path = stl(tmp_path / "metres.stl", *PLATE, metres=1.0)
    assert verdicts(check_file(path))["unit"] == "fail"
    assert check_file(path, unit="m").has_passed
    assert main(["check", str(path)]) == 1
    assert (
        "solid are in mm, the thinnest wall of the solid is 0.01 mm, so the unit is probably metres"
        in capsys.readouterr().out
    )


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("none.stl", None, "does not exist"),
        ("none.step", None, "does not exist"),
        ("void.stl", b"", "is empty"),
        ("void.step", b"", "is empty"),
        ("shape.dwg", b"x", "has the suffix '.dwg'"),
        ("text.3mf", b"no zip at all", "cannot be read as 3MF"),
        ("text.step", b"no step at all", "export the file again"),
        (
            "half.step",
            b"ISO-10303-21;\nHEADER;",
            "cannot be read as STEP (OCCT cannot read the file); export the file again",
        ),
        ("text.stl", b"solid nothing\nendsolid", "no faces"),
    ],
)
def test_an_unreadable_file_is_refused_in_one_sentence(tmp_path, capsys, name, content, words):
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises((ExportError, SurfaceError)):
        read_shipped(path)
    assert main(["check", str(path), "-q"]) == 1
    said = capsys.readouterr()
    assert words in said.err
    assert said.err.count("\n") == 1
    assert not said.out


def test_a_folder_is_refused_with_the_name_of_a_file_in_it(tmp_path, capsys):
    assert main(["check", str(tmp_path), "-q"]) == 1
    assert "is a folder; the folder has no file to check (.stl, .3mf" in capsys.readouterr().err
    stl(tmp_path / "roof.stl", *PLATE)
    (tmp_path / "a.txt").touch()
    assert main(["check", str(tmp_path), "-q"]) == 1
    assert f"is a folder; give {tmp_path / 'roof.stl'}" in capsys.readouterr().err


def test_a_file_that_names_its_unit_takes_no_other(tmp_path):
    V, F = PLATE
    path = write(Solid(V, F, 0, 1), tmp_path / "plate.3mf")
    assert read_shipped(path).declared
    with pytest.raises(ExportError, match="already states a unit"):
        read_shipped(path, "m")


@pytest.mark.parametrize("suffix", ["stl", "3mf", pytest.param("step", marks=pytest.mark.slow)])
def test_every_format_reads_back_as_the_same_solid(tmp_path, suffix):
    V, F = PLATE
    found = read_shipped(write(Solid(V, F, 0, 1), tmp_path / f"plate.{suffix}"))
    assert found.reader == {"stl": "trimesh", "3mf": "lib3mf", "step": "OCCT"}[suffix]
    judged = soundness(found.V, found.F)
    assert judged.sound
    assert judged.volume == pytest.approx(8e-4, rel=1e-6)
    assert judged.box == pytest.approx(np.array([[0, 0, 0], [0.4, 0.2, 0.01]]), abs=1e-8)


@pytest.fixture(scope="module")
def design():
    return run(preset())


def test_the_file_of_a_design_is_the_design(design, tmp_path):
    checked = check_file(write(design.solid, tmp_path / "strip.stl"), design, solid=False)
    assert verdicts(checked) == {"solid": "pass", "unit": "pass", "design": "pass", "compliance": "unknown"}
    assert checked.distance.largest < 1e-7
    assert checked.distance.skin < 1e-7
    assert checked.mass == pytest.approx(design.mass, rel=1e-6)


def test_a_shifted_a_thicker_and_a_partial_file_are_not_the_design(design, tmp_path):
    V, F = design.solid.V, design.solid.F
    moved = check_file(stl(tmp_path / "moved.stl", V + (0, 0, 0.002), F), design, solid=False)
    assert moved.distance.skin == pytest.approx(0.002, rel=1e-3)
    assert moved.distance.from_design == pytest.approx(0.002, rel=1e-3)
    thick = check_file(stl(tmp_path / "thick.stl", V * (1, 1, 1.5), F), design, solid=False)
    assert thick.distance.skin_mean == pytest.approx(0.0025, rel=1e-3)
    part = check_file(
        stl(tmp_path / "part.stl", *box_mesh(V.min(axis=0), (0, *V.max(axis=0)[1:]))), design, solid=False
    )
    assert part.distance.from_design == pytest.approx(V[:, 0].max(), rel=1e-3)
    assert {verdicts(x)["design"] for x in (moved, thick, part)} == {"fail"}


def test_with_a_design_a_wrong_unit_is_named(design, tmp_path, capsys):
    path = stl(tmp_path / "strip.stl", design.solid.V, design.solid.F, metres=0.0254)
    checked = check_file(path, design)
    assert checked.distance.meant_unit == "in"
    assert verdicts(checked)["unit"] == "fail"
    assert "solid" in next(f.reason for f in checked.findings if f.name == "compliance")


def test_the_preset_beside_the_file_is_found_and_the_file_read_once(design, tmp_path, capsys, monkeypatch):
    from dsfab.preset.file import preset_toml
    from dsfab.study.file_check import file_geometry

    times, read = [], file_geometry.raw_mesh
    monkeypatch.setattr(file_geometry, "raw_mesh", lambda *given: times.append(given) or read(*given))
    path = write(design.solid, tmp_path / "strip.3mf")
    (tmp_path / "preset.toml").write_text(preset_toml(preset()))
    assert main(["check", str(path), "--no-solid", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert len(times) == 1
    assert found["passed"]
    assert found["preset"] == str(tmp_path / "preset.toml")
    assert found["findings"]["compliance"] == {"verdict": "unknown", "reason": "not asked for; not run"}
    assert found["distance"]["file_to_design_m"] < 1e-7
    assert found["volume_m3"] == pytest.approx(design.solid.volume, rel=1e-6)
    assert main(["check", str(path), "--no-solid", "--set", "statics.thickness=0.012"]) == 1
    assert (
        "is it the design              fail     the file's solid is up to 1 mm from the design's surface; the limit "
        "is 0.6 mm" in capsys.readouterr().out
    )


def test_without_the_check_extra_the_error_names_the_package_to_install(design, tmp_path, monkeypatch):
    import importlib.util

    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    checked = check_file(write(design.solid, tmp_path / "strip.stl"), design)
    assert checked.has_passed
    reason = next(f.reason for f in checked.findings if f.name == "compliance")
    assert reason == 'gmsh and skfem not installed; install with: pip install "dsfab[solid]"'


def test_limits_of_fabrication_are_measured_on_the_file(tmp_path):
    strict = run(preset(fabrication={"min_wall": 0.012, "min_gap": 0.0001}))
    checked = check_file(write(strict.solid, tmp_path / "strip.stl"), strict, solid=False)
    assert verdicts(checked)["wall"] == "fail"
    assert verdicts(checked)["gap"] == "pass"  # as its build says, finer than its triangles or not
    assert not checked.has_passed


def test_the_gap_of_a_file_that_is_the_design_is_the_one_that_was_built(tmp_path, monkeypatch):
    """Rays find a tenth of a millimetre in a wedge; the sheet's gap counts, but in a file that is not the design."""
    strict = run(preset(fabrication={"min_gap": 0.001}))
    found = Clearances(None, Clearance(0.0001, np.zeros(3)))
    monkeypatch.setattr(file_check, "clearances", lambda V, F: found)
    checked = check_file(write(strict.solid, tmp_path / "strip.stl"), strict, solid=False)
    assert verdicts(checked)["gap"] != "fail"
    moved = stl(tmp_path / "moved.stl", strict.solid.V + (0, 0, 0.002), strict.solid.F)
    assert verdicts(check_file(moved, strict, solid=False))["gap"] == "fail"


def test_planar_faces_may_be_simplified_and_curved_ones_are_off_by_chords(design):
    """As a build has it: t/20, twice that where nothing but planes is left, and what triangles are off the faces."""
    t = design.preset.statics.thickness
    for reader, deflection, most in (("trimesh", 0, 1 / 20), ("OCCT", 0, 1 / 10), ("OCCT", t / 100, 6 / 100)):
        for off, within in ((0.99 * most * t, True), (1.01 * most * t, False)):
            V = design.solid.V + (0, 0, off)
            found = FileContents(Path("a"), V, design.solid.F, "mm", True, 1e-3, 0, reader, deflection)
            apart = distance(found, design)
            assert (apart.beyond <= 0) == within
            assert apart.allowed == pytest.approx(most * t)


@pytest.mark.slow
def test_check_accepts_a_smooth_file_of_a_coarse_mesh_as_build_does(tmp_path, monkeypatch):
    """It is farther off the mesh than a twentieth of the thickness: the mesh cuts the vault's curve short. That OCCT
    does not cut it is told, and no fault of the solid."""
    monkeypatch.setattr(file_check, "cut_fault", lambda path, faces: (f"{faces} faces", []))
    vault = run(load_preset("barrel_vault", {"surface.edge": 0.5, "export.step": "smooth"}))
    path = vault.write(tmp_path / "vault.step")
    checked, count = check_file(path, vault, solid=False), path.read_text().count("=ADVANCED_FACE(")
    assert checked.has_passed
    assert verdicts(checked)["cut"] == "unknown"
    assert next(f.reason for f in checked.findings if f.name == "cut").startswith(
        f"{count} faces: for a solid that CAD programs can cut"
    )
    t = vault.preset.statics.thickness
    assert t / 20 < checked.distance.largest < checked.distance.allowed < t / 4


@pytest.mark.slow
@pytest.mark.parametrize(("gap", "sound"), [(0.1, True), (-0.1, False)])
def test_crossing_chords_of_a_step_file_are_refined_before_a_fault_is_reported(tmp_path, gap, sound):
    """A pin in a tube of .4 m, narrower or wider by .1 mm, and turned: chords of the tube reach into the pin."""
    from build123d import Axis, Compound, Cylinder, export_step

    tube = Cylinder(300, 40) - Cylinder(200 + gap, 40)
    pin = Cylinder(200, 30).rotate(Axis.Z, 2.5)
    export_step(Compound([tube, pin]), tmp_path / "pin.step")
    found = read_shipped(tmp_path / "pin.step", deflection=1e-3)
    assert not soundness(found.V, found.F).sound
    assert file_check.file_soundness(found, lambda *_: None).sound == sound
    fault = step_fault(tmp_path / "pin.step", 1e-3)
    assert bool(re.match(r"\d+ pairs of triangles cross when OCCT divides the solid into", fault)) == (not sound)
    assert bool(fault) == (not sound)


def test_surfaces_that_touch_in_a_point_are_sound_with_a_note():
    V, F = box_mesh((0, 0, 0), (1, 1, 1))
    W, G = box_mesh((1, 1, 1), (2, 2, 2))
    both = Surface(V, F), Surface(W, G)
    assert all(surface.is_closed for surface in both)
    V, F = joined_meshes((V, F), (W, G))
    points, of = np.unique(V, axis=0, return_inverse=True)
    found = soundness(points, of.reshape(-1)[F])
    assert found.pinches == 1


def test_a_file_with_more_triangles_than_allowed_is_refused_until_more_are(tmp_path, capsys):
    path = stl(tmp_path / "a.stl", *PLATE)
    with pytest.raises(SurfaceError, match=r"12 triangles, but 11 is the limit; .*--max-triangles"):
        read_shipped(path, max_triangles=11)
    assert main(["check", str(path), "--max-triangles", "11"]) == 1
    assert "11 is the limit" in capsys.readouterr().err
    assert main(["check", str(path), "--max-triangles", "12"]) == 0
