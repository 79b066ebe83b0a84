"""Meshes of other libraries as surfaces, and surfaces, sheets and solids as theirs."""

from types import SimpleNamespace

import compas
import numpy as np
import pytest
import pyvista
import trimesh
from compas.geometry import Polygon

import dsfab
from dsfab.core.errors import SolidError, StaticsError, SurfaceError
from dsfab.design import draft
from dsfab.surface import Surface
from dsfab.surface.topology import euler_characteristic, pieces
from dsfab.thickening import Solid
from dsfab.workshop import FlatPart
from dsfab.workshop.parts import Fold, Hole
from tests.presets import DOME_MODES

V = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0.5], [1, 2, 0]], dtype=float)
QUAD, TRIANGLE = [0, 1, 2, 3], [3, 2, 4]
TRIANGLES = np.array([[0, 1, 2], [0, 2, 3], [3, 2, 4]])


@pytest.fixture(scope="module")
def design() -> dsfab.Design:
    return dsfab.run(dsfab.load_preset(DOME_MODES, {"surface.edge": 1.2, "pattern.keep": 0.6}))


def faces(surface: Surface) -> set[frozenset[int]]:
    return {frozenset(face) for face in surface.F.tolist()}


MESHES = {
    "trimesh": lambda: trimesh.Trimesh(V, TRIANGLES, process=False),
    "pyvista": lambda: pyvista.PolyData.from_regular_faces(V, TRIANGLES),
    "pyvista, a grid": lambda: pyvista.PolyData.from_regular_faces(V, TRIANGLES).cast_to_unstructured_grid(),
    "pyvista, polygons": lambda: pyvista.PolyData.from_irregular_faces(V, [QUAD, TRIANGLE]),
    "meshio": lambda: SimpleNamespace(points=V, cells_dict={"triangle": [TRIANGLE], "quad": [QUAD]}),
    "compas": lambda: SimpleNamespace(to_vertices_and_faces=lambda: (V.tolist(), [QUAD, TRIANGLE])),
    "vertices and faces": lambda: SimpleNamespace(vertices=V, faces=TRIANGLES),
}


@pytest.mark.parametrize("kind", MESHES)
def test_the_same_surface_comes_from_every_library(kind: str) -> None:
    surface = Surface.of(MESHES[kind]())
    assert np.array_equal(surface.V, V)
    assert surface.m == 3
    assert surface.area == pytest.approx(Surface.from_mesh(V, [QUAD, TRIANGLE]).area, rel=0.05)


def test_the_unit_comes_from_the_argument_or_from_the_mesh() -> None:
    mesh = trimesh.Trimesh(1000 * V, TRIANGLES, process=False)
    assert np.allclose(Surface.of(mesh, "mm").V, V)
    mesh.units = "mm"
    assert np.allclose(Surface.of(mesh).V, V)
    assert np.allclose(Surface.from_mesh(100 * V, TRIANGLES, "cm").V, V)
    with pytest.raises(SurfaceError, match="use one of mm, cm"):
        Surface.of(mesh, "inch-ish")


@pytest.mark.parametrize(("height", "subdivisions"), [(0.0, 3), (0.1, 2), (0.1, 3), (0.45, 3)])
def test_vertices_at_the_same_place_are_one_in_meshes_of_libraries(height: float, subdivisions: int) -> None:
    """A ball that trimesh cuts is parted along the cut; some of its vertices differ in the last digit."""
    ball = trimesh.creation.icosphere(subdivisions, 5.0)
    cap = ball.slice_plane([0, 0, 5 * height], [0, 0, 1])
    for mesh in (cap, pyvista.PolyData.from_regular_faces(cap.vertices, cap.faces)):
        surface = Surface.of(mesh)
        assert pieces(surface.F, surface.edges)[0] == 1
        assert euler_characteristic(surface.F, surface.edges) == 1  # a disc: no slit is left
        assert surface.area == pytest.approx(cap.area, rel=1e-12)
    kept = Surface.from_mesh(cap.vertices, cap.faces)
    assert np.array_equal(kept.V, cap.vertices)
    assert pieces(kept.F, kept.edges)[0] > 20


