"""Creases in STEP by members: a pointed vault by closed forms, and its file by OCCT (slow)."""

import re

import numpy as np
import pytest
from scipy.sparse import csr_array

from dsfab.core.errors import ExportError
from dsfab.export import StepOptions, write
from dsfab.export.cad.step.by_members.regions import net_of
from dsfab.export.cad.step.shared.lifting import CreaseSides, crease_edges, ends_of_rows
from dsfab.surface import SHAPES, Surface
from tests.export.member_networks import T, draft_of, lifting_of, striped

RADIUS, STEEP = 2.0, np.deg2rad(60.0)


def pointed_vault(columns: int = 12, rows: int = 6) -> Surface:
    """Two arcs of 60 degrees and a radius of 2 m that meet in a ridge, 1 m long; their diagonals all go one way."""
    s, x = np.meshgrid(np.linspace(-1, 1, 2 * columns + 1), np.linspace(0, 1, rows + 1), indexing="ij")
    angle = (1 - np.abs(s)) * STEEP
    y = np.sign(s) * RADIUS * (np.cos(angle) - np.cos(STEEP))
    V = np.stack([x, y, RADIUS * np.sin(angle)], axis=2).reshape(-1, 3)
    i = np.arange(2 * columns * (rows + 1)).reshape(-1, rows + 1)[:, :-1].ravel()
    a, b, c, d = i, i + rows + 1, i + rows + 2, i + 1
    return Surface(V, np.concatenate([np.stack([a, c, b], axis=1), np.stack([a, d, c], axis=1)]))


def off(Q: np.ndarray) -> np.ndarray:
    """(k, 2) how far points on both skins of the vault are from these, metres."""
    y, z = np.abs(Q[:, [1, 4]]) / 1000, Q[:, [2, 5]] / 1000
    return np.abs(np.hypot(y + RADIUS * np.cos(STEEP), z) - RADIUS - np.array([T / 2, -T / 2]))


def over_faces(surface: Surface, seed: int = 0) -> csr_array:
    """(k, n) weights of points inside of all faces, on all edges, and at all vertices."""
    rng = np.random.default_rng(seed)
    edges, faces = surface.edges.ends, surface.F
    t, u = rng.uniform(0.1, 0.9, len(edges)), rng.dirichlet(np.ones(3), len(faces))
    parts = (
        (np.stack([t, 1 - t], axis=1), edges),
        (u, faces),
        (np.ones((surface.n, 1)), np.arange(surface.n)[:, None]),
    )
    count = np.concatenate([np.full(len(at), at.shape[1]) for _, at in parts])
    start = np.concatenate([[0], np.cumsum(count)])
    data, columns = (np.concatenate([part[i].ravel() for part in parts]) for i in (0, 1))
    return csr_array((data, columns, start), shape=(len(count), surface.n))


def test_skins_of_a_pointed_vault_converge_and_meet_in_its_ridge():
    """Their distance from two exact cylinders: with one normal at the ridge it is 5 to 7 mm in all three."""
    worst = []
    for columns in (6, 12, 24):
        given = pointed_vault(columns)
        worst.append(off(lifting_of(given).points(over_faces(given))).max())
    assert worst[2] < 0.01 * T
    assert worst[0] / worst[1] > 3
    assert worst[1] / worst[2] > 3
    at = np.flatnonzero(np.abs(given.V[:, 1]) < 1e-9)
    Q = lifting_of(given).points(csr_array(np.eye(given.n)[at])) / 1000
    exact = np.sqrt((RADIUS + np.array([T / 2, -T / 2])) ** 2 - (RADIUS * np.cos(STEEP)) ** 2)
    np.testing.assert_allclose(Q[:, [2, 5]], np.tile(exact, (len(at), 1)), atol=0.01 * T)


def test_the_ridge_alone_is_a_crease():
    """Not the edges of the arcs, those of other round shapes either; nor where sharp edges are few."""
    given = pointed_vault()
    marks = crease_edges(given)
    np.testing.assert_array_equal(marks, (np.abs(given.V[given.edges.ends, 1]) < 1e-9).all(axis=1))
    assert not crease_edges(pointed_vault(rows=5)).any()
    for name in ("dome", "torus", "tower", "catenoid", "sphere", "hypar"):
        assert not crease_edges(SHAPES[name]()).any(), name


