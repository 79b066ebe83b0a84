"""The sparse solvers: every step of the ladder against a dense factorisation, and how the ladder chooses."""

import importlib.util
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse import csr_array, diags_array

from dsfab.core import sparse
from dsfab.core.sparse import (
    FactorMemoryError,
    NotPositiveDefinite,
    SamePatternFactors,
    cholesky,
    factorise,
    libraries,
    one_blas_thread,
)
from dsfab.core.sparse.cholesky import Fronts, Multifrontal, dissection_keys, point_graph
from dsfab.core.sparse.libraries import ConvergenceError, Pardiso, SuperLU
from dsfab.statics import Elements, bending_stiffness, membrane_stiffness
from dsfab.statics.boundary_conditions import rigid_motions
from dsfab.statics.factorisation import stiffness_factor
from tests.shapes import ZOO, grid, jittered, lifted, zoo
from tests.statics.load_cases import STEEL

DIRECT = ["multifrontal", "SuperLU", "PARDISO"]
direct = pytest.mark.parametrize("solver", DIRECT)


def require(solver: str) -> None:
    if solver == "PARDISO":
        pytest.importorskip("pypardiso", reason="the optional solver is not installed")


def system(surface, elements=None, shift=1e-3):
    """A positive definite matrix on a surface's points, and the point of each unknown."""
    elements = elements or Elements()
    h = 0.01 * surface.size
    K = membrane_stiffness(surface, STEEL, h, elements=elements) + bending_stiffness(surface, STEEL, h, elements)
    scale = 1 / np.sqrt(K.diagonal())
    K = csr_array(diags_array(scale) @ K @ diags_array(scale) + shift * diags_array(np.ones(len(scale))))
    points = np.concatenate([surface.V, surface.V[surface.edges.ends].mean(axis=1)])
    i = np.arange(K.shape[0])
    return K, points, np.where(i < 3 * surface.n, i // 3, surface.n + (i - 3 * surface.n) % len(surface.edges.ends))


@zoo
@direct
def test_every_solver_agrees_with_a_dense_factorisation(name, solver):
    require(solver)
    K, points, node = system(ZOO[name]())
    b = np.random.default_rng(0).standard_normal((K.shape[0], 3))
    solve = factorise(K, points, node, solver)
    expected = cho_solve(cho_factor(K.toarray()), b)
    assert_allclose(solve(b), expected, atol=1e-9 * np.abs(expected).max())
    assert_allclose(solve(b[:, 1]), expected[:, 1], atol=1e-9 * np.abs(expected).max())
    assert solve(b[:, 1]).shape == (K.shape[0],)


@zoo
@pytest.mark.parametrize("solver", ["multifrontal", "PARDISO"])
def test_hermitian_matrices_are_solved_in_real_form(name, solver):
    require(solver)
    K, points, node = system(ZOO[name]())
    turn = np.exp(1j * np.random.default_rng(0).uniform(-3, 3, K.shape[0]))
    K = csr_array(diags_array(turn) @ K @ diags_array(turn.conj()))
    b = np.random.default_rng(1).standard_normal((K.shape[0], 3)) + 1j
    solve = factorise(K, points, node, solver)
    for scale in (1, 4):
        expected = np.linalg.solve(scale * K.toarray(), b)
        solve.refactor(csr_array(scale * K))
        assert_allclose(solve(b), expected, atol=1e-9 * np.abs(expected).max())
        assert_allclose(solve(b[:, 1]), expected[:, 1], atol=1e-9 * np.abs(expected).max())
    with pytest.raises(NotPositiveDefinite):
        factorise(csr_array(K - 3 * diags_array(np.ones(K.shape[0]))), points, node, solver)


@pytest.mark.parametrize("pair", ["constant+midedge", "quadratic+midedge", "quadratic+hhj"])
def test_edges_may_carry_unknowns(pair):
    K, points, node = system(ZOO["dome"](), Elements.from_name(pair))
    b = np.ones(K.shape[0])
    assert_allclose(factorise(K, points, node, "multifrontal")(b), factorise(K, points, node, "SuperLU")(b), rtol=1e-7)


@settings(max_examples=15, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10**6), cells=st.integers(2, 30), missing=st.floats(0, 0.6), one=st.booleans())
def test_any_mesh_any_unknowns_missing(seed, cells, missing, one):
    """Random positive definite values on the pattern of a mesh from which unknowns were struck out."""
    rng = np.random.default_rng(seed)
    K, points, node = system(jittered(grid(cells, cells, 1.0, 1.0), seed=seed))
    keep = rng.random(K.shape[0]) >= missing
    if one:
        keep &= np.arange(K.shape[0]) % 3 == 0
    keep[0] = True
    K = csr_array(K[keep][:, keep])
    b = rng.standard_normal(K.shape[0])
    solve = Multifrontal(K, Fronts.from_matrix(K, points, node[keep]))
    assert np.linalg.norm(K @ solve(b) - b) <= 1e-9 * np.linalg.norm(b)
    values = csr_array(diags_array(rng.uniform(1, 2, len(b))) + K)
    solve.refactor(values)
    assert np.linalg.norm(values @ solve(b) - b) <= 1e-9 * np.linalg.norm(b)


