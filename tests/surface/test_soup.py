"""Faces that share no vertex: joined where they are meant to be, and told; else every vertex stays what it is."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from dsfab.surface.files.mesh_files import with_shared_vertices
from dsfab.surface.files.polygons import polygons
from dsfab.surface.files.reading import PolygonFile

SQUARE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
TETRAHEDRON = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]


def apart(places, faces):
    """The faces with a vertex for each corner, in the order of their corners."""
    V = [places[corner] for face in faces for corner in face]
    ends = np.cumsum([0, *map(len, faces)]).tolist()
    return PolygonFile(polygons(V, [list(range(a, b)) for a, b in pairwise(ends)]))


def test_two_triangles_that_share_no_vertex_are_joined_along_their_edge():
    found, told = with_shared_vertices(apart(SQUARE, [[0, 1, 2], [0, 2, 3]]))
    assert found.mesh.corners.tolist() == [0, 1, 2, 0, 2, 5]  # the first vertex at each place
    assert told == ("2 vertices merged with other vertices at exactly the same place",)


def test_a_vertex_that_no_face_has_and_that_is_none_keeps_no_faces_apart():
    file = apart(SQUARE, [[0, 1, 2], [0, 2, 3]])
    V = np.concatenate([file.mesh.V, [[np.nan, 0, 0]]])
    assert with_shared_vertices(PolygonFile(replace(file.mesh, V=V)))[0].mesh.corners.tolist() == [0, 1, 2, 0, 2, 5]


def test_halves_whose_edges_all_have_a_twin_are_joined_without_being_a_soup():
    """A tetrahedron in two halves of two faces each: each half shares vertices."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]).tolist()
    faces = [*TETRAHEDRON[:2], *[[v + 4 for v in face] for face in TETRAHEDRON[2:]]]
    found, told = with_shared_vertices(PolygonFile(polygons([*corners, *corners], faces)))
    assert found.mesh.corners.reshape(-1, 3).tolist() == TETRAHEDRON
    assert told == ("4 vertices merged with other vertices at exactly the same place",)


LEAF = [[0, 0, 0], [1, 1, 0], [2, 0, 0], [0, 0, 0], [-1, -1, 0]]
SHARED_POINT = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0], [-1, 0, 0], [0, -1, 0], [0, 0, -1]]

KEPT = {
    "no faces": polygons(SQUARE, []),
    "one face that touches itself": polygons(LEAF, [[0, 1, 2, 3, 4]]),
    "three faces at an edge": apart(
        [[0, 0, 0], [0, 0, 1], [1, 0, 0], [0, 1, 0], [-1, 0, 0]], [[0, 1, k] for k in (2, 3, 4)]
    ).mesh,
    "closed bodies that touch in a point": polygons(
        SHARED_POINT, TETRAHEDRON + [[v + 4 for v in face[::-1]] for face in TETRAHEDRON]
    ),
    "free edges that keep no twin": polygons([*SQUARE, [0, 0, 0], [5, 5, 0]], [[0, 1, 2], [0, 2, 3], [4, 5, 1]]),
    "vertices of no face": polygons([*SQUARE[:3], *SQUARE], [[0, 1, 2]]),
    "places that differ": apart([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 0, 1e-300]], [[0, 1, 2], [3, 2, 1]][:1]).mesh,
    "a corner before all vertices": polygons([*SQUARE[:3], *SQUARE], [[0, 1, 2], [3, 5, -1]]),
    "a corner behind all vertices": polygons([*SQUARE[:3], *SQUARE], [[0, 1, 2], [3, 5, 7]]),
    "a vertex that is none": polygons([*SQUARE[:3], *SQUARE[:2], [np.nan, 0, 0]], [[0, 1, 2], [3, 4, 5]]),
}


@pytest.mark.parametrize("name", KEPT)
def test_separate_bodies_in_a_soup_stay_separate(name):
    file = PolygonFile(KEPT[name])
    found, told = with_shared_vertices(file)
    assert found is file
    assert told == ()