def test_creases_continue_to_their_common_point():
    """Four of them, in the middle of an umbrella of four shells: faces there have two. They fade towards its edges."""
    x, y = np.meshgrid(np.linspace(-6, 6, 21), np.linspace(-6, 6, 21), indexing="ij")
    a, b = np.abs(x) / 6, np.abs(y) / 6
    i = np.arange(21 * 21).reshape(21, 21)[:-1, :-1].ravel()
    F = np.concatenate([np.stack([i, i + 21, i + 22], axis=1), np.stack([i, i + 22, i + 1], axis=1)])
    umbrella = Surface(np.stack([x, y, 2.2 * (a + b - a * b)], axis=2).reshape(-1, 3), F)
    ends = umbrella.V[umbrella.edges.ends[crease_edges(umbrella)]]
    on_axis = (np.abs(ends[..., :2]) < 1e-9).all(axis=1).any(axis=1)
    assert on_axis.all()
    assert (np.linalg.norm(ends[..., :2], axis=2) < 1e-9).sum() == 4
    assert 3 < np.linalg.norm(ends[..., :2], axis=2).max() < 6


def test_points_on_a_crease_have_normals_of_both_sides():
    given = pointed_vault()
    sides = CreaseSides.from_skins(lifting_of(given).skins)
    weights = over_faces(given)
    ridge = np.abs(np.asarray(weights @ given.V)[:, 1]) < 1e-9
    np.testing.assert_array_equal(sides.on_creases(weights), ridge)
    for rows in sides.rows(weights):
        np.testing.assert_array_equal(rows.sum(axis=1), weights.sum(axis=1))
        lean = np.asarray(rows @ sides.normals)[:, 1] * np.sign(np.asarray(weights @ given.V)[:, 1])
        assert (lean[~ridge] > 0).all()
    one, two = (np.asarray(rows @ sides.normals)[ridge, 1] for rows in sides.rows(weights))
    inside = np.diff(weights.indptr)[ridge] == 2
    np.testing.assert_allclose(one[inside] + two[inside], 0, atol=1e-9)
    assert (np.abs(one[inside]) > 0.4).all()


def test_points_between_two_faces_beside_a_crease_are_on_the_skins():
    """As every second sample of a straight chain there: on no side of the crease they were 9.6 mm off."""
    given = pointed_vault(columns=24, rows=12)
    one, two = given.edges.pairs.T // 3
    thirds = csr_array(
        (np.full(3 * given.m, 1 / 3), given.F.ravel(), np.arange(0, 3 * given.m + 1, 3)), shape=(given.m, given.n)
    )
    Q = lifting_of(given).points(csr_array((thirds[one] + thirds[two]) / 2))
    assert off(Q).max() < 0.01 * T


def test_regions_end_at_a_crease():
    given = pointed_vault()
    sides = CreaseSides.from_skins(lifting_of(given).skins)
    normals = lifting_of(given).skins.normals
    whole = striped(given)
    assert len(net_of(whole, given.V, normals, T).loops) == 1
    net = net_of(whole, given.V, normals, T, sides.lines_on_creases)
    assert len(net.loops) == 2
    shared = [chain for chain in net.chains.values() if chain.right >= 0]
    assert len(shared) == 1
    assert (np.abs(given.V[whole.weights.indices[shared[0].points], 1]) < 1e-9).all()


def members_over(given: Surface):
    """Two members along the vault and two across its ridge, with their crossings."""
    x, y = given.centroids[:, 0], given.centroids[:, 1]
    along, across = (x < 0.25) | (x > 0.75), np.abs(y) > 0.6
    return striped(given, along | across, (along + 2 * across).astype(np.int64))


@pytest.mark.slow
def test_a_pointed_vault_is_by_members_where_smooth_rounds_its_ridge(tmp_path):
    """Without being asked for, too: the smooth file, which else is soon made, is further off than members are."""
    given = pointed_vault(columns=12, rows=12)
    _, solid, curved = draft_of(given, members_over(given))
    said = list[str]()
    for way in ("quick", "smooth"):
        write(solid, tmp_path / f"{way}.step", step=StepOptions(way, curved=lambda: curved), note=said.append)
    assert said[0].startswith("STEP is by members")
    assert said[0].endswith("; a half-space cut valid")
    members, smooth = (float(re.search(r"at most ([\d.]+) mm", line)[1]) for line in said)
    assert members < smooth / 4


@pytest.mark.parametrize("way", ["quick", "auto"])
def test_without_a_curved_sheet_step_falls_back_to_facets(way, tmp_path, inspected, inspected_pieces):
    """As of a sheet that crosses itself: what says so ended all ways, facets too."""

    def crosses():
        raise ExportError("the sheet crosses itself, and its parts are fused there")

    _, solid, _ = draft_of(pointed_vault(4), striped(pointed_vault(4)))
    said = list[str]()
    write(solid, tmp_path / "a.step", step=StepOptions(way, curved=crosses), note=said.append)
    assert (tmp_path / "a.step").stat().st_size > 0
    assert "crosses itself" in " ".join(said)


def test_a_point_whose_third_weight_is_a_rounding_error_lies_on_an_edge():
    weights = csr_array([[0.5, 0.5 - 5e-10, 5e-10], [0.5, 0.5 - 2e-9, 2e-9]])
    low, high = ends_of_rows(weights)
    assert (low.tolist(), high.tolist()) == ([0, -1], [1, -1])
