"""Symmetry on request: exactly symmetric patterns, and refusals that say what is off and by how much."""

import numpy as np
import pytest

import dsfab
from dsfab.core.errors import PatternError, PresetError
from dsfab.design import draft
from dsfab.diffusion import diffusion_modes, diffusion_operator, diffusion_tensors, symmetry_group, symmetry_of
from dsfab.slicing import cut
from dsfab.surface import LoadCase, Surface
from dsfab.surface.fields import voronoi_mass
from tests.presets import DOME_MODES
from tests.shapes import grid, jittered, square

BRIDGE = {
    "surface": {
        "shape": "plate",
        "length": 2.0,
        "width": 1.0,
        "edge": 0.06,
        "support": [{"at": {"pick": "side", "axis": "x", "end": end}} for end in ("min", "max")],
        "load": [
            {"kind": "force", "at": {"pick": "ball", "center": [0, 0.5, 0], "radius": 0.2}, "force": [0, -1e3, 0]}
        ],
    }
}
DOME = {"surface.edge": 0.45}


def loaded_square(jitter: float = 0.0) -> tuple[Surface, LoadCase]:
    """A square plate held along its rim and pressed, about the origin."""
    plate = jittered(square(12), jitter)
    held = np.abs(plate.V).max(axis=1) > 1 - 1e-9
    force = np.outer(plate.vertex_areas, [0, 0, -1.0])
    return plate, LoadCase(np.repeat(held[:, None], 3, axis=1), force, np.zeros(plate.n, dtype=bool))


def eccentric(load: LoadCase, plate: Surface, shift: float) -> LoadCase:
    """A further force beside the centre."""
    near = np.linalg.norm(plate.V - [shift, 0, 0], axis=1) < 0.3
    return LoadCase(load.fixed, load.force + np.outer(near, [0, 0, -0.1]), load.loaded)


@pytest.mark.parametrize(
    ("words", "order"),
    [(["x"], 2), (["x", "y"], 4), (["rot:6:z"], 6), (["rot:6:z", "x"], 12), (["rot:2:x", "rot:2:y"], 4)],
)
def test_words_generate_their_group(words, order):
    R = symmetry_group(words)
    assert len(R) == order
    assert np.array_equal(R[0], np.eye(3))
    assert np.allclose(R @ R.transpose(0, 2, 1), np.eye(3))
    products = np.einsum("aij,bjk->abik", R, R).reshape(-1, 3, 3)
    assert all(np.abs(R - p).max(axis=(1, 2)).min() < 1e-9 for p in products)


@pytest.mark.parametrize("words", [["x"], ["x", "y"], ["rot:4:z"]])
def test_modes_of_a_symmetric_mesh_are_symmetric_to_rounding(words):
    plate, load = loaded_square()
    found = symmetry_of(plate, words, load)
    L = diffusion_operator(plate, diffusion_tensors(plate, np.zeros((plate.m, 3, 3)), r=1).major)
    L = (sum(T.T @ L @ T for T in found.maps) / found.order).tocsr()  # the diagonals of a grid have no such symmetry
    modes = diffusion_modes(plate, L, 4, symmetry=found)
    assert max(found.asymmetry(plate, x) for x in modes.X.T) < 1e-9
    mass = voronoi_mass(plate)
    mass = found.mean(mass)
    every = diffusion_modes(plate, L, 40)
    assert all(np.abs(every.lam / value - 1).min() < 1e-2 for value in modes.lam)


def test_rounded_coordinates_keep_the_symmetry_of_a_mesh():
    """Images of vertices are vertices still: what is decided at one is decided alike at the other."""
    plate, load = loaded_square()
    off = 2e-5 * plate.mean_edge * np.random.default_rng(1).uniform(-1, 1, plate.V.shape)
    found = symmetry_of(Surface(plate.V + off, plate.F), ["rot:4:z", "x"], load)
    assert all(T.nnz == plate.n and (T.data == 1).all() for T in found.maps)


