"""What is held stays the same structure on every finer mesh: lengths and areas, whatever the picker, ears or not."""

import numpy as np
import pytest

import dsfab
from dsfab.design import held_vertices, sheet_load
from dsfab.design.regions_and_loads import acting_on
from dsfab.slicing import cut
from dsfab.slicing.cutting.sheet import SmoothSurface, finer
from dsfab.study.verdict import whole_sheet
from dsfab.surface import (
    All,
    Ball,
    Boundary,
    Box,
    Brush,
    Facing,
    Force,
    LoadCase,
    Nearest,
    PlanPolygon,
    Side,
    Support,
    Surface,
    Vertices,
    edges_of,
)
from tests.meshes import mesh_file
from tests.shapes import grid, lifted, moebius, obtuse, two_pieces

PULL = [Force(All(), (1.0, 2.0, 3.0))]


def flat(surface):
    """The surface's own flat faces as the smooth surface: finer meshes have its lengths and areas to the last digit."""
    return SmoothSurface(surface, np.zeros((len(surface.edges.ends), 3)))


def levels(surface, sheet, load, count=3):
    """The sheet, twice refined, with its held vertices (n', 3) on each mesh."""
    for _ in range(count):
        yield sheet, sheet_load(surface, sheet, load).fixed
        sheet = finer(sheet, flat(surface))


def held_extent(sheet, fixed, surface, load):
    """Metres of lines and m2 of faces that are held along x: those whose edges' middles are held on the next mesh."""
    edges, n = sheet.surface.edges, sheet.surface.n
    below = sheet_load(surface, finer(sheet, flat(surface)), load).fixed[:, 0]
    line = fixed[edges.ends, 0].all(axis=1) & below[n:]
    whole = line[edges.of].all(axis=1)
    line[edges.of[whole]] = False
    return sheet.surface.edge_lengths[line].sum(), sheet.surface.areas[whole].sum()


def ear():
    """A square of four faces around its middle, and an ear at one side of it: both of its free edges are boundary."""
    V = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 0], [1.6, 0.5, 0]])
    return Surface(V, np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [1, 5, 2]]))


def perimeter(surface):
    return surface.edge_lengths[surface.edges.boundary].sum()


