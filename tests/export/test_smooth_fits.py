"""What smooth STEP computes many at once says the same as one by one, by other roads."""

import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.sparse import csc_array, diags_array
from scipy.sparse.linalg import spsolve

from dsfab.core.arrays import plane_cross
from dsfab.export import splines
from dsfab.export.cad.step.entities import StepEntities, step_list
from dsfab.export.cad.step.shared.skins import prisms
from dsfab.export.cad.step.smooth import chart_fields, charts
from dsfab.export.cad.step.smooth.edges import by_chart
from dsfab.export.cad.step.smooth.solid import crossing_chords
from dsfab.export.cad.step.worker.reports import distinct_points
from dsfab.export.splines import splines_through
from dsfab.surface.shapes.round_shapes import sphere
from dsfab.surface.topology import edge_table, faces_at
from tests.shapes import grid


def wavy(rng, count, d=2):
    """Samples of so many curves, each with its own number of them and waves of its own."""
    for c in range(count):
        x = np.unique(np.r_[0.0, rng.random(int(rng.integers(30, 400))), 1.0])
        wave = rng.normal(size=d) * [0.0, 1e-3, 1.0][c % 3]
        yield x, 100 * np.outer(x, rng.normal(size=d)) + np.outer(np.sin(rng.integers(1, 25) * x), wave)


def spline_through(x, Q, tolerance, parts=1):
    """One curve."""
    return splines_through([(x, Q)], [tolerance], parts)[0]


@pytest.mark.parametrize("at_once", [1, 2000])
def test_curves_fitted_together_equal_curves_fitted_alone(monkeypatch, at_once):
    rng = np.random.default_rng(0)
    samples = list(wavy(rng, 40, 6))
    wanted = 10 ** rng.uniform(-4, 0, len(samples))
    monkeypatch.setattr(splines, "AT_ONCE", at_once)
    for (x, Q), tolerance, (curve, off) in zip(samples, wanted, splines_through(samples, wanted, 2), strict=True):
        alone, far = spline_through(x, Q, tolerance, 2)
        assert (curve.degree, curve.knots.tolist()) == (alone.degree, alone.knots.tolist())
        assert curve.poles == pytest.approx(alone.poles, abs=1e-9)
        assert off == pytest.approx(far, abs=1e-9)
        away = np.linalg.norm((curve(x) - Q).reshape(-1, 2, 3), axis=2).max()
        assert off == pytest.approx(away, abs=1e-9)


def test_fitted_cubics_are_least_squares_solutions_with_fixed_ends():
    """Least squares with full tables of hats, of which the poles between the ends are free."""
    samples = list(wavy(np.random.default_rng(1), 30))
    found = splines_through(samples, [1e-3] * len(samples))
    cubics = [(x, Q, curve) for (x, Q), (curve, _) in zip(samples, found, strict=True) if curve.degree == 3]
    assert len(cubics) > 5
    assert max(len(curve.poles) for *_, curve in cubics) > 10
    for x, Q, curve in cubics:
        hats = BSpline.design_matrix(x, curve.knots, 3).toarray()
        rest = Q - hats[:, [0, -1]] @ Q[[0, -1]]
        free = np.linalg.lstsq(hats[:, 1:-1], rest, rcond=None)[0]
        assert curve.poles == pytest.approx(np.vstack([Q[0], free, Q[-1]]), abs=1e-5)


def test_samples_of_a_polyline_are_even_and_their_number_is_a_power_of_two():
    for n in (2, 3, 5, 17, 300):
        line = np.random.default_rng(n).random((n, 2))
        x, Q = splines.even_samples(line)
        assert len(x) - 1 == 2 ** np.ceil(np.log2(np.clip(16 * n, 64, 4096)))
        length = np.r_[0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))]
        assert pytest.approx(np.c_[[np.interp(x * length[-1], length, c) for c in line.T]].T) == Q


@pytest.mark.parametrize(("p", "q"), [(6, 6), (6, 9), (11, 7)])
def test_poles_of_a_surface_solve_the_normal_equations_of_all_points(p, q):
    """Among them squared second differences of the poles, so many times as many as points per pole."""
    rng, smoothing = np.random.default_rng(0), 0.1
    uv, Q, weight = rng.random((400, 2)), rng.random((400, 6)), rng.random(400)
    patch, there = charts.patch_through(uv, Q, weight, (p, q), smoothing)
    u, v = (BSpline.design_matrix(uv[:, k], knots, 3).toarray() for k, knots in enumerate((patch.u, patch.v)))
    A, one = np.einsum("kp,kq->kpq", u, v).reshape(-1, p * q), np.eye(p * q).reshape(p, q, -1)
    differences = (np.diff(one, 2, axis=0), np.diff(one, 2, axis=1), np.diff(np.diff(one, axis=0), axis=1))
    rough = sum(many * np.einsum("pqi,pqj->ij", D, D) for D, many in zip(differences, (1, 1, 2), strict=True))
    matrix = A.T @ (weight[:, None] * A) + smoothing * len(uv) / (p * q) * rough
    poles = patch.poles.reshape(p * q, -1)
    assert poles == pytest.approx(np.linalg.solve(matrix, A.T @ (weight[:, None] * Q)))
    assert there == pytest.approx(A @ poles)