@direct
def test_new_values_on_the_same_pattern(solver):
    require(solver)
    K, points, node = system(ZOO["saddle"]())
    b = np.ones(K.shape[0])
    solve = factorise(K, points, node, solver)
    before = solve(b)
    solve.refactor(csr_array(4 * K))
    assert_allclose(solve(b), before / 4, rtol=1e-12)


@pytest.mark.parametrize("solver", ["multifrontal", "PARDISO"])
def test_another_pattern_is_refused(solver):
    require(solver)
    K, points, node = system(ZOO["saddle"]())
    solve = factorise(K, points, node, solver)
    with pytest.raises(ValueError, match="pattern"):
        solve.refactor(csr_array(diags_array(np.ones(K.shape[0]))))


@pytest.mark.parametrize("solver", ["multifrontal", "PARDISO"])
def test_two_unknowns_a_point_that_are_solved_with_often(solver, monkeypatch):
    """Blocks or none: the same answers, for new values as well; PARDISO is told that there are none."""
    require(solver)
    monkeypatch.setattr(sparse, "solver_name", lambda: solver)
    asked = []
    monkeypatch.setattr(sparse, "Pardiso", lambda K, blocks: asked.append(blocks) or Pardiso(K, blocks))
    K, points, node = system(ZOO["dome"]())
    two = (node < len(ZOO["dome"]().V)) & (np.arange(len(node)) % 3 < 2)
    K, node = csr_array(K[two][:, two]), node[two]
    pattern, b = SamePatternFactors(points, node, many_solves=True), np.random.default_rng(3).standard_normal(len(node))
    for values in (K, csr_array(diags_array(np.linspace(1, 2, len(node))) + K)):
        assert_allclose(pattern.factor(values)(b), factorise(values, points, node, solver)(b), rtol=1e-9, atol=1e-9)
    assert asked[:1] == ([False] if solver == "PARDISO" else [])


@pytest.mark.parametrize("solver", ["multifrontal", "PARDISO"])
def test_matrices_of_one_pattern_are_analysed_once(solver, monkeypatch):
    require(solver)
    made = []
    monkeypatch.setattr(sparse, "solver_name", lambda: solver)
    monkeypatch.setattr(sparse, "factorise", lambda *given: made.append(1) or factorise(*given, solver=solver))
    K, points, node = system(ZOO["saddle"]())
    pattern, b = sparse.SamePatternFactors(points, node), np.ones(K.shape[0])
    for values in (K, csr_array(K + diags_array(np.linspace(0, 1, len(b)))), K):
        assert np.array_equal(pattern.factor(values)(b), factorise(values, points, node, solver)(b))
    assert len(made) == 1
    with pytest.raises(ValueError, match="pattern"):
        pattern.factor(csr_array(diags_array(np.ones(len(b)))))


def test_a_pattern_with_as_many_entries_a_row_elsewhere_is_refused():
    require("PARDISO")
    one = csr_array(np.array([[4.0, 1, 0], [1, 4, 0], [0, 0, 4]]))
    other = csr_array(np.array([[4.0, 0, 1], [0, 4, 0], [1, 0, 4]]))
    solve = factorise(one, np.eye(3), None, "PARDISO")
    with pytest.raises(ValueError, match="pattern"):
        solve.refactor(other)


