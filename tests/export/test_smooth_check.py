"""The program that reads smooth STEP with OCCT: what it finds, what it does not mend, and its copies."""

import json
import re
import time
from pathlib import Path

import numpy as np
import pytest

from dsfab.export.cad.step.worker import pieces, program, reports, triangles, volume
from dsfab.export.cad.step.worker.reports import mesh_in
from dsfab.export.cad.step.worker.shapes import gauss_kronrod_volume
from dsfab.export.subprocesses import last_line
from dsfab.slicing import cut
from dsfab.surface.shapes.roofs import barrel_vault
from tests.smooth import holed, written


@pytest.mark.slow
def test_the_worker_gives_the_same_findings_as_this_process(tmp_path):
    surface = barrel_vault(2.0, 1.6, 0.5, 0.2)
    _, shape, _ = written(surface, holed(surface, [[0.5, 0, 0.5]], 0.25), tmp_path / "a.step")
    here = pieces.solid_findings(str(tmp_path / "a.step"))
    there = json.loads(last_line(program.__file__, "pieces", str(tmp_path / "a.step"), seconds=60))["solids"]
    assert there == here
    assert here[0]["volume"] == pytest.approx(shape.volume, rel=1e-3)
    around = shape.bounding_box()
    assert here[0]["box"] == pytest.approx([*around.min, *around.max], abs=40)


COPIED = """
import runpy, sys, time
Meanwhile = runpy.run_path(sys.argv[1])["ForkedWork"]
asked, dropped = Meanwhile(lambda: 0.1 + 0.2), Meanwhile(lambda: time.sleep(3600))
dropped.stop()
print(asked() == 0.1 + 0.2)
"""


@pytest.mark.skipif(not pieces.CAN_FORK, reason="processes are copied on Linux only")
def test_a_copy_of_the_program_answers_or_is_stopped(tmp_path):
    (tmp_path / "a.py").write_text(COPIED)
    assert last_line(str(tmp_path / "a.py"), pieces.__file__, seconds=60) == "True"


LEFT = """
import os, runpy, sys, time
print(runpy.run_path(sys.argv[1])["ForkedWork"](lambda: time.sleep(600))._copy, flush=True)
time.sleep(0.5)
os._exit(0)
"""


@pytest.mark.skipif(not pieces.CAN_FORK, reason="processes are copied on Linux only")
def test_a_forked_worker_ends_with_its_parent(tmp_path):
    """As when the time is over, or somebody presses Ctrl-C."""
    (tmp_path / "a.py").write_text(LEFT)
    state = Path("/proc", last_line(str(tmp_path / "a.py"), pieces.__file__, seconds=60), "stat")
    waited = 0.0
    while state.exists() and state.read_text().rpartition(")")[2].split()[0] != "Z":
        assert (waited := waited + 0.1) < 60
        time.sleep(0.1)


@pytest.mark.parametrize("many", [5, 1], ids=["skins", "walls too"])
def test_the_volume_by_greens_theorem_is_that_of_occts_own_rule(vault, tmp_path, monkeypatch, many):
    """Also on faces whose curves are lines: those OCCT measures itself."""
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps
    from OCP.STEPControl import STEPControl_Reader

    (tmp_path / "a.step").write_text(vault)
    reader, found = STEPControl_Reader(), GProp_GProps()
    reader.ReadFile(str(tmp_path / "a.step"))
    reader.TransferRoots()
    monkeypatch.setattr(volume, "MANY_EDGES", many)
    BRepGProp.VolumeProperties_s(reader.OneShape(), found, volume.VOLUME, False, False)
    assert volume.volume(reader.OneShape()) == pytest.approx(found.Mass(), rel=1e-9)
    # whose faces are no small ones: off by 8e-5 of it, where files may be off by 5e-3
    assert gauss_kronrod_volume(reader.OneShape(), volume.VOLUME) == pytest.approx(found.Mass(), rel=2e-4)


