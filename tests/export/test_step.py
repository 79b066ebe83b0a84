"""STEP: coplanar triangles become planar faces, pieces become solids, voids stay inside them, and OCCT agrees."""

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dsfab.core.errors import ExportError
from dsfab.export import STEP_FACES, StepOptions, write
from dsfab.export.cad.step import file, strategies
from dsfab.export.cad.step.entities import step_string
from dsfab.export.cad.step.planar import FLATNESS, Polyhedron, polyhedron
from dsfab.export.cad.step.worker import program, reports
from dsfab.export.mesh.soundness import solids_of, winding
from dsfab.export.part import part_of
from dsfab.surface import Surface
from dsfab.surface.topology import edge_table, pieces
from dsfab.thickening import Solid, thicken
from tests.export.planar_solids import plate_with_hole
from tests.export.solids import needle, solid_box, solid_torus
from tests.shapes import grid, sphere


def joined(solid: Solid) -> Polyhedron:
    part = strategies.prepare(part_of(solid, "test", STEP_FACES))
    return polyhedron(part.V, part.F, pieces(part.F, edge_table(part.F))[1])


def loops_of(shape: Polyhedron) -> list[np.ndarray]:
    """The points of each loop, in order."""
    begin = np.where(shape.forward, shape.edges[shape.steps, 0], shape.edges[shape.steps, 1])
    return np.split(begin, shape.loops[1:-1])


def check_laws(shape: Polyhedron, volume: float) -> None:
    """Every edge is used once in each direction; one outer loop per face; volume by Gauss' theorem."""
    uses = np.zeros((len(shape.edges), 2), dtype=int)
    np.add.at(uses, (shape.steps, shape.forward.astype(int)), 1)
    assert (uses == 1).all()
    loops = loops_of(shape)
    assert all(len(set(loop.tolist())) == len(loop) >= 3 for loop in loops)
    total = 0.0
    for face, (first, last) in enumerate(zip(shape.faces[:-1], shape.faces[1:], strict=True)):
        areas = []
        for loop in loops[first:last]:
            p = shape.points[loop]
            assert np.abs((p - shape.points[shape.origin[face]]) @ shape.normals[face]).max() <= 3 * FLATNESS
            areas.append(np.cross(p - p[0], np.roll(p, -1, axis=0) - p[0]).sum(axis=0) @ shape.normals[face] / 2)
        assert areas[0] > 0
        assert all(a < 0 for a in areas[1:])
        total += sum(areas) * (shape.points[shape.origin[face]] @ shape.normals[face]) / 3
    assert total == pytest.approx(volume * 1e9, rel=1e-6)


def bumps(heights: np.ndarray) -> Solid:
    """A plate of 6 x 6 squares whose inner vertices are lifted by the 25 heights; 0.02 m thick along z: 0.0072 m3."""
    plate = grid(6, 6, 0.6, 0.6)
    V = plate.V.copy()
    inner = ((V[:, :2] > 0.05) & (V[:, :2] < 0.55)).all(axis=1)
    V[inner, 2] = heights.ravel()
    return thicken(Surface(V, plate.F), np.tile([0, 0, 0.01], (plate.n, 1)))


def both(one: Solid, two: Solid, pieces: int = 2) -> Solid:
    return Solid(np.r_[one.V, two.V], np.r_[one.F, two.F + len(one.V)], genus=0, pieces=pieces)


def test_a_box_in_a_process_of_its_own_reads_back_in_millimetres(tmp_path):
    from build123d import import_step

    path = write(solid_box(corner=(1.0, -2.0, 0.5)), tmp_path / "box.step", name="o'clock")
    text = path.read_text("ascii")
    assert "SI_UNIT(.MILLI.,.METRE.)" in text
    assert "PRODUCT('o''clock','o''clock'" in text
    assert text.count("ADVANCED_FACE") == 6
    assert text.count("EDGE_CURVE") == 12
    shape = import_step(path)
    assert shape.label == "o'clock"
    assert len(shape.solids()) == 1
    assert shape.is_valid
    assert shape.volume == pytest.approx(3e6, rel=1e-9)
    low, high = shape.bounding_box().min, shape.bounding_box().max
    assert [*low, *high] == pytest.approx([1000, -2000, 500, 1200, -1700, 550], abs=1e-5)