ZOO = {
    "ear": ear,
    "plate": lambda: grid(6, 5, 1.0, 1.0),
    "strip one cell wide": lambda: grid(8, 1, 2.0, 0.3),
    "dome": lambda: lifted(lambda x, y: 1.6 * x * (1 - x) * y * (1 - y), 8),
    "obtuse": obtuse,
    "moebius": lambda: moebius(20, 2),
    "two pieces": two_pieces,
}
PICKERS = {
    "boundary": lambda s: Boundary(),
    "free edges in a box": lambda s: Box((-9, -9, -9), (9, 9, 9), boundary=True),
    "side": lambda s: Side("x", "min"),
    "deep side": lambda s: Side("x", "max", 0.4, relative=True),
    "ball": lambda s: Ball((0.5, 0.5, 0.5), 0.3, relative=True),
    "hollow outline": lambda s: PlanPolygon(hollow(s)),
    "brush": lambda s: Brush((tuple(s.V[0]), tuple(s.V[s.n // 2])), 0.4 * s.size),
    "facing": lambda s: Facing(tuple(s.normals[0]), 20.0),
    "vertices": lambda s: Vertices(tuple(range(0, s.n, 2))),
    "nearest": lambda s: Nearest((tuple(s.V[0]), tuple(s.V[s.n - 1]))),
}


def hollow(surface):
    """A U in plan over the box of a surface."""
    low, high = surface.V.min(axis=0)[:2], surface.V.max(axis=0)[:2]
    U = [(-0.1, -0.1), (1.1, -0.1), (1.1, 1.1), (0.7, 1.1), (0.7, 0.3), (0.3, 0.3), (0.3, 1.1), (-0.1, 1.1)]
    return tuple(tuple((low + np.array(p) * (high - low)).tolist()) for p in U)


@pytest.mark.parametrize("shape", list(ZOO))
@pytest.mark.parametrize("picker", list(PICKERS))
def test_the_same_length_and_area_are_held_on_every_mesh(shape, picker):
    """Also of a sheet that is cut: what a cut leaves of a held edge or face is held, and nothing besides."""
    surface = ZOO[shape]()
    at = PICKERS[picker](surface)
    if picker == "facing" and shape == "moebius":
        return  # it has no side that faces anywhere
    load = LoadCase.build(surface, [Support(at, "x")], PULL)
    x = surface.V @ [0.9, 0.35, 0.2]
    cells = cut(surface, [4 * (x - x.min()) / np.ptp(x) + 0.37], [np.arange(0, 6, 0.5)])
    meant = edges_of(at, surface) | (load.fixed[surface.edges.ends, 0].all(axis=1) & surface.edges.boundary)
    for sheet in (whole_sheet(surface), cells.subset(np.ones(cells.surface.m, dtype=bool))):
        found = [held_extent(*level, surface, load) for level in levels(surface, sheet, load)]
        length, area = np.array(found).T
        assert length == pytest.approx(length[0], rel=1e-9, abs=1e-12)
        assert area == pytest.approx(area[0], rel=1e-9, abs=1e-12)
        if not area[0]:
            assert length == pytest.approx(surface.edge_lengths[meant].sum())


@pytest.mark.parametrize("shape", ["ear", "plate", "strip one cell wide", "dome", "moebius"])
@pytest.mark.parametrize("at", [Boundary(), Box((-9, -9, -9), (9, 9, 9), boundary=True)])
def test_a_held_boundary_is_its_free_edges_and_nothing_within(shape, at):
    surface = ZOO[shape]()
    load = LoadCase.build(surface, [Support(at, "x")], PULL)
    for sheet, fixed in levels(surface, whole_sheet(surface), load, 4):
        edges, n = sheet.surface.edges, sheet.surface.n
        rim = np.zeros(n, dtype=bool)
        rim[edges.ends[edges.boundary]] = True
        assert (fixed[:, 0] == rim).all()
        assert sheet.surface.edge_lengths[edges.boundary].sum() == pytest.approx(perimeter(surface))
        assert (held_vertices(surface, sheet, load) == rim).all()


def test_regions_and_lines_within_the_sheet_stay_held():
    """The closed form: a band at one end is held as far as its last row of vertices, a wall below as a line."""
    surface = grid(8, 6, 4.0, 3.0)
    band = LoadCase.build(surface, [Support(Side("x", "min", 1.1), "x")], PULL)
    wall = LoadCase.build(surface, [Support(Box((1.9, -1, -1), (2.1, 4, 1)), "x")], PULL)
    for sheet, fixed in levels(surface, whole_sheet(surface), band):
        assert held_extent(sheet, fixed, surface, band)[1] == pytest.approx(1.0 * 3.0)
    for sheet, fixed in levels(surface, whole_sheet(surface), wall):
        assert held_extent(sheet, fixed, surface, wall) == (pytest.approx(3.0), 0)
        assert sheet.surface.V[fixed[:, 0], 0] == pytest.approx(2.0)


def test_an_ear_that_a_region_covers_is_held_whole():
    surface = ear()
    assert edges_of(Side("x", "max", 0.7), surface).sum() == 3  # the ear's
    load = LoadCase.build(surface, [Support(Side("x", "max", 0.7), "x")], PULL)
    found = [held_extent(*level, surface, load) for level in levels(surface, whole_sheet(surface), load)]
    assert [area for _, area in found] == pytest.approx([0.3] * 3)
    listed = LoadCase.build(surface, [Support(Vertices((1, 2, 5)), "x")], PULL)  # as the statics take it: by its edges
    found = [held_extent(*level, surface, listed) for level in levels(surface, whole_sheet(surface), listed)]
    assert [length for length, _ in found] == pytest.approx([2 * np.hypot(0.6, 0.5)] * 3)


def test_clamps_follow_the_picker_and_springs_stay_at_their_vertices():
    surface = grid(8, 1, 2.0, 0.3)  # each edge within it joins two vertices of the boundary
    clamp = Support(Boundary(), clamp=True).clamped_edges(surface)
    assert (clamp == surface.edges.boundary).all()
    spring = Support(Boundary(), spring=(1e3, 0.0, 0.0))
    load = LoadCase.build(surface, [spring, Support(Nearest(((0, 0, 0),)))], PULL)
    for sheet, _ in levels(surface, whole_sheet(surface), load):
        on = sheet_load(surface, sheet, load)
        assert on.spring[:, 0].sum() == pytest.approx(1e3)
        assert np.count_nonzero(on.spring[:, 0]) == surface.n


def test_a_void_leaves_the_boundary_that_was_held_and_no_more():
    preset = dsfab.load_preset(
        "cantilever",
        {
            "surface.edge": 0.2,
            "surface.support": [{"at": {"pick": "boundary"}, "hold": "xyz"}],
            "surface.load": [{"kind": "force", "at": {"pick": "ball", "center": [0.3, 0.0, 0.0], "radius": 0.3},
                              "force": [0, 0, -1e3]}],
            "pattern.region": [{"do": "void", "at": {"pick": "ball", "center": [0.9, 0.0, 0.0], "radius": 0.35}}],
        },
    )  # fmt: skip
    surface = dsfab.design.Design.from_preset(preset).surface
    support = acting_on(preset, surface).support[0]
    held = edges_of(support.at, surface)
    place = surface.V[surface.edges.ends[held]].mean(axis=1)
    away = np.linalg.norm(place - [0.9, 0, 0], axis=1)
    assert held.sum() > 10
    assert surface.edges.boundary[held].all()
    assert away.min() > 0.34
    assert (surface.edges.boundary & ~held).any()  # the edge of the void


@pytest.mark.slow
def test_a_roof_with_ears_is_one_structure_on_all_meshes():
    """0, 5 and 30 vertices more were held within it, and its compliance came out a hundredth too small."""
    design = dsfab.run(
        dsfab.load_preset("roof", {"pattern.width.solid_fraction": 0.5}, mesh_file("roof_with_opening.obj"))
    )
    surface, sheet = design.surface, design.slicing.cells.subset()
    ears = surface.edges.boundary[surface.edges.of].sum(axis=1) > 1
    assert ears.sum() > 3
    count, length = [], []
    for mesh, fixed in levels(surface, sheet, design.load, 2):
        held = fixed.all(axis=1)
        edges = mesh.surface.edges
        assert not held[edges.ends[~edges.boundary]].all(axis=1).any()
        count.append(held.sum())
        length.append(mesh.surface.edge_lengths[held[edges.ends].all(axis=1)].sum())
    assert count[1] == 2 * count[0]
    assert length[1] == pytest.approx(length[0], rel=1e-12)
