"""What the speed of the statics rests on, without a clock: few passes, exact assembly, parts that are measured."""

import json
import weakref
from functools import partial

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.sparse import coo_array, csr_array, diags_array

from dsfab.app import bench
from dsfab.core import sparse
from dsfab.core.errors import DsfabError
from dsfab.statics import (
    PAPER,
    Elements,
    SheetModel,
    bending_stiffness,
    factorisation,
    membrane_stiffness,
    sheet_stiffness,
)
from dsfab.statics.elements import assemble_blocks, edge_frames
from dsfab.statics.factorisation import refined_solution, stiffness_factor
from tests.shapes import ZOO, zoo
from tests.statics.load_cases import STEEL

PAIRS = ["constant+hinge", "quadratic+midedge", "quadratic+hhj"]


@zoo
def test_blocks_are_summed_as_triplets_are(name):
    surface = ZOO[name]()
    elements = Elements.from_name("quadratic+hhj")
    columns = elements.columns(surface, "normal", "rotation", "slope")
    blocks = np.random.default_rng(0).standard_normal((surface.m, 18, 18))
    size = elements.unknowns(surface)
    row, column = np.repeat(columns, 18, axis=1).ravel(), np.tile(columns, (1, 18)).ravel()
    expected = coo_array((blocks.ravel(), (row, column)), shape=(size, size)).tocsr()
    assert abs(assemble_blocks(blocks, columns, size) - expected).max() <= 1e-14 * abs(expected).max()


@pytest.mark.parametrize("pair", PAIRS)
def test_the_factored_stiffness_is_the_scaled_part_that_moves(pair):
    surface = ZOO["dome"]()
    elements = Elements.from_name(pair)
    K = membrane_stiffness(surface, STEEL, 0.02, elements=elements) + bending_stiffness(surface, STEEL, 0.02, elements)
    held = np.zeros(K.shape[0], dtype=bool)
    held[: 3 * surface.n] = np.repeat(surface.V[:, 2] < 1e-9, 3)
    factor = stiffness_factor(surface, K, held)
    free = np.flatnonzero(~held)
    scale = diags_array(1 / np.sqrt(K.diagonal()[free]))
    expected = csr_array(scale @ K[free][:, free] @ scale)
    assert np.array_equal(factor.free, free)
    b = np.random.default_rng(0).standard_normal((len(free), 2))
    assert_allclose(factor.map @ b, expected @ b, atol=1e-12)
    assert_allclose(factor.map @ factor.solve(b), b, atol=1e-7)


def test_edge_frames_are_computed_once_and_cannot_be_changed():
    surface = ZOO["saddle"]()
    assert edge_frames(surface) is edge_frames(surface)
    with pytest.raises(ValueError, match="read-only"):
        edge_frames(surface)[0] = 0
    assert edge_frames(ZOO["saddle"]()) is not edge_frames(surface)


def true_residual(long, solver, b, x):
    r = (b - long @ x.astype(np.longdouble)).astype(np.float64)
    return r, solver(r)


def test_iterative_refinement_exceeds_double_precision():
    """Condition 1e11, in the norm of the energy."""
    if np.finfo(np.longdouble).eps > 1e-17:
        pytest.skip("this machine has no numbers longer than double")
    rng = np.random.default_rng(0)
    Q = np.linalg.qr(rng.standard_normal((40, 40)))[0]
    K = csr_array(Q @ np.diag(np.logspace(-11, 0, 40)) @ Q.T)
    K = csr_array((K + K.T) / 2)
    solver = sparse.factorise(K, rng.random((40, 3)), solver="multifrontal")
    b = rng.standard_normal((40, 2))
    plain = solver(b)
    plain += solver(b - K @ plain)  # a step of refinement with a residual in double precision
    x, residual = refined_solution(K, b, solver)
    long = K.astype(np.longdouble)
    off, told = (
        np.sqrt(np.abs((r * step).sum(axis=0)) / (b * y).sum(axis=0))
        for y in (plain, x)
        for r, step in [true_residual(long, solver, b, y)]
    )
    assert residual.shape == (2,)
    assert_allclose(residual, told, rtol=1e-6)
    assert (residual <= 1e-8).all()
    assert (off > 10 * residual).all()
    assert np.array_equal(x.shape, b.shape)


