"""The proof that prisms lie apart: what it proves meets nothing in the exact test of all pairs, and it proves most."""

import sys

import numpy as np
import pytest

from dsfab.slicing import cut, resolve_pinches
from dsfab.surface import Surface
from dsfab.thickening import OffsetLayer, offsets, proven_cells, thicken
from dsfab.thickening.self_intersection import intersecting_pairs
from dsfab.thickening.skin import Skin
from tests.shapes import grid, jittered, joined, lifted, moebius, projective_plane, sphere, torus


def cut_layer(surface: Surface, D: np.ndarray, side: str = "mid", lines: int = 6) -> tuple[OffsetLayer, np.ndarray]:
    """A surface with two families of stripes, and which of its cells are material."""
    x, y, z = (surface.V / surface.size).T
    fields = [x + 0.3 * y * z, y - 0.4 * x + 0.2 * z**2]
    cells = cut(surface, fields, [np.linspace(f.min(), f.max(), 2 * lines + 2)[1:-1] for f in fields])
    cells = resolve_pinches(cells, np.linalg.norm(D, axis=1).mean()).sheet
    return OffsetLayer(surface, D, cells.surface, cells.carry(D), cells.parent, side), cells.material


SQUARE = jittered(grid(24, 24, 1.0, 1.0))


def tilted(surface: Surface, slope: float) -> Surface:
    return Surface(surface.V + np.outer(surface.V[:, 0] - 0.5, [0, 0, slope]), surface.F)


def spiral(gap: float) -> Surface:
    flat = grid(160, 6, 1.0, 1.0)
    angle, radius = 4 * np.pi * flat.V[:, 0], 0.5 + 2 * gap * flat.V[:, 0]
    return Surface(np.c_[radius * np.cos(angle), radius * np.sin(angle), 0.4 * flat.V[:, 1]], flat.F)


CASES = {
    "sphere": (lambda: sphere(4), 0.03),
    "torus": (lambda: torus(48, 16, 1.0, 0.3), 0.06),
    "torus too thick": (lambda: torus(48, 16, 1.0, 0.3), 0.7),
    "saddle": (lambda: lifted(lambda x, y: (x - 0.5) * (y - 0.5) * 1.5, cells=20), 0.03),
    "crumpled": (lambda: lifted(lambda x, y: 0.05 * np.sin(31 * x) * np.sin(29 * y), cells=24), 0.05),
    "two that touch": (lambda: joined(SQUARE, Surface(SQUARE.V + [0, 0, 0.02], SQUARE.F)), 0.04),
    "one over a part": (lambda: joined(SQUARE, Surface(SQUARE.V + [0.53, 0.0, 0.01], SQUARE.F)), 0.02),
    "two that cross": (lambda: joined(SQUARE, tilted(SQUARE, 0.1)), 0.02),
    "two upright": (lambda: joined(SQUARE, Surface(SQUARE.V[:, [2, 0, 1]] + [0.5, 0, -0.5], SQUARE.F)), 0.02),
    "spiral": (lambda: spiral(0.03), 0.035),
    "moebius": (lambda: moebius(60, 6, 0.8), 0.03),
    "boy": (lambda: projective_plane(3), 0.05),
}


@pytest.mark.slow
@pytest.mark.parametrize("side", ["mid", "out"])
@pytest.mark.parametrize("name", CASES)
def test_solids_that_are_proven_apart_do_not_intersect(name, side):
    """Offsets without a limit, walls with either diagonal, exact and as single precision holds them."""
    make, t = CASES[name]
    surface = make()
    D = t / 2 * surface.vertex_normals
    layer, kept = cut_layer(surface, D, side)
    F = layer.cells.F[kept]
    sheet = Surface(layer.cells.V, F)
    proven = proven_cells(layer)[kept]
    for single in (False, True):
        skin = Skin.from_surface(sheet, {"mid": 0, "out": 1}[side], single)
        for diagonals in (np.zeros(len(skin.rim), dtype=bool), np.arange(len(skin.rim)) % 2 == 0):
            pairs = intersecting_pairs(skin.vertices(sheet.V, layer.carried), skin.faces(diagonals))
            assert not proven[skin.sources()[pairs]].any()


def test_smooth_surfaces_are_proven_whole():
    for surface, share in ((sphere(5), 1.0), (jittered(grid(60, 60, 1.0, 1.0)), 0.6)):
        layer, _ = cut_layer(surface, offsets(surface, 0.01).D)
        assert proven_cells(layer).mean() >= share


def test_sheets_that_cross_are_proven_away_from_the_line_only():
    """Both sheets look to the same side: only the number of turns of the rim tells them from one."""
    t = 0.02
    surface = joined(jittered(grid(60, 60, 1.0, 1.0)), tilted(jittered(grid(60, 60, 1.0, 1.0)), 1.0))
    layer, _ = cut_layer(surface, offsets(surface, t).D)
    proven, x = proven_cells(layer), layer.cells.centroids[:, 0]
    near = np.abs(x - 0.5) < t / 2
    assert not proven[near].any()
    assert proven[~near].mean() > 0.2


def test_one_folded_prism_is_left_to_the_test():
    surface = sphere(4)
    D = 0.01 * surface.vertex_normals
    D[100] = -D[100]
    layer, _ = cut_layer(surface, D)
    proven = proven_cells(layer)
    around = (surface.F == 100).any(axis=1)[layer.parent]
    assert not proven[around].any()
    assert proven.mean() > 0.5


def test_a_proof_changes_no_solid():
    surface = torus(48, 16, 1.0, 0.3)
    D = offsets(surface, 0.05).D
    layer, kept = cut_layer(surface, D)
    used = np.zeros(layer.cells.n, dtype=bool)
    used[layer.cells.F[kept]] = True
    sheet = Surface(layer.cells.V[used], (np.cumsum(used) - 1)[layer.cells.F[kept]])
    tested = thicken(sheet, layer.carried[used])
    spared = thicken(sheet, layer.carried[used], proven=proven_cells(layer)[kept])
    assert np.array_equal(tested.V, spared.V)
    assert np.array_equal(tested.F, spared.F)
    assert (tested.notes, tested.repairs) == (spared.notes, spared.repairs)


CHUNKS = ("slicing.cutting.cells", "thickening.offset_vectors", "thickening.separation_proof")


def test_nothing_depends_on_how_many_are_looked_at_together(monkeypatch):
    surface, results = sphere(4), []
    for chunk in (1 << 20, 37):
        for name in CHUNKS:
            monkeypatch.setattr(sys.modules[f"dsfab.{name}"], "CHUNK", chunk)
        mesh = Surface(surface.V, surface.F)
        offset, bent = offsets(mesh, 0.05), offsets(CASES["crumpled"][0](), 0.05)
        layer, kept = cut_layer(mesh, offset.D)
        results.append(
            (mesh.areas, offset.D, bent.D, layer.cells.V, layer.cells.F, layer.cells.areas, kept, proven_cells(layer))
        )
    for one, other in zip(*results, strict=True):
        assert np.array_equal(one, other)
    assert results[0][-1].any()
    assert bent.limited
