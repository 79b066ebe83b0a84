"""Edges along which faces of a mesh were deleted lose their teeth; those that are meant so keep theirs."""

import re

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from dsfab.core.arrays import area_vectors, lengths
from dsfab.preset.proposal import propose
from dsfab.surface import Surface, mended_mesh
from dsfab.surface.clean.borders import RAGGED_TURN, even_edges
from dsfab.surface.topology import boundary_loops, edge_table
from tests.shapes import corner_angles

EDGE = 0.25


def triangles(wide, high):
    """A plane of even triangles of `EDGE`."""
    rows, columns = round(high / (EDGE * np.sqrt(0.75))), round(wide / EDGE)
    j, i = np.meshgrid(np.arange(rows + 1), np.arange(columns + 1), indexing="ij")
    V = np.stack([EDGE * (i + 0.5 * (j % 2)), EDGE * np.sqrt(0.75) * j, 0.0 * i], axis=-1).reshape(-1, 3)
    at = lambda r, c: r * (columns + 1) + c  # noqa: E731
    F = [
        face
        for r in range(rows)
        for c in range(columns)
        for face in (
            [(at(r, c), at(r, c + 1), at(r + 1, c)), (at(r, c + 1), at(r + 1, c + 1), at(r + 1, c))]
            if r % 2 == 0
            else [(at(r, c), at(r + 1, c + 1), at(r + 1, c)), (at(r, c), at(r, c + 1), at(r + 1, c + 1))]
        )
    ]
    return V - V.mean(axis=0), np.array(F)


def kept(V, F, inside):
    """The mesh without the faces whose middles are not inside."""
    used, F = np.unique(F[inside(V[F].mean(axis=1))], return_inverse=True)
    return V[used], F.reshape(-1, 3)


def squares(columns, rows, place):
    """A mesh of squares cut in two, with vertices place(x, y), x and y in squares."""
    y, x = np.meshgrid(np.arange(rows + 1.0), np.arange(columns + 1.0), indexing="ij")
    a = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    F = np.concatenate([np.stack([a, a + 1, a + columns + 2], 1), np.stack([a, a + columns + 2, a + columns + 1], 1)])
    return np.stack(place(x.ravel(), y.ravel()), axis=1), F


def largest_turn(V, F):
    inside = np.bincount(F.ravel(), np.radians(corner_angles(Surface(V, F))).ravel())
    border = np.unique(np.concatenate(Surface(V, F).loops))
    return float(np.degrees(np.abs(np.pi - inside[border]).max()))


@pytest.mark.parametrize("metres", [1.0, 1e-3])
def test_a_disc_of_which_faces_were_deleted_gets_a_round_edge(metres):
    ragged = kept(*triangles(14, 14), lambda P: lengths(P) < 5.0)
    (loop,) = boundary_loops(ragged[1], edge_table(ragged[1]))
    assert np.ptp(lengths(ragged[0][loop])) > EDGE
    assert largest_turn(*ragged) > 100
    mesh = mended_mesh(ragged[0] / metres, ragged[1], metres)
    assert largest_turn(mesh.V, mesh.F) < np.degrees(RAGGED_TURN)
    (loop,) = boundary_loops(mesh.F, edge_table(mesh.F))
    radius = lengths(mesh.V[loop] * metres)
    assert np.ptp(radius) < 0.6 * EDGE
    assert (area_vectors(mesh.V, mesh.F)[:, 2] > 0).all()
    (told,) = mesh.repairs
    assert told.startswith("ragged edges straightened: ")
    assert told.endswith(" mm")


def test_a_hole_of_which_faces_were_deleted_keeps_its_area():
    V, F = kept(*triangles(10, 10), lambda P: lengths(P) > 1.5)
    even = even_edges(V, F)
    hole = boundary_loops(even.F, edge_table(even.F))[-1]
    area = abs(area_vectors(even.V, np.stack([np.full(len(hole) - 2, hole[0]), hole[1:-1], hole[2:]], 1))[:, 2].sum())
    before = lengths(area_vectors(V, F)).sum()
    assert even.moved >= 12
    assert lengths(area_vectors(even.V, even.F)).sum() == pytest.approx(before, rel=0.002)
    assert area / 2 == pytest.approx(np.pi * 1.5**2, rel=0.05)


def test_an_end_in_steps_is_a_straight_line_and_the_inside_stays():
    V, F = kept(*triangles(8, 6), lambda P: P[:, 0] < 2.0)
    even = even_edges(V, F)
    right = boundary_loops(even.F, edge_table(even.F))[0]
    right = right[(even.V[right, 0] > 1.5) & (np.abs(even.V[right, 1]) < 2.0)]
    assert np.ptp(even.V[right, 0]) < 1e-3
    inside = np.abs(V[:, 0]) < 1.5
    assert_array_equal(even.V[inside], V[inside])


FOLDS = squares(16, 12, lambda x, y: (0.5 * x, 0.5 * y, 0.5 * (x % 2)))
COMB = kept(*squares(48, 24, lambda x, y: (x, y, 0 * x)), lambda P: (P[:, 1] < 18) | (P[:, 0] % 6 < 3))
PLUS = kept(*squares(6, 6, lambda x, y: (x, y, 0 * x)), lambda P: (np.abs(P[:, :2] - 3) < 1).any(axis=1))
POINTS = np.exp(1j * np.pi / 12 * np.arange(24)) * (5 - np.arange(24) % 2)
STAR = (
    np.array([(0, 0, 0), *((z.real, z.imag, 0) for z in POINTS)]),
    np.array([(0, 1 + k, 1 + (k + 1) % 24) for k in range(24)]),
)


@pytest.mark.parametrize("mesh", [FOLDS, COMB, PLUS, STAR], ids=["folds", "comb", "plus", "star"])
def test_teeth_of_a_design_stay(mesh):
    even = even_edges(*mesh)
    assert even.moved == 0
    assert_array_equal(even.V, mesh[0])
    assert_array_equal(even.F, mesh[1])


def test_a_vault_that_is_ten_metres_long_stands_on_ten_metres_each_side(tmp_path):
    """And not on 15.3 m and 15.9 m, to and fro along the teeth of its mesh."""
    V, F = triangles(8, 10)
    V[:, 2] = 3.0 * (1 - (V[:, 0] / 3.2) ** 2)
    lines = [f"v {x} {y} {z}" for x, y, z in V]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in F[(V[F][:, :, 2] > 0).all(axis=1)]]
    path = tmp_path / "vault.obj"
    path.write_text("\n".join(lines))
    told = "\n".join(propose(path).lines)
    assert "ragged edges straightened" in told
    found = re.findall(r"springing line \d \(([\d.]+) m\)", told)
    assert [float(long) for long in found] == pytest.approx([10, 10], abs=0.5)


@pytest.mark.parametrize(("turns", "straight"), [(10, False), (13, True)])
def test_a_border_is_ragged_from_twelve_turns_on(turns, straight):
    """A few turns may be intended: a door has four corners, and a small opening a dozen edges."""

    def place(x, y):
        return x, y + 0.3 * (-1) ** x * ((y == 0) & (x > 5) & (x <= 5 + turns)), 0 * x

    assert (even_edges(*squares(24, 3, place)).moved > 0) == straight