def test_a_flat_plate_with_a_hole_has_ten_faces(tmp_path, inspected):
    solid = plate_with_hole()
    shape = joined(solid)
    assert len(solid.F) > 150
    assert len(shape.normals) == 10
    assert len(shape.edges) == 24
    assert sorted(np.diff(shape.faces).tolist()) == [1] * 8 + [2, 2]
    check_laws(shape, 0.32 * 0.02)
    write(solid, tmp_path / "plate.stp")
    assert inspected["volume"] == pytest.approx(0.32 * 0.02 * 1e9, rel=1e-6)
    assert (inspected["solids"], inspected["faces"], inspected["valid"]) == (1, 10, True)


def test_holes_that_touch_in_a_point_stay_two_loops(tmp_path, inspected):
    heights = np.zeros((5, 5))
    heights[1, 1] = heights[3, 3] = 0.05
    solid = bumps(heights)
    shape = joined(solid)
    check_laws(shape, 0.0072)
    top = int(np.diff(shape.faces).argmax())
    outer, *inner = loops_of(shape)[shape.faces[top] : shape.faces[top + 1]]
    assert len(outer) == 4
    assert len(inner) == 2
    assert len(set(inner[0].tolist()) & set(inner[1].tolist())) == 1
    write(solid, tmp_path / "a.step")
    assert inspected["valid"]


@settings(max_examples=25, deadline=None, derandomize=True)
@given(st.lists(st.sampled_from([0.0, 0.0, 0.05, 0.1]), min_size=25, max_size=25))
def test_joining_keeps_a_polyhedron_closed_with_its_volume(heights):
    solid = bumps(np.array(heights).reshape(5, 5))
    shape = joined(solid)
    check_laws(shape, 0.0072)
    assert len(shape.normals) < len(solid.F) / 1.2
    holes = len(shape.loops) - 1 - len(shape.normals)
    assert len(shape.points) - len(shape.edges) + len(shape.normals) - holes == 2


def test_a_finely_divided_circle_stays_round():
    """Every vertex is within a quarter of FLATNESS of the line between its neighbours, every wall of the next one's
    plane: what is tested locally only would melt away."""
    count, radius = 2400, 0.4e-3
    turn = 2 * np.pi * np.arange(count) / count
    rim = radius * np.c_[np.cos(turn), np.sin(turn)]
    i = np.arange(count)
    j = (i + 1) % count
    top, bottom = np.full(count, 2 * count), np.full(count, 2 * count + 1)
    V = np.r_[np.c_[rim, np.full(count, 1e-3)], np.c_[rim, np.zeros(count)], [[0, 0, 1e-3], [0, 0, 0]]]
    F = np.r_[
        np.c_[top, i, j], np.c_[bottom, j + count, i + count], np.c_[i, i + count, j + count], np.c_[i, j + count, j]
    ]
    solid = Solid(V, F, genus=0, pieces=1)
    assert 1000 * radius * (1 - np.cos(turn[1])) < FLATNESS / 4
    shape = joined(solid)
    assert len(shape.points) == 2 * count
    check_laws(shape, solid.volume)


def test_a_finely_divided_arc_with_corners_keeps_its_vertices():
    """The outline of a quarter disc, 0.4 mm: its arc is straight to FLATNESS locally, not as a whole."""
    turn = np.linspace(0, np.pi / 2, 601)
    V = np.r_[[[0, 0, 0]], 0.4 * np.c_[np.cos(turn), np.sin(turn), 0 * turn]]
    rim = np.r_[0, np.arange(601, 1, -1)]
    above = np.c_[np.zeros(600, dtype=int), np.arange(1, 601), np.arange(2, 602)]
    below = np.c_[np.ones(len(rim) - 1, dtype=int), rim[:-1], rim[1:]]
    F = np.r_[above, below]
    shell = np.zeros(len(F), dtype=np.int64)
    shape = polyhedron(V, F, shell)
    assert len(shape.normals) == 2
    assert shape.points.tolist() == V.tolist()
    V[2:601] = np.linspace(V[1], V[601], 601)[1:-1]
    assert polyhedron(V, F, shell).points.tolist() == V[[0, 1, 601]].tolist()


def test_a_finely_divided_circle_without_corners_keeps_its_vertices():
    turn = 2 * np.pi * np.arange(2400) / 2400
    V = np.r_[[[0, 0, 0]], 0.4 * np.c_[np.cos(turn), np.sin(turn), 0 * turn]]
    rim = np.arange(1, 2401)
    above = np.c_[np.zeros(2400, dtype=int), rim, np.roll(rim, -1)]
    below = np.c_[np.ones(2398, dtype=int), rim[2:], rim[1:-1]]
    F = np.r_[above, below]
    assert polyhedron(V, F, np.zeros(len(F), dtype=np.int64)).points.tolist() == V[rim].tolist()