def test_longer_numbers_are_made_of_a_few_rows_at_a_time(monkeypatch):
    monkeypatch.setattr(factorisation, "ROWS", 7)
    rng = np.random.default_rng(0)
    K, free, scale = csr_array(rng.random((30, 30)) / 3), np.arange(1, 30, 2), rng.random(15)
    long, x = factorisation.ScaledStiffness(K, free, scale).astype(np.longdouble), rng.random((15, 2))
    full = np.zeros((30, 2))
    full[free] = scale[:, None] * x
    exact = scale[:, None] * (K.astype(np.longdouble) @ full)[free]
    assert (long @ x).dtype == np.longdouble
    assert np.array_equal(long @ x, exact)
    assert long.K is K


def test_good_solutions_are_solved_for_twice_only():
    K = csr_array(diags_array(np.arange(1.0, 5.0)))
    calls = []

    def exact(b):
        calls.append(b)
        return b / np.arange(1.0, 5.0)

    x, residual = refined_solution(K, np.ones(4), exact)
    assert_allclose(x, 1 / np.arange(1.0, 5.0))
    assert residual < 1e-15
    assert len(calls) == 2


@pytest.mark.slow
def test_bench_measures_the_parts_of_the_statics(capsys):
    code = bench.bench("dome", work=bench.Workload(vertices="150,300", stages="statics"), repeat=1, json_=True)
    small, large = json.loads(capsys.readouterr().out)
    assert code == 0
    assert small["vertices"] < 220 < large["vertices"] < 450
    parts = [large[row] for row in ("assembly", "factor", "solve", "stress")]
    assert sum(parts) == pytest.approx(large["total"], abs=1e-3)
    assert min(parts) > 0
    assert large["compliance"] > 0


@pytest.mark.parametrize("text", ["many", "10", "1000,,2000"])
def test_bench_refuses_an_invalid_list_of_sizes(text):
    with pytest.raises(DsfabError, match="--vertices"):
        bench.bench("dome", work=bench.Workload(vertices=text, stages="statics"))


def test_the_factor_takes_its_memory_when_the_scaled_copy_is_gone(monkeypatch):
    """Nothing but the solver's own triangle is alive while it factorises: neither its matrix nor what made it."""
    solver = pytest.importorskip("pypardiso").PyPardisoSolver
    surface = ZOO["dome"]()
    alive, made = [], []
    factorise, set_phase = factorisation.factorise, solver.set_phase

    def restricted(make):
        matrix = make()
        made.append(weakref.ref(matrix))
        return matrix

    def watched(self, phase):
        alive.append((phase, sum(matrix() is not None for matrix in made)))
        set_phase(self, phase)

    monkeypatch.setattr(factorisation, "factorise", lambda make, *a, **k: factorise(partial(restricted, make), *a, **k))
    monkeypatch.setattr(solver, "set_phase", watched)
    held = np.repeat(surface.V[:, 2] < 1e-9, 3)
    K = sheet_stiffness(SheetModel(surface, STEEL, 0.01), PAPER)
    found = stiffness_factor(surface, K, held)
    assert len(made) == 1
    assert [count for phase, count in alive if phase in (11, 22)] == [0, 0]
    x = np.random.default_rng(0).standard_normal((len(found.free), 2))
    scaled = diags_array(found.scale) @ K[found.free][:, found.free] @ diags_array(found.scale)
    assert_allclose(found.map @ x, scaled @ x, atol=1e-12)
    assert_allclose(found.map.astype(np.longdouble) @ x[:, 0], scaled @ x[:, 0], atol=1e-12)
