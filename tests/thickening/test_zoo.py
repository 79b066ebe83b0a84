"""Solids over a zoo, thin and thick: closed, of the right genus, and free of intersections, also as STL holds them."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

import dsfab
from dsfab.surface import Surface
from dsfab.surface.topology import euler_characteristic, pieces
from dsfab.thickening import Solid
from dsfab.thickening.self_intersection import intersecting_pairs
from tests.meshes import mesh_file
from tests.shapes import grid, jittered, lifted, moebius, sphere
from tests.thickening.solid_zoo import MESHES, SHAPE_OF, SHAPES, fuzzed
from tests.thickening.thick_solids import cgal_pairs, made, real

PRESETS = [name for name in SHAPE_OF if name not in ("roof", "camel_ears", "camel_none", "camel_nose")]
"""Presets but `roof`, which waits for a mesh of the user's, and those on the surface of another one."""

COARSER = {"camel_head": 1.5, "climbing_hold": 3}
"""How many times their edge still shows the details of a shape; 4 for the others."""


def judge(solid: Solid) -> None:
    read = trimesh.Trimesh(solid.V, solid.F, process=False)
    assert read.is_volume
    euler = len(np.unique(solid.F)) - len(read.edges_unique) + len(solid.F)
    shells, _ = pieces(solid.F, Surface(solid.V, solid.F).edges)
    assert solid.genus == shells - euler // 2
    single = (solid.V * 1e3).astype(np.float32).astype(float)
    points, of = np.unique(single, axis=0, return_inverse=True)  # as readers of STL merge it
    assert len(points) == len(np.unique(solid.F))
    for V, F in ((solid.V, solid.F), (points, of.reshape(-1)[solid.F])):
        assert len(intersecting_pairs(V, F)) == 0
        assert trimesh.Trimesh(V, F, process=False).is_watertight
    assert solid.repairs.pairs == 0


@pytest.mark.parametrize("share", [0.01, 0.05])
@pytest.mark.parametrize("name", SHAPES)
def test_shapes_become_sound_solids(name, share):
    surface = SHAPES[name]()
    solid = made(surface, share * surface.size / 2)
    judge(solid)
    if solid.repairs.rung != "united":
        count, _ = pieces(surface.F, surface.edges)
        handles = euler_characteristic(surface.F, surface.edges)
        shells, _ = pieces(solid.F, Surface(solid.V, solid.F).edges)
        assert solid.genus == shells - handles  # the double cover has twice the Euler characteristic
        assert solid.pieces == count


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.02])
@pytest.mark.parametrize("name", MESHES)
def test_real_surfaces_become_sound_solids(name, share):
    mesh_file(f"{name}.obj")
    surface = real(name)
    judge(made(surface, share * surface.size / 2))


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.01])
@pytest.mark.parametrize("name", PRESETS)
def test_surfaces_of_presets_become_sound_solids(name, share):
    preset = dsfab.load_preset(name)
    if getattr(preset.surface, "edge", None):
        preset = dsfab.load_preset(name, {"surface.edge": COARSER.get(name, 4) * preset.surface.edge})
    if not preset.surface.model_dump().get("shape"):
        preset = dsfab.load_preset(name, {}, mesh_file(Path(preset.surface.file).name))
    surface = preset.surface.build()
    judge(made(surface, share * surface.size / 2))


# ---------------------------------------------------------------- a fuzz of coarse patterns with exact hits


TINY = (
    lambda: jittered(grid(3, 3, 1.0, 1.0)),
    lambda: sphere(0),
    lambda: lifted(lambda x, y: (x - 0.5) * (y - 0.5) * 1.5, cells=3),
    lambda: moebius(12, 2, 0.8),
    lambda: lifted(lambda x, y: 4 * x * (1 - x) * y * (1 - y), cells=3),
)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_coarse_random_patterns_become_sound_solids_and_cgal_agrees(seed):
    solid = fuzzed(seed)
    assert solid is not None
    judge(solid)
    assert cgal_pairs(solid.V, solid.F) == set()


@pytest.mark.slow
def test_ten_more_coarse_random_patterns():
    built = [fuzzed(seed) for seed in range(20, 30)]
    for solid in built:
        if solid is not None:
            judge(solid)
    assert sum(solid is not None for solid in built) > 8


@pytest.mark.slow
def test_ninety_tiny_random_patterns_become_sound_solids():
    built = [fuzzed(seed, TINY, 3) for seed in range(1000, 1092)]
    for solid in built:
        if solid is not None:
            judge(solid)
    assert sum(solid is not None for solid in built) > 85