@direct
@pytest.mark.parametrize("name", ["flat", "closed", "two pieces"])
def test_indefinite_matrices_are_refused(solver, name):
    require(solver)
    K, points, node = system(ZOO[name](), shift=-1e-2)
    with pytest.raises(NotPositiveDefinite):
        factorise(K, points, node, solver)


def test_a_factor_is_repeated_bit_for_bit():
    K, points, node = system(ZOO["dome"]())
    b = np.ones(K.shape[0])
    assert np.array_equal(*(factorise(K, points, node, "multifrontal")(b) for _ in range(2)))


@pytest.mark.parametrize("alone", [0, 10**6])
def test_pardiso_solves_with_the_thread_count_of_the_factorisation(alone, monkeypatch):
    """Seen: a two-level factor made by one thread, used by two, gave numbers a hundred times too large.

    Small systems have one, on any number of cores: two take twice the time.
    """
    require("PARDISO")
    monkeypatch.setattr("dsfab.core.sparse.libraries.ALONE", alone)
    K, points, node = system(ZOO["saddle"]())
    solve = factorise(K, points, node, "PARDISO")
    solver, seen = pytest.importorskip("pypardiso").PyPardisoSolver, []
    call, library = solver._call_pardiso, solver().libmkl
    count = library.MKL_Get_Max_Threads
    monkeypatch.setattr(solver, "_call_pardiso", lambda *given: seen.append(count()) or call(*given))
    cholesky.blas_pools.cache_clear()  # PARDISO's library may have been loaded since the last look
    solve(np.ones(K.shape[0]))
    with one_blas_thread():
        assert count() == 1
        solve(np.ones(K.shape[0]))
        solve.refactor(K)
    assert seen == 3 * [1 if alone else count()]


@pytest.mark.parametrize(("unknowns", "is_small"), [(9_000, True), (16_000, False)])
def test_pardiso_takes_one_thread_for_up_to_ten_thousand_unknowns_or_so(unknowns, is_small):
    require("PARDISO")
    library = Pardiso(csr_array(diags_array(np.ones(2))))._solver.libmkl
    before = library.MKL_Set_Num_Threads_Local(2)
    try:
        solve = Pardiso(csr_array(diags_array(np.ones(unknowns))))
    finally:
        library.MKL_Set_Num_Threads_Local(before)
    assert solve._threads == (1 if is_small else 2)


def test_separators_separate():
    """Points of different parts of any level do not touch: their keys differ first in a separator's digit or not."""
    surface = jittered(grid(40, 40, 1.0, 1.0))
    K, points, node = system(surface)
    i, j = point_graph(K, node, surface.n)
    keys = dissection_keys((i, j), points[: surface.n], K.shape[0])
    levels = int(np.ceil(np.log2(K.shape[0] / 192)))
    for level in range(levels):
        a, b = (keys[k] // 4 ** (levels - 1 - level) for k in (i, j))
        siblings = a // 4 == b // 4
        assert not (siblings & (a % 4 == 0) & (b % 4 == 1)).any()
    assert len(np.unique(keys)) > 20


def test_counted_memory_is_that_of_the_factor():
    K, points, node = system(jittered(grid(30, 30, 1.0, 1.0)))
    fronts = Fronts.from_matrix(K, points, node)
    entries = sum(L.size + P.size for L, P in Multifrontal(K, fronts)._factor)
    assert entries < fronts.peak < 3 * entries


@pytest.mark.parametrize(("found", "name"), [(object(), "PARDISO"), (None, "multifrontal")])
def test_the_name_is_that_of_the_solver_used(found, name, monkeypatch):
    if found:
        require("PARDISO")
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: found)
    assert sparse.solver_name() == name
    K, points, node = system(ZOO["flat"]())
    assert type(factorise(K, points, node)).__name__.lower() == name.lower()


@pytest.mark.parametrize("solver", ["multifrontal", "PARDISO"])
def test_a_factor_that_does_not_fit_is_refused(solver, monkeypatch):
    require(solver)
    for module in (sparse, libraries):
        monkeypatch.setattr(module, "require_memory", cholesky.require_memory)
    monkeypatch.setattr(cholesky, "free_memory", lambda: 1000)
    monkeypatch.setattr(sparse, "solver_name", lambda: solver)
    K, points, node = system(ZOO["flat"]())
    with pytest.raises(FactorMemoryError, match=r"needs 0\.\d GiB of memory; 0\.0 GiB are free; use a coarser mesh"):
        factorise(K, points, node)