def test_nearest_points_of_many_are_those_of_each():
    rng = np.random.default_rng(0)
    uv = rng.uniform(-1, 1, (500, 2))
    patch, _ = charts.patch_through(uv, np.c_[uv, 0.3 * uv[:, 0] ** 2], np.ones(500), (8, 8), 1e-9)
    at = rng.uniform(-0.9, 0.9, (40, 2))
    P = np.c_[at, 0.3 * at[:, 0] ** 2 + rng.uniform(-0.2, 0.2, 40)]
    found = patch.nearest(P, at)
    assert found == pytest.approx(np.concatenate([patch.nearest(P[[k]], at[[k]]) for k in range(40)]))
    there, a, b = patch.slopes(found)
    inside = np.abs(found).max(axis=1) < 0.95
    assert inside.sum() > 30
    for slope in (a, b):
        assert np.einsum("ki,ki->k", P - there, slope)[inside] == pytest.approx(0, abs=1e-7)


def test_each_chart_is_fitted_once_for_all_its_rows():
    calls = []
    rows = [np.full((n, 2), n) for n in (1, 3, 2, 4)]
    said = by_chart([5, 2, 5, 2], rows, lambda k, x: calls.append((k, len(x))) or k * x)
    assert calls == [(5, 3), (2, 7)]
    assert [one.tolist() for one in said] == [(k * x).tolist() for k, x in zip([5, 2, 5, 2], rows, strict=True)]


def test_merged_points_are_numpys_unique_rows():
    rng = np.random.default_rng(0)
    for P in (
        rng.integers(-2, 3, (500, 3)).astype(np.float32),
        np.zeros((0, 3)),
        np.array([[0.0, 1, 2], [-0.0, 1, 2]]),
    ):
        V, number = distinct_points(P)
        wanted, inverse = np.unique(P, axis=0, return_inverse=True)
        assert V.tolist() == wanted.tolist()
        assert number.tolist() == inverse.ravel().tolist()
        assert np.array_equal(V[number], P)


