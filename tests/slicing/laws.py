"""Laws that each cut sheet obeys."""

import numpy as np
import pytest
from hypothesis import strategies as st
from scipy.spatial import Delaunay

from dsfab.slicing import Sheet
from dsfab.surface import Surface
from dsfab.surface.topology import euler_characteristic, pieces


def material_area(sheet: Sheet) -> float:
    return sheet.surface.areas[sheet.material].sum()


def points_in_cells(sheet: Sheet, per_cell: int = 5, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Random points of the cells, as weights on the uncut vertices, and the cell of each."""
    inside = np.random.default_rng(seed).dirichlet([1, 1, 1], (per_cell, sheet.surface.m))
    W = sheet.weights.toarray()[sheet.surface.F]
    return np.einsum("pmc,mcn->pmn", inside, W).reshape(-1, W.shape[2]), np.tile(np.arange(sheet.surface.m), per_cell)


def check_laws(surface: Surface, sheet: Sheet) -> None:
    """What holds for every sheet cut from a surface."""
    cells, old, new = sheet.surface, surface.edges, sheet.surface.edges
    # the cells fill their parents, once, and face the same way
    areas = np.bincount(sheet.parent, cells.areas, minlength=surface.m)
    assert areas == pytest.approx(surface.areas, rel=1e-9, abs=1e-14 * surface.area)
    assert cells.area == pytest.approx(surface.area, rel=1e-12)
    assert (
        np.einsum("ij,ij->i", cells.normals, surface.normals[sheet.parent])[cells.areas > 1e-10 * surface.area] > 0.999
    ).all()
    # connected as before: no T-junction, no duplicate, no gap
    assert euler_characteristic(cells.F, new) == euler_characteristic(surface.F, old)
    assert pieces(cells.F, new)[0] == pieces(surface.F, old)[0]
    assert new.count.max() <= max(2, old.count.max())
    length = lambda s: np.linalg.norm(np.diff(s.V[s.edges.ends[s.edges.boundary]], axis=1), axis=2).sum()  # noqa: E731
    assert length(cells) == pytest.approx(length(surface), rel=1e-12, abs=1e-300)
    assert len(np.unique(np.sort(cells.F, axis=1), axis=0)) == cells.m
    assert len(np.unique(cells.V[np.unique(cells.F)], axis=0)) == len(np.unique(cells.F))
    # weights
    W = sheet.weights
    assert np.diff(W.indptr).max() <= 3
    assert W.data.min() > 0
    assert W.sum(axis=1) == pytest.approx(np.ones(cells.n), abs=1e-14)
    assert sheet.carry(surface.V) == pytest.approx(cells.V, abs=1e-14 * np.abs(surface.V).max())
    assert (W[: surface.n].toarray() == np.eye(surface.n)).all()
    corners = np.zeros((cells.m, surface.n), dtype=bool)
    np.put_along_axis(corners, surface.F[sheet.parent], True, axis=1)
    assert not ((W.toarray()[cells.F] > 0) & ~corners[:, None, :]).any()


@st.composite
def cases(draw):
    """A lifted Delaunay mesh, fields that are random, on levels, next to levels or constant in places, and levels."""
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    xy = rng.uniform(size=(draw(st.integers(4, 22)), 2))
    surface = Surface(np.c_[xy, draw(st.sampled_from([0.0, 0.5])) * rng.normal(size=len(xy))], Delaunay(xy).simplices)
    fields, levels = [], []
    for _ in range(draw(st.integers(1, 3))):
        x = rng.normal(size=surface.n)
        kind = draw(st.sampled_from(["random", "rounded", "near", "patches", "constant"]))
        if kind != "random":
            x = np.round(4 * x) / 4
        if kind == "near":
            x = x + rng.choice([0, 1e-16, 1e-12, -1e-10, 1e-8, -1e-6, 1e-3], size=surface.n)
        if kind == "patches":
            x[surface.F[rng.integers(surface.m, size=3)]] = 0.25
        if kind == "constant":
            x[:] = 0.25
        lines = [rng.normal(size=5), np.arange(-8, 9) / 4, np.array([0.25, 0.25, 0.5]), np.array([0.25]), np.empty(0)]
        lines.append(np.array([0, 0.25, 0.25 + 1e-13, 0.25 + 1e-7, 0.5]))
        fields.append(x)
        levels.append(np.sort(lines[draw(st.integers(0, len(lines) - 1))]))
    return surface, fields, levels, draw(st.sampled_from([0.0, 0.05, 0.3]))