def held_dome(cells=10):
    surface = lifted(lambda x, y: 16 * x * (1 - x) * y * (1 - y), cells)
    K = membrane_stiffness(surface, STEEL, 0.02) + bending_stiffness(surface, STEEL, 0.02)
    held = np.repeat(surface.V[:, 2] < 1e-9, 3)
    held[3 * np.flatnonzero(surface.V[:, 2] > 0.5)[0] + 1] = True  # a point with two unknowns
    return surface, K, held


def test_multigrid_stands_in_where_the_factor_does_not_fit(monkeypatch):
    pytest.importorskip("pyamg", reason="the optional solver is not installed")
    surface, K, held = held_dome()
    direct = stiffness_factor(surface, K, held)
    b = np.random.default_rng(0).standard_normal((len(direct.free), 2))
    monkeypatch.setattr(cholesky, "free_memory", lambda: 1000)
    iterative = stiffness_factor(surface, K, held)
    assert isinstance(iterative.solve, libraries.Multigrid)
    expected = direct.solve(b)
    assert_allclose(iterative.solve(b), expected, atol=1e-7 * np.abs(expected).max())


def test_multigrid_raises_an_error_if_it_does_not_converge(monkeypatch):
    pytest.importorskip("pyamg", reason="the optional solver is not installed")
    surface, K, held = held_dome(24)
    factor = stiffness_factor(surface, K, held)
    rigid = rigid_motions(surface.V).reshape(-1, 6)[factor.free] / factor.scale[:, None]
    monkeypatch.setattr(libraries, "ITERATIONS", 1)
    scale = diags_array(factor.scale)
    inner = csr_array(scale @ K[factor.free][:, factor.free] @ scale)
    solve = factorise(inner, surface.V, factor.free // 3, "multigrid", rigid)
    with pytest.raises(ConvergenceError, match="stopped at a relative residual"):
        solve(np.random.default_rng(0).standard_normal(len(factor.free)))


def test_an_order_of_elimination_serves_another_matrix_of_the_same_pattern(monkeypatch):
    K, points, node = system(ZOO["dome"]())
    order = SuperLU(K, points, node).order
    monkeypatch.setattr(libraries, "elimination_order", lambda *_: pytest.fail("found again"))
    twice = SuperLU(2 * K, points, node, order=order)
    b = np.ones(K.shape[0])
    assert_allclose(2 * (K @ twice(b)), b, atol=1e-8)


def test_pivots_are_read_unless_the_matrix_is_known_to_be_definite():
    K, points, node = system(ZOO["dome"]())
    with pytest.raises(NotPositiveDefinite):
        SuperLU(-K, points, node)
    b = np.ones(K.shape[0])
    assert_allclose(K @ SuperLU(K, points, node, definite=True)(b), b, atol=1e-8)


def test_a_small_factor_gives_no_memory_back(monkeypatch):
    """It takes longer than the factor; after a large one it is done."""
    asked = []
    monkeypatch.setattr(cholesky, "malloc_trim", lambda: asked.append)
    require("PARDISO")
    Pardiso(system(grid(2, 2, 1.0, 1.0))[0])
    assert asked == []
    cholesky.release_freed_memory(15e6)
    assert asked == []
    cholesky.release_freed_memory(27e6)
    assert asked == [0]


def test_memory_that_pardiso_does_not_give_back_is_no_traceback(monkeypatch):
    """As after Ctrl-C between its phases."""
    wrapper = pytest.importorskip("pypardiso.pardiso_wrapper", reason="the optional solver is not installed")
    asked, told = [], []

    def interrupted(self, everything):
        asked.append(everything)
        raise wrapper.PyPardisoError(-2)

    solver = Pardiso(system(grid(2, 2, 1.0, 1.0))[0])
    monkeypatch.setattr(wrapper.PyPardisoSolver, "free_memory", interrupted)
    monkeypatch.setattr(sys, "unraisablehook", told.append)
    del solver
    assert (asked, told) == ([True], [])
