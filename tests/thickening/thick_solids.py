"""Thickened surfaces and checks of them."""

import os
from pathlib import Path

import manifold3d
import numpy as np
import pytest
import trimesh

from dsfab.surface.mesh import Surface
from dsfab.thickening import Solid, offsets, thicken
from dsfab.thickening.self_intersection import intersecting_pairs

MESHES = Path(os.environ.get("DSFAB_MESHES", Path(__file__).parents[3] / "shared" / "meshes"))


def made(surface: Surface, thickness: float) -> Solid:
    return thicken(surface, offsets(surface, thickness).D)


def check_sound(solid: Solid) -> None:
    """A closed oriented manifold without intersections, by three readers that are not ours; also as STL rounds it."""
    mesh = manifold3d.Mesh64(np.array(solid.V), np.array(solid.F, dtype=np.uint64))
    judged = manifold3d.Manifold(mesh)
    assert judged.status() == manifold3d.Error.NoError
    assert judged.volume() == pytest.approx(solid.volume, rel=1e-9)
    assert judged.surface_area() == pytest.approx(solid.area, rel=1e-9)
    read = trimesh.Trimesh(solid.V, solid.F, process=False)
    assert read.is_volume
    assert read.volume == pytest.approx(solid.volume, rel=1e-6)
    assert np.allclose(read.bounds, solid.box)
    single = (solid.V * 1e3).astype(np.float32)
    corners = single[solid.F]
    assert not (corners == np.roll(corners, 1, axis=1)).all(axis=2).any()
    for V in (solid.V, single.astype(float)):
        assert len(intersecting_pairs(V, solid.F)) == 0


def check_second_order(errors: list[float], finest: float) -> None:
    rates = np.log2(np.abs(errors[:-1]) / np.abs(errors[1:]))
    assert rates == pytest.approx(2, abs=0.1)
    assert abs(errors[-1]) < finest


def real(name: str) -> Surface:
    path = MESHES / f"{name}.obj"
    if not path.exists():
        pytest.skip(f"{path} is not here; DSFAB_MESHES names the folder of real meshes")
    V, F = [], []
    for line in path.read_text().splitlines():
        word = line.split()
        if word and word[0] == "v":
            V.append([float(c) for c in word[1:4]])
        elif word and word[0] == "f":
            corner = [int(c.split("/")[0]) - 1 for c in word[1:]]
            F += [[corner[0], corner[k], corner[k + 1]] for k in range(1, len(corner) - 1)]
    return Surface(V, F)


def cgal_pairs(V: np.ndarray, F: np.ndarray) -> set[tuple[int, ...]]:
    """The pairs that CGAL finds (GPL: in tests only)."""
    cgal = pytest.importorskip("igl.copyleft.cgal")
    found = cgal.remesh_self_intersections(np.array(V), np.array(F), detect_only=True)[2]
    return {tuple(sorted(map(int, pair))) for pair in found}