def test_edges_of_faces_are_numpys_unique_rows():
    F = sphere(edge=0.4).F
    pairs = np.sort(F[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    assert edge_table(F).ends.tolist() == np.unique(pairs, axis=0).tolist()


def test_faces_at_marked_vertices_have_a_marked_corner():
    surface = grid(5, 4, 1.0, 1.0)
    for marks in (np.arange(surface.n) % 7 == 0, np.zeros(surface.n, dtype=bool)):
        assert faces_at(surface.F, marks).tolist() == [bool(marks[face].any()) for face in surface.F]


def test_points_are_written_as_lists_are():
    rng = np.random.default_rng(0)
    P = np.concatenate([rng.normal(size=(50, 3)) * 10.0 ** rng.integers(-8, 4, (50, 1)), [[-1e-9, 100, 0.5]]])
    new = StepEntities()
    numbers = list(new.points(P, 5))
    wanted = [f"CARTESIAN_POINT('',{step_list(p, 5)})" for p in P]
    assert [new.text[k - numbers[0]] for k in numbers] == [
        f"#{k}={one};\n" for k, one in zip(numbers, wanted, strict=True)
    ]
    assert len(new.text) == len(set(wanted)) < len(P)


def test_prism_volumes_agree_with_an_exact_quadrature():
    V, D = np.random.default_rng(0).normal(size=(2, 30, 3))
    F = np.random.default_rng(1).permutation(30).reshape(-1, 3)
    total = np.zeros(len(F))
    for s, weight in zip(*np.polynomial.legendre.leggauss(3), strict=True):
        a, b, c = np.moveaxis((V + s * D)[F], 1, 0)
        total += weight * np.einsum("mi,mi->m", np.cross(b - a, c - a) / 2, D[F].mean(axis=1))
    assert prisms(V, D, F) == pytest.approx(total)


def test_crossing_chords_equal_those_of_a_search_over_all_pairs():
    """Chords of very different lengths; two in five begin where another one ends."""
    rng = np.random.default_rng(0)
    start = rng.random((200, 2))
    end = start + rng.normal(size=(200, 2)) * 10.0 ** rng.uniform(-3, 0, (200, 1))
    start[:80] = end[80:160]
    pairs = np.array([(i, j) for i in range(200) for j in range(i + 1, 200)]).T
    apart = [np.linalg.norm(a[pairs[0]] - b[pairs[1]], axis=1) > 0 for a in (start, end) for b in (start, end)]
    pairs = pairs[:, np.all(apart, axis=0)]
    sides = [
        plane_cross(end[a] - start[a], start[b] - start[a]) * plane_cross(end[a] - start[a], end[b] - start[a])
        for a, b in (pairs, pairs[::-1])
    ]
    crossing = {tuple(pair) for pair in pairs[:, np.maximum(*sides) < 0].T.tolist()}
    assert len(crossing) > 50
    assert {tuple(sorted(pair)) for pair in crossing_chords(start, end).tolist()} == crossing


def test_the_face_nearest_to_the_middle_of_each_cluster():
    surface = grid(6, 4, 3.0, 2.0)
    label = np.arange(surface.m) % 3
    found = chart_fields.middle_faces(surface, label)
    assert label[found].tolist() == [0, 1, 2]
    for k, f in enumerate(found):
        mine = label == k
        middle = np.average(surface.centroids[mine], axis=0, weights=surface.areas[mine])
        away = np.linalg.norm(surface.centroids - middle, axis=1)
        assert away[f] == pytest.approx(away[mine].min())


def test_fields_that_did_not_move_are_those_solved_again():
    surface = sphere(edge=0.3)
    label = np.argmax(surface.centroids @ np.vstack([np.eye(3), -np.eye(3)]).T, axis=1)
    fields = chart_fields.diffused_fields(surface, label, 1.0)
    mass, stiffness = chart_fields.voronoi_mass(surface), -chart_fields.igl.cotmatrix(surface.V, surface.F)
    radius = np.sqrt(np.bincount(label, surface.areas) / np.pi)
    reach = chart_fields.REACH * max(np.percentile(radius, 10), 4 * surface.mean_edge)
    load = np.stack(
        [np.bincount(surface.F.ravel(), np.repeat((label == k) * surface.areas / 3, 3)) for k in range(6)], 1
    )
    for _ in range(chart_fields.SWEEPS):
        wanted = spsolve(csc_array(diags_array(mass) + reach**2 * stiffness), load)
        load = mass[:, None] * (wanted.argmax(axis=1)[:, None] == np.arange(6))
    assert fields == pytest.approx(wanted, abs=1e-9)


def tried(monkeypatch, side, offs, stretch=(1.0, 1.0), **how):
    """What `fitted` answers about side x side points of which attempts are off by so many tolerances, and their poles.

    A point that is not inside is off by far more, and the first of the two points of each row by half as much.
    """
    uv = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2) / (side - 1) * stretch
    Q, weight, inside = np.zeros((len(uv), 6)), np.ones(len(uv)), np.ones(len(uv), dtype=bool)
    inside[0] = False
    counts, left = [], list(offs)

    def through(_uv, _Q, given, count, smoothing):
        assert given is weight
        assert smoothing == charts.SMOOTHING
        counts.append(count)
        found, off = Q.copy(), left.pop(0) / 2
        found[7] += off * np.array([0.0, 0.3, 0.4, 0.6, 0.0, 0.8])
        found[0] += 100.0
        return None, found

    monkeypatch.setattr(charts, "patch_through", through)
    fit = charts.fitted_surface(uv, Q, inside, weight, 0.5, **how)
    assert left == []
    assert fit.off == offs[-1] / 2
    return counts, fit


def test_the_number_of_poles_grows_with_the_fourth_root_of_the_deviation(monkeypatch):
    """Twice as many at most, 1.15 times at least, 1.05 times what the root says between; what is just near enough is
    taken."""
    counts, fit = tried(monkeypatch, 100, [16.0, 2.0, 1.001, 1.0])
    assert counts == [(8, 8), (16, 16), (20, 20), (23, 23)]
    assert fit.size == pytest.approx(16 * 1.05 * 2**0.25 * 1.15)
    assert not fit.starved
    assert tried(monkeypatch, 100, [1.0], first_poles=11.0)[0] == [(11, 11)]


@pytest.mark.parametrize(
    ("side", "how", "poles", "starved"),
    [
        (100, {"most_poles": 20}, [8, 16, 20], False),  # no more are allowed
        (32, {}, [8, 16, 20], True),  # 1024 points are for 20.2 poles each way
        (16, {"first_poles": 30.0}, [10], True),
        (16, {"most_poles": 10}, [8, 10], False),
    ],
)
def test_the_number_of_poles_grows_up_to_the_limit_and_the_number_of_points(monkeypatch, side, how, poles, starved):
    counts, fit = tried(monkeypatch, side, [1e6] * len(poles), **how)
    assert counts == [(n, n) for n in poles]
    assert fit.starved == starved
    assert fit.size == min(np.sqrt(side**2 / 2.5), how.get("most_poles", 48))


@pytest.mark.parametrize(
    ("stretch", "poles"),
    [((4.0, 1.0), (16, 6)), ((1.0, 2.0), (6, 11)), ((1000.0, 1.0), (25, 6)), ((1.0, 1000.0), (6, 25))],
)
def test_poles_have_equal_distances_in_both_directions_up_to_ten_to_one(monkeypatch, stretch, poles):
    assert tried(monkeypatch, 100, [0.5], stretch)[0] == [poles]