def test_the_symmetry_error_of_an_uneven_mesh_falls_under_refinement():
    off = []
    for cells in (10, 20, 40):
        plate = jittered(grid(cells, cells, 2.0, 2.0))
        load = LoadCase(
            np.ones((plate.n, 3), dtype=bool), np.outer(plate.vertex_areas, [0, 0, -1.0]), np.zeros(plate.n)
        )
        found = symmetry_of(plate, ["x"], load)
        L = diffusion_operator(plate, diffusion_tensors(plate, np.zeros((plate.m, 3, 3)), r=1).major)
        off.append(max(found.asymmetry(plate, x) for x in diffusion_modes(plate, L, 3, symmetry=found).X.T))
    assert off[0] > 2 * off[1] > 4 * off[2]
    assert off[2] < 2e-3


def clipped(surface: Surface, *normals: list[float]) -> float:
    """Area on the positive side of planes through the origin, cut exactly."""
    for normal in normals:
        surface = cut(surface, [surface.V @ normal], [[0.0]], snap=0.0).subset().surface
    return surface.area


def shares(design, turns: int) -> np.ndarray:
    """Material area of each sector about z over their mean."""
    area = []
    for k in range(turns):
        low, high = 2 * np.pi * k / turns, 2 * np.pi * (k + 1) / turns
        planes = [-np.sin(low), np.cos(low), 0], [np.sin(high), -np.cos(high), 0]
        area.append(clipped(design.sheet.surface, *planes))
    return np.array(area) / np.mean(area)


@pytest.mark.parametrize(("turns", "tolerance"), [(6, 2e-4), (5, 0.01)])
def test_sectors_of_a_dome_keep_the_same_area(turns, tolerance):
    """The mesh of the dome has six equal sectors and no five: there the pattern is symmetric to the width of a face."""
    changes = DOME | {"diffusion.symmetry": [f"rot:{turns}:z"], "diffusion.modes": 3, "pattern.minor.mode": 2}
    design = dsfab.run(dsfab.load_preset(DOME_MODES, changes))
    assert np.abs(shares(design, turns) - 1).max() < tolerance
    assert f"modes have the symmetries rot:{turns}:z ({turns} symmetric images)" in " ".join(
        note.text for note in design.notes
    )


def test_a_bridge_is_the_same_left_and_right():
    changes = BRIDGE | {"diffusion.symmetry": ["x"], "pattern.rim": 0.0}
    design = dsfab.run(dsfab.load_preset("cantilever", changes))
    halves = [clipped(design.sheet.surface, [side, 0, 0]) for side in (1, -1)]
    assert halves[0] == pytest.approx(halves[1], rel=1e-3)
    without = draft(dsfab.load_preset("cantilever", {**changes, "diffusion.symmetry": []}))
    found = symmetry_of(design.surface, ["x"], design.load)
    assert max(found.asymmetry(design.surface, x) for x in without.diffusion.major.X.T) > 1  # some are odd
    assert max(found.asymmetry(design.surface, x) for x in design.diffusion.major.X.T) < 0.02


@pytest.mark.parametrize(
    ("words", "shift", "says"),
    [
        (["rot:6:z"], 0.0, r"the surface is not symmetric: a mirrored or rotated copy deviates by 0\.\d+ m"),
        (["x"], 0.5, r"the loads are not symmetric: their resultants differ by \d+%"),
        (["rot:4:z"], 0.5, "the loads are not symmetric: their resultants differ"),
    ],
)
def test_an_asymmetric_plate_is_refused_with_the_reason(words, shift, says):
    plate, load = loaded_square()
    with pytest.raises(PatternError, match=says):
        symmetry_of(plate, words, eccentric(load, plate, shift) if shift else load)


def test_loads_whose_resultants_agree_but_that_lie_elsewhere_are_refused():
    """Two forces on a line through the centre: a quarter of a turn keeps force and moment, and moves them."""
    plate, load = loaded_square()
    corners = np.zeros((plate.n, 3))
    for angle in (0.3, 0.3 + np.pi):
        near = np.linalg.norm(plate.V[:, :2] - 0.6 * np.array([np.cos(angle), np.sin(angle)]), axis=1) < 0.25
        corners = corners + np.outer(near / near.sum(), [0, 0, -1.0])
    with pytest.raises(PatternError, match=r"the loads are not symmetric: \d+% of the load has no mirrored or rotated"):
        symmetry_of(plate, ["rot:4:z"], LoadCase(load.fixed, corners, load.loaded))
    assert symmetry_of(plate, ["rot:2:z"], LoadCase(load.fixed, corners, load.loaded)).order == 2


