"""Where outlines cross."""

import numpy as np
import pytest

from dsfab.export.smooth.edges import Edge
from dsfab.export.smooth.solid import Piece, Skin
from dsfab.export.smooth.splines import straight
from dsfab.export.smooth.touching import crossings


def outline(*corners):
    """A piece of one skin, its outline through corners of a plane, 10 above it."""
    edges, n = [], len(corners)
    for i in range(n):
        a, b = (np.array(corners[j % n], dtype=float) for j in (i, i + 1))
        upper, lower = (straight(np.append(a, z), np.append(b, z)) for z in (10.0, 0.0))
        edges.append(Edge(i, (i + 1) % n, upper, lower, {0: straight(a, b)}, 0.0, True))
    return Piece(edges=edges, skins=[Skin(0, (tuple((i, True) for i in range(n)),))])


def test_an_outline_that_does_not_cross_itself_has_no_place():
    assert crossings(outline((0, 0), (3, 0), (3, 1), (1, 1), (1, 2), (0, 2))).shape == (0, 3)
    assert crossings(outline((0, 0), (1, 0), (2, 0), (2, 1))).shape == (0, 3)  # straight on


def test_the_place_where_an_outline_crosses_itself():
    found = crossings(outline((0, 0), (1, 1), (1, 0), (0, 0.9)))
    assert len(found) == 2  # a chord of each
    assert found[:, 2] == pytest.approx(10)
    assert np.linalg.norm(found[:, :2] - 0.9 / 1.9, axis=1).max() < 0.1