def test_merged_vertices_keep_their_order_and_polygons_their_corners() -> None:
    W = np.vstack([V, V[[3, 2]] + 1e-12, V[3]])
    surface = Surface.of(SimpleNamespace(vertices=W, faces=[QUAD, [5, 6, 4]]))
    assert np.array_equal(surface.V, V)
    assert faces(surface) == faces(Surface.from_mesh(V, [QUAD, TRIANGLE]))
    near = Surface.of(SimpleNamespace(vertices=np.vstack([V, V[[3, 2]] + 1e-6]), faces=[QUAD, [5, 6, 4]]))
    assert near.n == 7
    with pytest.raises(SurfaceError, match="not finite"):
        Surface.of(SimpleNamespace(vertices=W * np.nan, faces=TRIANGLES))


def test_duplicate_vertices_that_part_pieces_give_a_hint() -> None:
    cap = trimesh.creation.icosphere(3, 5.0).slice_plane([0, 0, 0.5], [0, 0, 1])
    given = {"loads": [dsfab.SelfWeight()], "statics": {"thickness": 0.05}}
    free = "piece 2 of 49 can turn .*: .* pick more vertices .*"
    for end, says in (("max", "48 of 49 pieces .* remove each piece"), ("min", free)):
        held = dsfab.Support(dsfab.Side("z", end, 0.001))
        with pytest.raises(StaticsError, match=f"{says}, or merge the 94 vertices that coincide with other vertices$"):
            dsfab.run(dsfab.Preset(surface=(cap.vertices, cap.faces), supports=[held], **given))
    whole = draft(dsfab.Preset(surface=cap, supports=[dsfab.Support(dsfab.Side("z", "min", 0.001))], **given))
    assert not [note for note in whole.notes if "pieces" in note.text]
    apart = np.vstack([V, V + 9.0]), np.vstack([TRIANGLES, TRIANGLES + len(V)])
    with pytest.raises(StaticsError, match=r"support or remove each piece$"):
        dsfab.run(dsfab.Preset(surface=apart, supports=[dsfab.Support(dsfab.Side("x", "min", 0.1))], **given))


def test_faces_are_turned_the_same_way_and_a_surface_is_itself() -> None:
    turned = TRIANGLES.copy()
    turned[1] = turned[1][::-1]
    surface = Surface.from_mesh(V, turned)
    assert faces(surface) == faces(Surface(V, TRIANGLES))
    assert (surface.normals @ surface.normals[0] > 0.5).all()
    assert Surface.of(surface) is surface


@pytest.mark.parametrize(
    ("mesh", "says"),
    [
        ({"vertices": V, "faces": [[0, 1, 9]]}, "from 0 to 4"),
        ({"vertices": V, "faces": [[0, 1]]}, "three or more vertex numbers"),
        ({"vertices": V, "faces": []}, "has no faces"),
        ({"vertices": [["a", "b", "c"]], "faces": [[0, 0, 0]]}, "the mesh needs"),
        ({"vertices": V * np.nan, "faces": TRIANGLES}, "not finite"),
        ({"vertices": V, "faces": [[0, 1, 2], [0, 1, 3], [0, 1, 4]]}, "edge"),
        ({}, "is not a mesh"),
    ],
)
def test_an_object_that_is_no_surface_is_refused_in_one_sentence(mesh: dict, says: str) -> None:
    with pytest.raises(SurfaceError, match=says):
        Surface.of(SimpleNamespace(**mesh))


def test_a_surface_survives_the_round_trip_to_trimesh_and_pyvista(design: dsfab.Design) -> None:
    for ours in (design.surface, design.sheet.surface):
        for theirs in (ours.to_trimesh(), ours.to_pyvista()):
            back = Surface.of(theirs)
            assert np.array_equal(back.V, ours.V)
            assert np.array_equal(back.F, ours.F)
    assert design.sheet.to_trimesh().area == pytest.approx(design.sheet.surface.area)
    cells = design.sheet.to_pyvista()
    assert np.array_equal(cells.cell_data["family"], design.sheet.family)