def test_two_skins_closer_than_flatness_stay_two_faces():
    V = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.3, 0.3, 2e-9]])
    F = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    shape = joined(Solid(V, F, genus=0, pieces=1))
    assert (len(shape.points), len(shape.edges), len(shape.normals)) == (3, 3, 2)
    assert shape.normals[0] @ shape.normals[1] == pytest.approx(-1)


def test_slivers_lie_in_their_neighbours_face():
    """A triangle without height has no plane of its own."""
    V = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0, 0]])
    F = np.array([[0, 2, 1], [0, 4, 3], [4, 1, 3], [0, 3, 2], [1, 2, 3], [0, 1, 4]])
    shape = joined(Solid(V, F, genus=0, pieces=1))
    assert (len(shape.points), len(shape.edges), len(shape.normals)) == (4, 6, 4)
    check_laws(shape, 1 / 6)


def test_two_tubes_are_two_solids(tmp_path, inspected):
    ring = solid_torus(10, 6)
    pair = both(ring, Solid(ring.V + [0, 0, 2], ring.F, 1, 1))
    write(pair, tmp_path / "pair.step")
    assert inspected["solids"] == 2
    assert inspected["faces"] == 2 * (4 * 10 + 2)  # flat trapezoids; the topmost and lowest make rings
    assert inspected["volume"] == pytest.approx(2 * ring.volume * 1e9, rel=1e-6)


def test_a_thickened_sphere_is_one_solid_with_a_void(tmp_path, inspected):
    ball = sphere(2)
    shell = thicken(ball, 0.05 * ball.vertex_normals)
    path = write(shell, tmp_path / "shell.step")
    assert path.read_text("ascii").count("BREP_WITH_VOIDS") == 1
    assert (inspected["solids"], inspected["valid"]) == (1, True)
    assert inspected["volume"] == pytest.approx(shell.volume * 1e9, rel=1e-6)


def test_a_void_is_written_as_a_shell_that_faces_outwards(monkeypatch):
    """ISO 10303-42 reverses it by its orientation .F.; OCCT would forgive the opposite, others may not."""
    given_shapes = []
    monkeypatch.setattr(file, "entities", lambda shape, solids, name: given_shapes.append((shape, solids)) or [])
    ball = sphere(1)
    list(file.encode(strategies.prepare(part_of(thicken(ball, 0.1 * ball.vertex_normals), "a", 1000))))
    shape, [[outer, void]] = given_shapes[0]
    for shell in (outer, void):
        of = shape.shell == shell
        assert of.sum() == 32
        assert (np.einsum("fi,fi->f", shape.normals, shape.points[shape.origin])[of] > 0).all()


def test_a_hollow_ball_in_a_void_is_a_solid_with_its_own_void():
    ball = sphere(1)
    shell = thicken(ball, 0.1 * ball.vertex_normals)
    nested = both(shell, Solid(0.4 * shell.V, shell.F, 0, 1))
    beside = both(nested, Solid(ball.V + [5, 0, 0], ball.F, 0, 1), 3)
    shell_of, solids = solids_of(part_of(beside, "nest", 1))
    size = [np.abs(beside.V[beside.F[shell_of == i]]).max() for i in range(5)]
    assert sorted([round(size[i], 2) for i in solid] for solid in solids) == [[0.44, 0.36], [1.1, 0.9], [6.0]]


def test_the_winding_number_is_one_inside_and_nothing_outside():
    ring = solid_torus()
    assert winding(np.array([1.0, 0, 0]), ring.V, ring.F) == pytest.approx(1, abs=1e-9)
    assert winding(np.zeros(3), ring.V, ring.F) == pytest.approx(0, abs=1e-9)


def test_a_piece_inside_out_is_refused(tmp_path):
    turned = both(solid_box(size=np.ones(3)), Solid(solid_box().V + 3, solid_box().F[:, ::-1], 0, 1))
    with pytest.raises(ExportError, match=r"piece \d of the solid 'a' is inside out"):
        write(turned, tmp_path / "a.step")


def test_the_budget_counts_joined_faces_and_names_the_ways_out(tmp_path, inspected):
    solid = plate_with_hole()
    write(solid, tmp_path / "plate.step", step=StepOptions(faces=10))
    (tmp_path / "plate.step").unlink()
    with pytest.raises(ExportError) as caught:
        write(solid, tmp_path / "plate.step", step=StepOptions(faces=9))
    for words in (
        "planar 10 faces",
        "faceted 10 faces",
        "more than step_faces = 9",
        "STL or 3MF",
        "coarsen the mesh",
        "raise step_faces",
    ):
        assert words in str(caught.value)
    assert not any(tmp_path.iterdir())