def test_supports_are_compared_by_place_and_by_direction():
    plate, load = loaded_square()
    one_side = LoadCase(load.fixed & (plate.V[:, :1] < 0), load.force, load.loaded)
    with pytest.raises(
        PatternError, match=r"the supports are not symmetric: a mirrored or rotated support is [\d.]+ m from the near"
    ):
        symmetry_of(plate, ["x"], one_side)
    assert symmetry_of(plate, ["y"], one_side).order == 2
    rollers = LoadCase(load.fixed & [True, False, True], load.force, load.loaded)
    assert symmetry_of(plate, ["x", "y"], rollers).order == 4
    with pytest.raises(
        PatternError, match="supports that hold only xz would hold other axes after the rotation or reflection"
    ):
        symmetry_of(plate, ["rot:4:z"], rollers)


@pytest.mark.parametrize("word", ["w", "rot:1:z", "rot:6", "rot:six:z", "x:2", "rot:999:z"])
def test_unknown_words_are_refused(word):
    with pytest.raises(PresetError, match=r"diffusion\.symmetry: .* is not a symmetry; write x, y or z for a mirror"):
        dsfab.load_preset(DOME_MODES, {"diffusion.symmetry": [word]})


def test_too_large_a_group_is_refused():
    with pytest.raises(PatternError, match="over 240 symmetric images; list fewer"):
        symmetry_group(["rot:7:x", "rot:5:z"])


def test_stress_becomes_symmetric_and_symmetric_stress_stays():
    plate, load = loaded_square()
    found = symmetry_of(plate, ["rot:4:z"], load)
    sigma = np.random.default_rng(0).normal(size=(plate.m, 3, 3))
    sigma += sigma.transpose(0, 2, 1)
    mean = found.mean_stress(sigma)
    assert found.mean_stress(mean) == pytest.approx(mean)
    assert np.abs(mean - sigma).max() > 1
    for R, face in zip(found.R, found.faces, strict=True):
        assert R.T @ mean[face] @ R == pytest.approx(mean)


@pytest.mark.parametrize(("lean", "is_symmetric"), [(0.008, True), (0.012, False)])
def test_a_load_may_lean_by_a_hundredth_and_still_count_as_symmetric(lean, is_symmetric):
    """Its image leans to the other side, so that the resultants differ by twice that share."""
    plate, load = loaded_square()
    leaning = LoadCase(load.fixed, load.force + np.outer(plate.vertex_areas, [lean, 0, 0]), load.loaded)
    if is_symmetric:
        assert symmetry_of(plate, ["x"], leaning).order == 2
        return
    with pytest.raises(PatternError, match="their resultants differ by 2%"):
        symmetry_of(plate, ["x"], leaning)


@pytest.mark.parametrize(("share", "is_symmetric"), [(0.45, True), (0.65, False)])
def test_up_to_three_tenths_of_a_load_may_lie_elsewhere_than_its_image(share, is_symmetric):
    """An odd cubic without a moment is added to an even load; smoothed over two edges, half of the share remains."""
    plate, load = loaded_square()
    x, area = plate.V[:, 0], plate.vertex_areas
    odd = x**3 - (area @ x**4) / (area @ x**2) * x
    odd *= share / 2 * area.sum() / (area @ np.abs(odd))
    uneven = LoadCase(load.fixed, np.outer(area * (1 + odd), [0, 0, -1.0]), load.loaded)
    if is_symmetric:
        assert symmetry_of(plate, ["x"], uneven).order == 2
        return
    with pytest.raises(PatternError, match=r"\d+% of the load has no mirrored or rotated counterpart"):
        symmetry_of(plate, ["x"], uneven)
