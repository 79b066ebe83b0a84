"""Shear recovered from moments: closed forms and their rates, ribs of two faces, splinters, folds, and sides."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from dsfab.statics import Elements, ShearRecovery, section_forces
from dsfab.surface import Surface
from dsfab.surface.fields import hat_gradients, tangents
from tests.members.loaded_shells import carried, forces_of, short_tube
from tests.shapes import ZOO, disc, grid, jittered, moebius, tube, windows, with_mixed_corners
from tests.statics.stresses import BEST, H, solved
from tests.statics.supports import hold, order, rim

CONSTANT = Elements("quadratic", "midedge")


def in_space(found):
    """(m, 3) the vector q of each face."""
    return np.einsum("ma,max->mx", found.q, found.frame)


def error(s, vectors, exact):
    """The root of the mean square over the sheet, over that of the exact field."""
    exact = np.broadcast_to(exact, vectors.shape)
    return np.sqrt(s.areas @ ((vectors - exact) ** 2).sum(axis=1) / (s.areas @ (exact**2).sum(axis=1)))


def naviers_shear(x, y, terms=80):
    """(k, 3) q of a supported unit plate under 1 kPa downwards: -D grad laplace w, term by term [Navier 1823]."""
    m = np.arange(1, 2 * terms, 2) * np.pi
    each = 16e3 / (m[:, None] * m * (m[:, None] ** 2 + m**2))
    ways = (m[:, None] * each, np.cos, np.sin), (m * each, np.sin, np.cos)
    across = [np.einsum("ij,ik,jk->k", a, f(np.outer(m, x)), g(np.outer(m, y))) for a, f, g in ways]
    return np.stack([*across, 0 * x], axis=1)


def test_a_supported_plate_has_naviers_shear_everywhere():
    errors = []
    for cells in (8, 16, 32):
        s = jittered(grid(cells, cells, 1.0, 1.0))
        found = forces_of(s, hold(s, (np.ones(s.n, dtype=bool), "xy"), (rim(s), "z")), face=(0, 0, -1e3))
        errors.append(error(s, in_space(found), naviers_shear(*s.centroids[:, :2].T)))
    assert order(errors) > 1.3
    assert errors[-1] < 3.5e-3


def test_a_clamped_disc_has_half_of_pressure_times_radius():
    """q = p r / 2 by equilibrium alone."""
    errors = []
    for cells in (8, 16, 32):
        s = disc(cells)
        fixed = hold(s, (np.ones(s.n, dtype=bool), "xy"), (rim(s), "z"))
        found = forces_of(s, fixed, face=(0, 0, -1e3), clamped=s.edges.boundary)
        errors.append(error(s, in_space(found), -500 * s.centroids))
    assert order(errors) > 1.5
    assert errors[-1] < 2e-3


def test_a_tube_pressed_apart_at_its_rim_has_the_shear_of_its_edge_zone():
    """q = F exp(-b z) (cos b z - sin b z), b^4 = 3 (1 - nu^2) / (R h)^2 [Timoshenko and Woinowsky-Krieger, 114]."""
    s, thickness = tube(48, 24, 1.0, 0.6), 0.02
    top = s.V[:, 2] > 0.6 - 1e-9
    out = s.V[s.edges.ends].mean(axis=1) * (1, 1, 0)
    edge = (top[s.edges.ends].all(axis=1) & s.edges.boundary)[:, None] * 1e3 * out
    fixed = hold(s, (s.V[:, 2] < 1e-9, "z"), (np.abs(s.V[:, 1]) < 1e-9, "y"), (np.abs(s.V[:, 0]) < 1e-9, "x"))
    found = forces_of(s, fixed, edge=edge, thickness=thickness)
    b, z = (3 * (1 - 0.3**2)) ** 0.25 / thickness**0.5, 0.6 - s.centroids[:, 2]
    exact = np.exp(-b * z) * (np.cos(b * z) - np.sin(b * z)) * 1e3
    assert error(s, in_space(found)[:, 2:], -exact[:, None]) < 0.04


@pytest.mark.parametrize("elements", [BEST, CONSTANT], ids=str)
def test_all_shear_passes_through_ribs_of_a_few_faces(elements):
    """Slopes of averaged moments lost 4 to 40 % of it there: sections across a plate with windows, on one edge."""
    s = jittered(windows())
    held = s.V[:, 0] < 1e-9
    found = forces_of(s, hold(s, (held, "xyz")), elements, face=(0, 0, -1e3), clamped=held[s.edges.ends].all(axis=1))
    for low, high in ((0.1, 0.3), (0.3, 0.35), (0.7, 0.75), (0.55, 0.95)):
        phi = np.clip((s.V[s.F][:, :, 0] - low) / (high - low), 0, 1).mean(axis=1)
        assert carried(s, found, 0, low, high)[2] == pytest.approx(-1e3 * s.areas @ phi, rel=1e-4)


def with_splinters(s, share=0.02):
    """A point on every seventh inner edge, right beside its begin: two faces become four, two of them splinters."""
    a, b = s.edges.pairs.T[:, ::7]
    alone = ~np.isin(a // 3, b // 3)
    faces = np.concatenate([a // 3, b // 3])
    single = np.bincount(faces, minlength=s.m) == 1
    a, b = (h[alone & single[a // 3] & single[b // 3]] for h in (a, b))
    V, F, new = [s.V], [np.delete(s.F, np.concatenate([a // 3, b // 3]), axis=0)], s.n + np.arange(len(a))
    begin, end = s.F.ravel()[a], np.roll(s.F, -1, axis=1).ravel()[a]
    V.append((1 - share) * s.V[begin] + share * s.V[end])
    for h, first, last in ((a, begin, end), (b, end, begin)):
        apex = np.roll(s.F, -2, axis=1).ravel()[h]
        F += [np.stack([first, new, apex], axis=1), np.stack([new, last, apex], axis=1)]
    return Surface(np.concatenate(V), np.concatenate(F))


def test_errors_of_moments_on_splinters_show_little_in_the_shear():
    """m_x = x, so q_x = 1, and noise on splinters alone, a tenth as large: .8 of shear on all faces, not 10."""
    s = with_splinters(jittered(grid(16, 16, 1.0, 1.0)))
    a, b = tangents(s)[:, :, 0].T
    moments = s.V[s.F][:, :, :1] * np.stack([a * a, b * b, a * b], axis=1)[:, None]
    splinter = s.areas < 0.1 * np.median(s.areas)
    assert splinter.sum() > 100
    noise = np.random.default_rng(1).normal(0, 0.1, moments.shape) * splinter[:, None, None]
    recovery = ShearRecovery.for_surface(s)
    assert error(s, recovery.forces(moments, moments), np.array([[1.0, 0, 0]])) < 0.02
    found = recovery.forces(noise, 0 * noise)
    assert np.sqrt(s.areas @ (found**2).sum(axis=1)) < 1.5
    assert np.abs(found).max() < 15


def test_a_face_that_is_turned_over_has_its_shear_with_the_other_sign():
    s = with_splinters(jittered(grid(6, 6, 1.0, 1.0)))
    fixed = hold(s, (np.ones(s.n, dtype=bool), "xy"), (rim(s), "z"))
    turned = with_mixed_corners(s)
    side = np.sign(turned.normals[:, 2])[:, None]
    assert (side < 0).any()
    known, other = (in_space(forces_of(one, fixed, face=(0, 0, -1e3))) for one in (s, turned))
    assert_allclose(side * other, known, atol=1e-3)


def test_a_strip_without_two_sides_has_shear_of_one_size_on_both():
    s = moebius(24, 3)
    _, stress = solved(s, hold(s, (s.V[:, 0] > s.V[:, 0].max() - 0.3, "xyz")), BEST, face=(0, 0, -1e3))
    known = in_space(section_forces(s, H, stress))
    turned = with_mixed_corners(s)
    _, stress = solved(turned, hold(s, (s.V[:, 0] > s.V[:, 0].max() - 0.3, "xyz")), BEST, face=(0, 0, -1e3))
    side = np.sign(np.einsum("mx,mx->m", s.normals, turned.normals))[:, None]
    assert_allclose(side * in_space(section_forces(turned, H, stress)), known, atol=1e-3 * np.abs(known).max())


def slopes(s, found):
    """(m, 2) q as the slope of moments averaged at vertices: right where faces all around are of one smooth part."""
    slope = np.einsum("mck,mak->mca", hat_gradients(s), found.frame)
    dx, dy = np.einsum("mca,mci->ami", slope, found.corner_moments)
    return np.stack([dx[:, 0] + dy[:, 2], dx[:, 2] + dy[:, 1]], axis=1)


def test_the_moment_sum_is_not_the_same_on_both_sides_of_a_fold():
    """An angle that spans 1 m: its upright bends in its plane, the other side is bent along with it."""
    flat = grid(24, 16, 1.0, 0.5)
    x, y = flat.V[:, 0], flat.V[:, 1]
    s = Surface(np.stack([x, np.minimum(y, 0.25), np.maximum(y - 0.25, 0)], axis=1), flat.F)
    upright, middle = s.centroids[:, 2] > 1e-9, np.abs(s.centroids[:, 0] - 0.5) < 0.25
    fixed = hold(s, ((x < 1e-9) | (x > 1 - 1e-9), "yz"), (x < 1e-9, "x"))
    found = forces_of(s, fixed, face=upright[:, None] * np.array([0, 0, -1e5]))
    for side in (upright & (s.centroids[:, 2] > 0.05), ~upright & (s.centroids[:, 1] < 0.2)):
        one, other = (np.sqrt((q[side & middle] ** 2).mean()) for q in (found.q, slopes(s, found)))
        assert one == pytest.approx(other, rel=0.04)


@pytest.mark.parametrize("name", ZOO)
def test_moments_without_slope_have_no_shear(name):
    """All of a zoo: closed, open, in pieces, obtuse, tiny, huge. A tube under pressure is near to it too."""
    s = ZOO[name]()
    found = ShearRecovery.for_surface(s).forces(np.zeros((s.m, 3, 3)), np.zeros((s.m, 3, 3)))
    assert found.shape == (s.m, 3)
    assert not found.any()


def test_a_tube_that_is_stretched_all_around_has_little_shear():
    s, fixed, out = short_tube()
    found = forces_of(s, fixed, face=1e4 * out)
    assert np.sqrt(s.areas @ (found.q**2).sum(axis=1) / s.areas.sum()) < 200  # of 1e4 N/m around