def test_a_solid_has_its_volume_everywhere(design: dsfab.Design) -> None:
    solid = design.solid
    assert solid.to_trimesh().is_watertight
    assert solid.to_trimesh().volume == pytest.approx(solid.volume)
    assert solid.to_pyvista().volume == pytest.approx(solid.volume)
    body = solid.to_manifold()
    assert body.volume() == pytest.approx(solid.volume)
    assert body.genus() == solid.genus
    assert (body - body.translate((100, 0, 0))).volume() == pytest.approx(solid.volume)


@pytest.mark.slow
def test_a_design_is_a_shape_for_cad() -> None:
    few = {"surface.edge": 2, "pattern.keep": 0.6, "pattern.major.frequency": 1, "pattern.minor.frequency": 1}
    design = dsfab.run(dsfab.load_preset(DOME_MODES, few))  # each triangle becomes a face of OCCT
    shape = design.to_build123d()
    assert shape.is_valid
    assert shape.volume == pytest.approx(design.solid.volume * 1e9, rel=5e-3)


@pytest.mark.slow
def test_a_solid_is_a_shape_for_cad() -> None:
    box = trimesh.creation.box((1.0, 2.0, 3.0))
    shape = Solid(box.vertices, box.faces, 0, 1).to_build123d()
    assert shape.volume == pytest.approx(6e9)
    assert len(shape.faces()) == 6


def test_manifold_refuses_an_open_mesh() -> None:
    with pytest.raises(SolidError, match="rejects the solid"):
        Solid(V, TRIANGLES, 0, 1).to_manifold()


def test_a_mesh_survives_the_round_trip_through_compas(design: dsfab.Design) -> None:
    for part in (design.surface, design.sheet, design.solid):
        again = compas.json_loads(compas.json_dumps(part.to_compas()))
        vertices, triangles = again.to_vertices_and_faces()
        assert np.allclose(vertices, part.surface.V if part is design.sheet else part.V, atol=0)
        assert len(triangles) == (part.surface.m if part is design.sheet else len(part.F))
    assert Surface.of(design.surface.to_compas()).area == pytest.approx(design.surface.area, rel=1e-12)


def test_members_are_a_graph_of_compas_whose_edges_are_bays(design: dsfab.Design) -> None:
    members = design.members
    graph = compas.json_loads(compas.json_dumps(members.to_compas()))
    assert set(graph.nodes()) == {node.id for node in members.nodes}
    node = members.nodes[0]
    assert np.allclose(graph.node_coordinates(node.id), node.point, atol=0)
    told = {name: members.bays(name) for name in members.by_id}
    for edge in graph.edges():
        name, length = graph.edge_attributes(edge, ["member", "length"])
        assert np.abs(told[name] - length).min() == 0
        ends = [graph.node_coordinates(end) for end in edge]
        assert np.linalg.norm(np.subtract(*ends)) <= length * 1.05  # a chord is no longer than its arc
    closest = sum(len(bays) for bays in told.values())
    assert 0.9 * closest <= graph.number_of_edges() <= closest


def test_flat_parts_become_compas_curves_around_the_material() -> None:
    outline = np.array([[0, 0], [1, 0], [1.2, 0.2], [0, 0.2]])
    part = FlatPart(
        "A01",
        "A01",
        (0, 1),
        outline,
        holes=(Hole(np.array([0.1, 0.15]), 0.012, "N1"),),
        slots=(outline / 4 + [0.4, 0.05],),
        marks=(np.array([[0, 0.1], [1, 0.1]]),),
        folds=(Fold(np.array([[0.8, 0], [0.8, 0.2]]), 0.3),),
    )
    found = compas.json_loads(compas.json_dumps(part.moved_by(np.pi / 2, np.array([3.0, 4.0])).to_compas()))
    cut, holes = found["cut"], found["drilled"]
    assert all(line.is_closed for line in cut)
    around, within = (Polygon(line.points[:-1]).area for line in cut)
    assert around - within == pytest.approx(part.area)
    assert np.allclose(holes[0].center, [3 - 0.15, 4 + 0.1, 0])
    assert holes[0].diameter == pytest.approx(0.012)
    assert [line.length for line in (*found["engraved"], *found["folded"])] == pytest.approx([1.0, 0.2])