TURNED = {
    "a face": r"=ADVANCED_FACE\([^;]*,\.T\.\);",
    "a hole": r"=FACE_BOUND\([^;]*,\.T\.\);",
    "an outline": r"=FACE_OUTER_BOUND\([^;]*,\.T\.\);",
    "an edge": r"=ORIENTED_EDGE\([^;]*,\.F\.\);",
}


@pytest.mark.parametrize("what", TURNED)
def test_a_fault_that_other_readers_repair_is_refused(tmp_path, vault, what):
    """One sense in the file turned over: OCCT as build123d uses it repairs that and calls it valid."""
    from build123d import import_step

    found = list(re.finditer(TURNED[what], vault))[-1]
    flag = {".T.": ".F.", ".F.": ".T."}[found[0][-5:-2]]
    (tmp_path / "a.step").write_text(vault[: found.end() - 5] + flag + vault[found.end() - 2 :])
    assert import_step(tmp_path / "a.step").is_valid
    assert [one["valid"] for one in pieces.solid_findings(str(tmp_path / "a.step"))] == [False]


@pytest.fixture(scope="module")
def vault(tmp_path_factory):
    """The text of a small vault with a hole."""
    path = tmp_path_factory.mktemp("check") / "a.step"
    surface = barrel_vault(2.0, 1.6, 0.5, 0.2)
    written(surface, holed(surface, [[0.5, 0, 0.5]], 0.25), path)
    return path.read_text()


@pytest.mark.slow
@pytest.mark.skipif(not pieces.CAN_FORK, reason="processes are copied on Linux only")
def test_two_processes_share_the_solids_and_keep_their_order(tmp_path):
    surface = barrel_vault(2.0, 1.6, 0.5, 0.2)
    strips = cut(surface, [surface.V[:, 0]], [np.array([-0.8, -0.6, -0.1, 0.2, 0.3, 0.7])]).subset()
    written(surface, strips, tmp_path / "a.step")
    file, alone, shared = tmp_path / "a.step", tmp_path / "alone", tmp_path / "shared"
    alone.mkdir()
    shared.mkdir()
    here = pieces.solid_findings(str(file), str(alone), 1.0)
    assert (
        json.loads(last_line(program.__file__, "pieces", str(file), str(shared), "1.0", seconds=60))["solids"] == here
    )
    assert len({one["volume"] for one in here}) == len(here) >= 3
    files = [[path.read_bytes() for path in sorted(folder.iterdir())] for folder in (alone, shared)]
    assert files[0] == files[1]
    assert len(files[0]) == len(here)


@pytest.mark.slow
@pytest.mark.parametrize("solids", [1, 3])
def test_the_inspection_of_a_whole_file_has_the_triangles_of_dsfab_check(tmp_path, solids):
    """Though OCCT may mend there what it reads: the same triangles of the same faces, and of the shape that is kept."""
    surface = barrel_vault(2.0, 1.6, 0.5, 0.2)
    sheet = holed(surface, [[0.5, 0, 0.5]], 0.25)
    if solids > 1:
        sheet = cut(surface, [surface.V[:, 0]], [np.array([-0.8, -0.6, -0.1, 0.2, 0.3, 0.7])]).subset()
    written(surface, sheet, tmp_path / "a.step")
    for name in ("judged", "read", "kept"):
        (tmp_path / name).mkdir()
    found = pieces.whole_findings(str(tmp_path / "a.step"), str(tmp_path / "judged"), 0.5)
    assert [one["valid"] and one["tessellates"] for one in found] == [True] * solids
    triangles.write_triangles(tmp_path / "a.step", tmp_path / "read", 0.5)
    triangles.write_triangles(tmp_path / "judged" / "shape.bin", tmp_path / "kept", 0.5)
    found = {"solids": solids, "deflection": 0.5}
    judged, read, kept = (mesh_in(str(tmp_path / name), found, b"-") for name in ("judged", "read", "kept"))
    assert judged.face.max() > 2
    for other in (read, kept):
        assert all(np.array_equal(getattr(judged, name), getattr(other, name)) for name in ("V", "F", "face"))