def test_vertices_closer_than_the_decimals_are_merged(tmp_path, inspected):
    path = write(needle(1e-10, 0.0), tmp_path / "a.step")
    assert path.read_text("ascii").count("VERTEX_POINT") == 8
    assert inspected["faces"] == 6


def test_an_edge_with_four_triangles_is_refused(tmp_path):
    one, two = solid_box(size=np.ones(3)), solid_box(size=np.ones(3), corner=(1.0, 1.0, 0.0))
    V, of = np.unique(np.r_[one.V, two.V], axis=0, return_inverse=True)
    touching = Solid(V, of.ravel()[np.r_[one.F, two.F + 8]], genus=0, pieces=2)
    with pytest.raises(ExportError, match="'a' has more than two triangles at 1 edge, but"):
        write(touching, tmp_path / "a.step")


@pytest.mark.parametrize(
    ("pattern", "by", "said"),
    [
        (r"SI_UNIT\(\.MILLI\.,", "SI_UNIT($,", "volume 3e+15 mm3 instead of 3e+06 mm3"),
        (r"(CLOSED_SHELL\('',\()#\d+,", r"\1", "0 solids instead of 1"),
        (r"MANIFOLD_SOLID_BREP", "MANIFOLD_SOLID_BRAP", "0 solids instead of 1"),
        (r"\(200\.,0\.,0\.\)", "(-50.,300.,0.)", "OCCT finds the STEP solid of 'box' invalid"),
        (
            r"CARTESIAN_POINT\('',\(200\.,0\.,0\.\)\)",
            "CARTESIAN_POINT('',(240.,0.,0.))",
            "volume 3.4e+06 mm3 instead of 3e+06",
        ),
    ],
    ids=["metres", "open", "no solid", "crossing", "dented"],
)
def test_a_spoilt_file_is_not_kept(tmp_path, monkeypatch, inspected, pattern, by, said):
    entities = file.entities

    def spoilt(*arguments):
        text, count = re.subn(pattern, by, "".join(entities(*arguments)))
        assert count == 1
        yield text

    monkeypatch.setattr(file, "entities", spoilt)
    with pytest.raises(ExportError) as caught:
        write(solid_box(), tmp_path / "box.step", step="faceted")
    assert said in str(caught.value)
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("finding", "said"),
    [
        ({"valid": False}, "OCCT finds the STEP solid of 'box' invalid"),
        ({"solids": 2}, "2 solids instead of 1"),
        ({"faces": 7}, "7 faces instead of 6"),
        ({"tessellates": False}, "cannot divide a face of the STEP solid of 'box'"),
    ],
)
def test_the_findings_of_the_inspection_decide(tmp_path, monkeypatch, finding, said):
    said_of_a_box = {"solids": 1, "faces": 6, "valid": True, "tessellates": True, "volume": 3e6}
    monkeypatch.setattr(file, "inspection", lambda part, path: said_of_a_box)
    write(solid_box(), tmp_path / "box.step").unlink()
    monkeypatch.setattr(file, "inspection", lambda part, path: said_of_a_box | finding)
    with pytest.raises(ExportError, match=said):
        write(solid_box(), tmp_path / "box.step")
    assert not any(tmp_path.iterdir())


def test_an_inspection_over_its_time_limit_fails_and_leaves_no_file(tmp_path, monkeypatch):
    monkeypatch.setattr(file, "CHECK_SECONDS", 0.05)
    monkeypatch.setattr(file, "CHECK_SECONDS_PER_FACE", 0.0)
    with pytest.raises(ExportError, match="'box' did not end within 0 s"):
        write(solid_box(), tmp_path / "box.step")
    assert not any(tmp_path.iterdir())


@pytest.mark.slow
def test_a_check_that_fails_gives_its_reason(tmp_path):
    part = part_of(solid_box(), "box", 10)
    with pytest.raises(ExportError, match=r"OCCT could not read the STEP file of 'box' \(OCCT cannot read the file"):
        file.inspection(part, tmp_path / "missing.step")


def test_the_checker_runs_alone():
    """It is a second opinion: its modules import nothing of dsfab but each other."""
    for path in {*Path(program.__file__).parent.glob("*.py")} - {Path(reports.__file__)}:
        modules = re.findall(r"^\s*(?:from|import) (dsfab[\w.]*)", path.read_text(), re.M)
        assert all(module.startswith("dsfab.export.cad.step.worker") for module in modules), path


def test_names_are_written_as_iso_10303_21_says():
    assert step_string("it's") == "it''s"
    assert step_string("a\\b") == "a\\\\b"
    assert step_string("é") == "\\X4\\000000E9\\X0\\"
