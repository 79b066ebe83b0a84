"""What a STEP file will cost is said before; what is too much is refused or simplified by a measured distance."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from dsfab.app.options import StepFlags
from dsfab.core.errors import ExportError
from dsfab.core.limits import CHANGED_VOLUME
from dsfab.export import STEP_FACES, StepOptions, step_estimates, write
from dsfab.export.cad.step import file, file_size, strategies
from dsfab.export.cad.step.entities import faceted_bytes
from dsfab.export.cad.step.planar import polyhedron
from dsfab.export.mesh.soundness import solids_of
from dsfab.export.part import open_edges, part_of
from dsfab.thickening import offsets, thicken
from tests.app.command_line import run
from tests.export.curved_solids import saddle_solid
from tests.export.planar_solids import plate_with_hole
from tests.export.solids import solid_box, solid_torus
from tests.shapes import ZOO


def prepared(solid, faces=STEP_FACES):
    return strategies.prepare(part_of(solid, "part", faces))


def finely(solid):
    """Every triangle in four: flat neighbours that can go again."""
    V, F = trimesh.remesh.subdivide(solid.V, solid.F)
    return type(solid)(V, F, solid.genus, solid.pieces)


def from_torus(points):
    """Largest distance (mm) of points from the surface of which `torus` is a mesh."""
    x, y, z = points.T
    return np.abs(np.hypot(np.hypot(x, y) - 1000, z) - 300).max()


@pytest.mark.parametrize("name", ["saddle", "dome", "obtuse", "moebius"])
def test_the_size_of_a_faceted_file_is_known_to_a_tenth(name):
    surface = ZOO[name]()
    part = prepared(thicken(surface, offsets(surface, 0.02).D))
    shape = polyhedron(part.V, part.F, solids_of(part)[0])
    assert faceted_bytes(shape) == pytest.approx(sum(map(len, file.encode(part))), rel=0.1)


def test_estimates_equal_the_face_counts_of_the_files(tmp_path, inspected):
    solid = plate_with_hole()
    found = {one.way: one for one in step_estimates(solid)}
    assert [way for way, one in found.items() if one.chosen] == ["planar"]
    for way in ("planar", "faceted"):
        text = write(solid, tmp_path / f"{way}.step", step=way).read_bytes()
        assert found[way].faces == text.count(b"=ADVANCED_FACE(")
        assert found[way].size == pytest.approx(len(text), rel=0.15 if way == "planar" else 0.4)
        assert found[way].write_seconds > strategies.LOADING_SECONDS
        assert found[way].memory > 0 < found[way].open_seconds
    assert {one.way for one in step_estimates(solid, step="faceted") if one.chosen} == {"faceted"}


def test_the_time_estimate_of_members_by_name_is_eight_trial_cuts():
    """`barrel_vault`, 912 faces: 53 s of the processor by name, 12 unasked; `dome`, 5051 faces: 24 unasked."""
    part = part_of(solid_torus(), "a", STEP_FACES)
    unasked = replace(part, hurry=1)
    assert 26 < file_size.writing_seconds(part, "members", 912) < 106
    assert 6 < file_size.writing_seconds(unasked, "members", 912) < 24
    assert 12 < file_size.writing_seconds(unasked, "members", 5051) < 48


def test_estimates_name_impossible_ways_and_ways_over_the_budget():
    found = {one.way: one for one in step_estimates(solid_torus(), step=StepOptions(faces=500))}
    assert "not flat" in found["planar"].refused
    assert found["faceted"].chosen
    assert found["faceted"].faces == 288  # of its quads
    few = {one.way: one for one in step_estimates(solid_torus(), step=StepOptions(faces=200))}
    assert few["faceted"].refused == "288 planar faces, more than step_faces = 200"
    small = {one.way: one for one in step_estimates(solid_torus(), step=StepOptions(megabytes=0.1))}
    assert "more than step_mb = 0.1" in small["faceted"].refused
    assert not any(one.chosen for one in small.values())


def test_simplified_solids_are_closed_and_keep_the_stated_distance():
    part = prepared(finely(solid_torus(48, 24)))
    simple = file_size.simplified_part(part, 5.0)
    assert len(simple.F) < 0.3 * len(part.F)
    assert open_edges(simple.F) == 0
    assert simple.volume == pytest.approx(part.volume, rel=CHANGED_VOLUME)
    said = float(simple.note.split(" mm off")[0].split()[-1])
    assert said <= 5.0
    found = [from_torus(m.V[m.F].mean(axis=1)) for m in (part, simple)]
    assert found[0] < found[1] <= 1.05 * said + found[0]
    assert f"to {len(simple.F):,} triangles" in simple.note


def test_distances_between_surfaces_are_measured_both_ways():
    one, two = solid_box(size=np.ones(3)), solid_box(size=np.array([1.0, 1.0, 1.2]))
    assert file_size.distance(one.V, one.F, two.V, two.F) == pytest.approx(0.2)
    both = np.r_[one.V, one.V + 5]
    assert file_size.distance(one.V, one.F, both, np.r_[one.F, one.F + 8]) == pytest.approx(np.sqrt(75))
    assert file_size.distance(both, np.r_[one.F, one.F + 8], one.V, one.F) == pytest.approx(np.sqrt(75))


def test_a_tolerance_simplifies_faceted_files_and_the_note_gives_the_distance(tmp_path, inspected):
    said, solid = [], saddle_solid()
    path = write(solid, tmp_path / "a.step", step=StepOptions("faceted", tolerance=0.01), note=said.append)
    assert path.read_bytes().count(b"=ADVANCED_FACE(") < 0.7 * len(solid.F)
    assert said[0].startswith(f"STEP is faceted, simplified from {len(solid.F):,} to")
    assert "mm off at most" in said[0]


def test_auto_simplifies_solids_over_the_budget(tmp_path, inspected):
    said, solid = [], saddle_solid()
    write(solid, tmp_path / "a.step", step=StepOptions(faces=1000), note=said.append)
    assert f"simplified from {len(solid.F):,} to" in said[0]
    assert said[0].endswith(f"written as faceted would have {len(solid.F):,} planar faces, more than step_faces = 1000")


def test_a_tolerance_without_effect_gives_a_note(tmp_path, inspected):
    said = []
    write(solid_box(), tmp_path / "a.step", step=StepOptions("faceted", tolerance=1e-6), note=said.append)
    assert "not simplified, since 'a' does not become simpler within 0.001 mm" in said[0]


def test_files_above_the_budget_in_megabytes_are_refused_with_the_ways_out(tmp_path):
    with pytest.raises(ExportError) as caught:
        write(solid_torus(), tmp_path / "a.step", step=StepOptions("faceted", megabytes=0.1))
    for words in (
        "0.24 MB, more than step_mb = 0.1 MB",
        "STL or 3MF",
        "coarsen the mesh",
        "step_tolerance",
        "raise step_mb",
    ):
        assert words in str(caught.value)
    assert not any(tmp_path.iterdir())


@pytest.mark.slow
def test_the_command_line_estimates_and_writes_nothing(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    options = ["--set", "surface.edge=0.2", "--estimate", "--max-faces", "100", "--max-mb", "9", "--quiet"]
    code, said, _ = run(capsys, "export", "cantilever", *options, "--set", "pattern.major.frequency=3")
    assert code == 0
    assert "more than step_faces = 100" in said
    assert not any(tmp_path.iterdir())
    flags = StepFlags("faceted", 5, 0.5)
    assert flags.overrides() == ('export.step="faceted"', "export.step_faces=5", "export.step_mb=0.5")


@pytest.mark.parametrize(("change", "is_simpler"), [(-0.004, True), (-0.006, False)])
def test_a_simplified_solid_keeps_its_volume_to_half_a_hundredth(change, is_simpler, monkeypatch):
    box = part_of(solid_box(size=np.full(3, 0.1)), "box")
    fine = prepared(finely(solid_box(size=np.full(3, 0.1))))
    monkeypatch.setattr(file_size, "coarsen_mesh", lambda V, F, step: (box.V * (1 + change) ** (1 / 3), box.F))
    if is_simpler:
        assert len(file_size.simplified_part(fine, 5.0).F) == 12
        return
    with pytest.raises(ExportError, match="does not become simpler"):
        file_size.simplified_part(fine, 5.0)
