"""The stiffness from blocks on one pattern, against sums over elements written the long way."""

import numpy as np
import pytest

from dsfab.core.arrays import complement, distinct
from dsfab.statics import (
    PAPER,
    Elements,
    Material,
    SheetModel,
    bending_stiffness,
    matrix_sum,
    membrane_stiffness,
    sheet_stiffness,
)
from dsfab.statics.assembly import angle_gradients, hinges, vertex_pairs
from dsfab.statics.membrane import corner_strains
from dsfab.surface import Surface
from tests.shapes import ZOO

STEEL = Material(210e9, 0.3)
H = 0.02


def folded_twice() -> Surface:
    """Two faces on the same three corners: the vertices across each of their hinges are one."""
    return Surface([[0, 0, 0], [1, 0, 0], [0.2, 1, 0]], [[0, 1, 2], [0, 2, 1]])


def three_faces_on_an_edge() -> Surface:
    """Three faces on one edge, and a fourth that turns the other way round."""
    V = [[0, 0, 0], [1, 0, 0], [0.4, 1, 0], [0.5, -0.6, 0.7], [0.5, -0.5, -0.8], [1.4, 0.9, 0.2]]
    return Surface(V, [[0, 1, 2], [1, 0, 3], [0, 1, 4], [1, 2, 5]])


CASES = {**ZOO, "folded twice": folded_twice, "three leaves": three_faces_on_an_edge}


def long_way(surface: Surface, blocks: np.ndarray, corners: np.ndarray) -> np.ndarray:
    K = np.zeros((3 * surface.n, 3 * surface.n))
    for block, vertices in zip(blocks, corners, strict=True):
        at = (3 * vertices[:, None] + np.arange(3)).ravel()
        np.add.at(K, (at[:, None], at[None, :]), block)
    return K


def small(name: str) -> Surface:
    surface = CASES[name]()
    if surface.n > 700:
        pytest.skip("too large for a dense matrix")
    return surface


@pytest.mark.parametrize("law", ["plane_stress", "stvk"])
@pytest.mark.parametrize("name", CASES)
def test_the_membrane_is_the_sum_over_its_faces(name, law):
    surface = small(name)
    B, C = corner_strains(surface), STEEL.membrane(law) * H
    expected = long_way(surface, np.einsum("mai,ab,mbj,m->mij", B, C, B, surface.areas), surface.F)
    for elements in (Elements("constant", "hinge"), Elements("constant", None)):
        K = membrane_stiffness(surface, STEEL, H, law, elements)
        assert K.has_sorted_indices
        assert abs(K - K.T).max() == 0
        assert np.abs(K.toarray() - expected).max() < 1e-13 * np.abs(expected).max()


@pytest.mark.parametrize("name", CASES)
def test_bending_is_the_sum_over_its_hinges(name):
    surface = small(name)
    hinge = hinges(surface)
    g, weight = angle_gradients(surface, hinge)
    g = g.reshape(-1, 12) * np.sqrt(STEEL.bending_stiffness(H) * weight)[:, None]
    expected = long_way(surface, g[:, :, None] * g[:, None, :], hinge)
    K = bending_stiffness(surface, STEEL, H)
    assert abs(K - K.T).max() == 0
    assert np.abs(K.toarray() - expected).max() < 1e-12 * max(np.abs(expected).max(), 1.0)


def test_both_are_stored_alike_and_the_pattern_is_made_once():
    surface = ZOO["flat"]()
    membrane, bending = membrane_stiffness(surface, STEEL, H), bending_stiffness(surface, STEEL, H)
    assert np.array_equal(membrane.indices, bending.indices)
    assert vertex_pairs(surface, hinges(surface)) is vertex_pairs(surface, hinges(surface))
    K = matrix_sum(membrane, bending)
    assert np.shares_memory(K.indices, membrane.indices)
    assert abs(K - (membrane + bending)).max() == 0
    assert abs(K - sheet_stiffness(SheetModel(surface, STEEL, H), PAPER)).max() == 0  # added block by block
    other = membrane_stiffness(surface, STEEL, H, elements=Elements("constant", None))
    assert abs(matrix_sum(other, bending) - K).max() <= 1e-15 * abs(K).max()


@pytest.mark.parametrize("dtype", [np.int32, np.int64, np.uint8])
def test_distinct_numbers_are_numpys(dtype):
    rng = np.random.default_rng(2)
    for shape in ((0,), (1,), (1000,), (20, 30)):
        keys = rng.integers(0, 200, shape).astype(dtype)
        assert np.array_equal(distinct(keys), np.unique(keys))
    ends = np.array([np.iinfo(dtype).min, np.iinfo(dtype).max], dtype=dtype)
    assert np.array_equal(distinct(ends[[1, 0, 1]]), ends)


def test_the_complement_of_indices_is_complete():
    for taken in ([], [3], [5, 0, 2], range(7)):
        indices = np.array(taken, dtype=np.int64)
        assert np.array_equal(complement(indices, 7), np.setdiff1d(np.arange(7), indices))
