"""Raw scans become sheets: each fault that is planted is cured and told, and what is meant stays."""

import numpy as np
import pytest
from scipy.spatial import Delaunay

from dsfab.preset.file import load_preset
from dsfab.preset.proposal import propose
from dsfab.surface import Surface, is_scan, repaired_scan
from dsfab.surface.clean.borders import hole_triangles
from dsfab.surface.shapes import plate, sphere
from dsfab.surface.topology import edge_table, manifold_faults

BALL = sphere(edge=0.1)


def around(surface: Surface, at: int, radius: float) -> np.ndarray:
    """The faces farther than a radius from the middle of one."""
    away = np.linalg.norm(surface.centroids - surface.centroids[at], axis=1)
    return surface.F[away > radius]


def scanned(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """A ball with a hole, a fin of two faces, a speck, a face twice, one without area, and faces turned over."""
    F = around(BALL, 10, 0.03)
    a, b = F[50, :2]
    n = BALL.n
    V = np.vstack([BALL.V, 1.2 * BALL.V[[a, b]], BALL.V[F[0]] * 0.01 + [0, 0, 3]])
    F = np.vstack([F, [[a, b, n], [b, n, n + 1], [n + 2, n + 3, n + 4]], F[5:6], [[F[6, 0], F[6, 1], F[6, 1]]]])
    over = np.random.default_rng(seed).random(len(F)) < 0.3
    F[over] = F[over][:, ::-1]
    return V, F


def test_a_scan_of_a_ball_becomes_a_ball():
    mesh = repaired_scan(*scanned())
    told = "; ".join(mesh.repairs)
    for words in (
        "without area",
        "on top of other faces",
        "faces separated at 1 edge with more than two faces",
        "2 small pieces dropped",
    ):
        assert words in told
    assert "faces of" in told and "turned over" in told and "1 hole filled with" in told  # noqa: PT018
    assert manifold_faults(mesh.F, edge_table(mesh.F), len(mesh.V)) == ()
    ball = Surface(mesh.V, mesh.F)
    assert ball.is_closed
    assert abs(ball.volume) == pytest.approx(BALL.volume, rel=2e-3)


def test_openings_that_are_meant_stay():
    wide = around(BALL, 10, 0.4)
    assert repaired_scan(BALL.V, wide).repairs == ()
    flat = plate(edge=0.25)
    assert repaired_scan(flat.V, flat.F).repairs == ()


def noisy(noise: float, points: int = 4500) -> tuple[np.ndarray, np.ndarray]:
    """A vault of 4 m x 4 m through points at random, each off by some metres."""
    rng = np.random.default_rng(2)
    plan = rng.uniform(-2, 2, (points, 2))
    V = np.c_[plan, 1 - 0.2 * plan[:, 0] ** 2] + rng.normal(0, noise, (points, 3))
    return V, Delaunay(plan).simplices


def bends(V: np.ndarray, F: np.ndarray) -> np.ndarray:
    """Degrees between neighbouring faces."""
    surface = Surface(V, F)
    one, two = surface.normals[surface.edges.pairs.T // 3]
    return np.degrees(np.arccos(np.clip((one * two).sum(axis=1), -1, 1)))


def test_faces_that_noise_folded_over_are_flattened():
    """Its solid was refused for bending too sharply, in a place where nothing bends."""
    V, F = noisy(0.002)
    assert (bends(V, F) > 90).sum() > 30
    assert is_scan(V, F)
    assert not is_scan(*noisy(0.0))
    mesh = repaired_scan(V, F)
    assert "that noise in the mesh had folded or tilted" in mesh.repairs[-1]
    assert (bends(mesh.V, mesh.F) > 90).sum() < 5
    assert len(mesh.F) > 0.95 * len(F)
    assert np.abs(mesh.V[:, 2] - (1 - 0.2 * mesh.V[:, 0] ** 2)).max() < 0.012
    assert manifold_faults(mesh.F, edge_table(mesh.F), len(mesh.V)) == ()
    assert Surface(mesh.V, mesh.F).area == pytest.approx(Surface(*noisy(0.0)).area, rel=0.01)


def test_sharp_creases_are_not_noise():
    """A roof whose ridge turns by 120 degrees, finely meshed."""
    flat = plate(edge=0.04)
    fold = np.c_[flat.V[:, 0], flat.V[:, 1], np.sqrt(3) * np.abs(flat.V[:, 0] - flat.V[:, 0].mean())]
    assert not is_scan(fold, flat.F)
    assert repaired_scan(fold, flat.F).repairs == ()


def test_balls_that_touch_in_a_point_come_apart():
    V = np.vstack([BALL.V, BALL.V + 2 * BALL.V[0]])
    other = BALL.F + BALL.n
    opposite = int(np.linalg.norm(V[BALL.n :] - BALL.V[0], axis=1).argmin())
    other[other == BALL.n + opposite] = 0
    mesh = repaired_scan(V, np.vstack([BALL.F, other]))
    assert mesh.repairs == ("1 point between touching parts split",)
    assert Surface(mesh.V, mesh.F).pieces[0] == 2


@pytest.mark.parametrize("corners", [3, 4, 7, 20])
def test_a_flat_outline_is_filled_with_its_area(corners):
    turn = 2 * np.pi * np.arange(corners) / corners
    P = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1) * np.where(np.arange(corners) % 2, 1.0, 0.6)[:, None]
    T = hole_triangles(P, np.zeros((corners, corners), dtype=bool))
    assert len(T) == corners - 2
    signed = np.cross(P[T[:, 1]] - P[T[:, 0]], P[T[:, 2]] - P[T[:, 0]])[:, 2] / 2
    x, y = P[:, :2].T
    assert signed.sum() == pytest.approx((x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2)
    assert (signed > 0).all()


def test_existing_edges_are_not_created_again():
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    joined = np.zeros((4, 4), dtype=bool)
    joined[0, 2] = joined[2, 0] = True
    assert {tuple(sorted(t)) for t in hole_triangles(square, joined).tolist()} == {(0, 1, 3), (1, 2, 3)}
    joined[1, 3] = joined[3, 1] = True
    assert hole_triangles(square, joined) is None


@pytest.mark.slow
def test_a_fine_mesh_with_holes_counts_as_a_scan_with_a_note(tmp_path):
    fine = sphere(edge=0.035)
    F = fine.F
    for at in (5, 4000, 9000):
        F = F[np.linalg.norm(fine.V[F].mean(axis=1) - fine.centroids[at], axis=1) > 0.04]
    assert is_scan(fine.V, F)
    assert not is_scan(fine.V, fine.F)
    assert not is_scan(*scanned())  # a coarse mesh is somebody's model
    path = tmp_path / "scan.obj"
    lines = [*("v {:.9g} {:.9g} {:.9g}".format(*v) for v in fine.V), *("f {} {} {}".format(*(f + 1)) for f in F)]
    path.write_text("\n".join(lines) + "\n")
    proposal = propose(path, "m", "z")
    told = {each.topic: each for each in proposal.decisions}["mended"]
    assert told.choice.startswith("as a raw scan: 3 holes filled")
    assert told.change == "surface.repair"
    (tmp_path / "scan.toml").write_text(proposal.text())
    again = load_preset(tmp_path / "scan.toml")
    assert again.surface.repair
    assert again.surface.base_surface().is_closed