@pytest.mark.slow
def test_a_copy_that_asks_while_a_whole_is_drawn_finds_the_same(tmp_path):
    surface = barrel_vault(2.0, 1.6, 0.5, 0.2)
    sheet = cut(surface, [surface.V[:, 0]], [np.array([-0.8, -0.6, -0.1, 0.2, 0.3, 0.7])]).subset()
    written(surface, sheet, tmp_path / "a.step")
    here = pieces.whole_findings(str(tmp_path / "a.step"), str(tmp_path), 0.5)
    mesh, seen = mesh_in(str(tmp_path), {"deflection": 0.5}), []
    with reports.occt() as program:
        apart = reports.findings(program, (tmp_path / "a.step").read_text(), 0.5, 60, seen.append)
    assert len(apart) == mesh.solids == 3
    for name in ("valid", "closed", "tessellates", "faces", "volume", "gap", "box"):
        assert [getattr(one, name) for one in apart] == [one[name] for one in here]
    assert all(one.volume > 0 for one in apart)
    assert len(seen) == 1
    assert all(np.array_equal(getattr(mesh, name), getattr(seen[0], name)) for name in ("V", "F", "face", "solids"))


def test_an_invalid_whole_is_detected_even_if_it_has_triangles(tmp_path, vault):
    found = list(re.finditer(TURNED["a face"], vault))[-1]
    (tmp_path / "a.step").write_text(vault[: found.end() - 5] + ".F." + vault[found.end() - 2 :])
    with reports.occt() as program:
        judged = reports.findings(program, (tmp_path / "a.step").read_text(), 0.5, 60, [].append)
    assert [(one.valid, one.tessellates, one.volume) for one in judged] == [(False, False, 0)]
    assert not pieces.whole_findings(str(tmp_path / "a.step"), str(tmp_path), 0.5)[0]["tessellates"]
    assert not (tmp_path / "mesh.npz").exists()  # not without a copy that draws meanwhile
    assert not pieces.whole_findings(str(tmp_path / "none.step"), str(tmp_path), 0.5)


def test_triangles_of_a_placed_shape_have_its_position():
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
    from OCP.gp import gp_Trsf, gp_Vec
    from OCP.TopLoc import TopLoc_Location

    box, move = BRepPrimAPI_MakeBox(1, 2, 3).Shape(), gp_Trsf()
    move.SetTranslation(gp_Vec(10, 20, 30))
    for shape, at in ((box, np.zeros(3)), (box.Moved(TopLoc_Location(move)), np.array([10.0, 20.0, 30.0]))):
        mesh, found = triangles.triangles_of(shape, 0.1)
        assert found["solids"] == 1
        assert len(mesh["F"]) == 12
        np.testing.assert_allclose([mesh["V"].min(axis=0), mesh["V"].max(axis=0)], [at, at + [1, 2, 3]], atol=1e-9)


def test_triangles_deviate_from_a_shape_by_a_ten_thousandth_of_its_boxs_diagonal():
    """A disc 1 mm thick with a radius of 100 mm: the largest distance is that of chords of its wall."""
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeCylinder

    mesh, _ = triangles.triangles_of(BRepPrimAPI_MakeCylinder(100.0, 1.0).Shape())
    corners = mesh["V"][mesh["F"]]
    wall = corners[np.ptp(corners[..., 2], axis=1) > 0]
    middles = (wall + np.roll(wall, 1, axis=1)) / 2
    sag = 100 - np.linalg.norm(middles[..., :2], axis=2).min()
    assert 0.3e-4 < sag / np.sqrt(200**2 + 200**2 + 1) < 1.1e-4
