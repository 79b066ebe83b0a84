"""Modes of a diffusion operator with the smallest eigenvalues."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigsh

from dsfab.core.arrays import Floats, lock_floats
from dsfab.core.derived import derived, derived_results
from dsfab.core.errors import PatternError
from dsfab.core.sparse import Factor, SuperLU, factorise, one_blas_thread, solver_name
from dsfab.diffusion.symmetry import Symmetry
from dsfab.surface import pieces
from dsfab.surface.fields import voronoi_mass
from dsfab.surface.mesh import Surface

CLEAR_MOMENT = 1e-2
"""Relative size below which a moment, or the difference of two moments of inertia, counts as zero."""


@one_blas_thread()
def reference_axes(surface: Surface, weights: Sequence[Floats] = (), vectors: Sequence[Floats] = ()) -> Floats:
    """Return right-handed orthonormal axes (3, 3), in rows. If the surface rotates, the axes rotate with it.
    weights : arrays (n,) of vertex weights, >= 0.    vectors : vectors (3,), such as the resultant of the loads.

    The first two axes come from the first of these directions that are not zero and not parallel:
    1. the vectors
    2. the lines from the surface's centroid to the weighted centroids
    3. the mean of |x|^2 x over the area, for x from the centroid
    4. the principal axes of inertia, then x, y and z"""
    mass = voronoi_mass(surface)
    x = surface.V - mass @ surface.V / mass.sum()
    measures = [mass, *(mass * weight for weight in weights if (mass * weight).sum() > 0)]
    size = np.sqrt(float(mass @ (x**2).sum(axis=1)) / mass.sum())
    axes: list[Floats] = []
    for candidate in (*_axis_candidates(x / size, measures, vectors), *np.eye(3)):
        rest = candidate - sum(((axis @ candidate) * axis for axis in axes), np.zeros(3))
        if np.linalg.norm(rest) > CLEAR_MOMENT:
            axes.append(rest / np.linalg.norm(rest))
        if len(axes) == 2:
            break
    return np.stack([*axes, np.cross(axes[0], axes[1])])


def _axis_candidates(x: Floats, measures: Sequence[Floats], vectors: Sequence[Floats]) -> Iterator[Floats]:
    for vector in vectors:
        length = float(np.linalg.norm(vector))
        if length > 0:
            yield np.asarray(vector) / length
    shares = [measure / measure.sum() for measure in measures]
    for share in shares[1:]:
        yield share @ x
    yield shares[0] @ ((x**2).sum(axis=1)[:, None] * x)
    for share in shares:
        centred = x - share @ x
        inertia, axes = np.linalg.eigh(centred.T @ (share[:, None] * centred))
        for i in (2, 1, 0):
            other_inertia = np.delete(inertia, i)
            third = float(share @ (centred @ axes[:, i]) ** 3)
            if np.abs(other_inertia - inertia[i]).min() > CLEAR_MOMENT * inertia[2]:
                yield axes[:, i] * _axis_sign(axes[:, i], third, inertia[2])


def _axis_sign(axis: Floats, third_moment: float, largest: float) -> float:
    if abs(third_moment) > CLEAR_MOMENT * largest**1.5:
        return float(np.sign(third_moment))
    return float(np.sign(axis[int(np.argmax(np.abs(axis) > 0.5))]))


REPEATED = 1e-6  # Eigenvalues count as repeated if their relative difference is smaller.
VISIBLE = 1e-2  # A reference field is used only if more than this fraction of the field lies in the eigenspace.
SPARE = 2
"""Number of additional eigenpairs. They usually include all copies of a last eigenvalue that is repeated."""


@dataclass(frozen=True, eq=False)
class Modes:
    """Modes of one diffusion operator, without the constant modes. lam : (k,) eigenvalues, 1/m2, ascending.
    X : (n, k) values at the vertices: X^T M X = (area / 4 pi) I, with the Voronoi mass M."""

    lam: Floats
    X: Floats

    def __post_init__(self) -> None:
        lock_floats(self, lam=(None,), X=(None, len(self.lam)))

    def mode(self, number: int) -> Floats:
        """Return mode `number` (n,), from 1. Raises PatternError for a number beyond the computed modes."""
        if not 1 <= number <= len(self.lam):
            raise PatternError(f"mode {number} does not exist; modes 1 to {len(self.lam)} were computed")
        return np.asarray(self.X[:, number - 1])


@derived
def _constant_modes(surface: Surface) -> int:
    return pieces(surface.F, surface.edges)[0]


def diffusion_modes(
    surface: Surface, L: csr_array, k: int = 5, axes: Floats | None = None, symmetry: Symmetry | None = None
) -> Modes:
    """Return the first k modes of L x = lambda M x that are not constant [paper, section 3.4]; M is the Voronoi mass.
    axes     : (3, 3) axes in rows, for the signs of the modes.    symmetry : symmetry of all returned modes, or None.
    Raises PatternError if the mesh has too few vertices for k modes."""
    return family_modes(surface, [L], k, axes, symmetry)[0]


def family_modes(
    surface: Surface,
    operators: Sequence[csr_array],
    k: int = 5,
    axes: Floats | None = None,
    symmetry: Symmetry | None = None,
) -> list[Modes]:
    """Return the first k modes of each operator (n, n); all have the same sparsity pattern. See `diffusion_modes`."""
    mass = voronoi_mass(surface)
    axes = reference_axes(surface) if axes is None else axes
    families, solve = [], None
    for L in operators:
        A = _scaled_operator(surface, L, mass)
        if solve is None:
            solve = _factor(surface, A)
        else:
            solve.refactor(A)
        families.append(_modes(surface, L, solve, k, axes, symmetry))
    return families


def _modes(surface: Surface, L: csr_array, solve: Factor, k: int, axes: Floats, symmetry: Symmetry | None) -> Modes:
    mass, constants = voronoi_mass(surface), _constant_modes(surface)
    count = k * (symmetry.order if symmetry else 1) + constants + SPARE
    while True:
        if count >= surface.n:
            raise PatternError(
                f"{k} modes need over {count} vertices, but the surface has {surface.n}; refine the mesh"
            )
        lam, Y = _lanczos(solve, surface.n, 1 / surface.area, count)
        lam, X = lam[constants:], Y[:, constants:] / _root(surface, mass)[:, None]
        if symmetry:
            lam, X = symmetry.invariant(L, X, mass)
        if len(lam) >= k and (symmetry or 2 * count >= surface.n or lam[-1] - lam[k - 1] > REPEATED * lam[-1]):
            break
        count *= 2
    with one_blas_thread():
        X = _canonical(surface, lam, X, mass, axes)[:, :k]
    return Modes(lam[:k], X * np.sqrt(surface.area / (4 * np.pi)))


def _root(surface: Surface, mass: Floats) -> Floats:
    """Return the square root (n,) of the mass of each vertex; a zero mass is replaced by the area of the surface."""
    return np.sqrt(np.where(mass > 0, mass, surface.area))


def _scaled_operator(surface: Surface, L: csr_array, mass: Floats) -> csr_array:
    """Return M^-1/2 (L + s M) M^-1/2 with M = diag(mass) and s = 1 / area."""
    root = _root(surface, mass)
    unused = np.where(mass > 0, 0.0, L.diagonal().max() / root.min() ** 2)
    A = csr_array((L.data / np.repeat(root, np.diff(L.indptr)) / root[L.indices], L.indices, L.indptr), shape=L.shape)
    return csr_array(A + diags_array(unused + 1 / surface.area))


def _factor(surface: Surface, A: csr_array) -> Factor:
    if solver_name() == "PARDISO":
        return factorise(A, surface.V)
    results = derived_results(surface)  # all operators of a surface use the same order of elimination
    solve = SuperLU(A, surface.V, np.arange(surface.n), order=results.get(SuperLU), definite=True)
    results[SuperLU] = solve.order
    return solve


def _lanczos(solve: Callable[[Floats], Floats], n: int, shift: float, count: int) -> tuple[Floats, Floats]:
    """Return the `count` smallest eigenvalues of a matrix A, ascending, and eigenvectors (n, count).
    solve : function that returns (A + shift I)^-1 b for a vector b."""
    inverse = LinearOperator((n, n), matvec=solve, dtype=np.float64)
    start = 1 + 0.5 * np.sin(np.arange(n))  # always the same start, so the same modes
    try:
        with one_blas_thread():
            vectors = min(n, max(20, 4 * count))
            # tolerance 0: copies of a repeated eigenvalue appear only late, from rounding errors
            theta, Y = eigsh(inverse, count, which="LA", v0=start, tol=0, ncv=vectors, maxiter=100 * count)
    except ArpackNoConvergence as error:
        raise PatternError(
            "the computation of the modes did not converge; refine the mesh or lower diffusion.r"
        ) from error
    order = np.argsort(-theta, kind="stable")
    return 1 / theta[order] - shift, Y[:, order]


def _canonical(surface: Surface, lam: Floats, X: Floats, mass: Floats, axes: Floats) -> Floats:
    fields = _reference_fields(surface, mass, axes)
    out = X.copy()
    start = 0
    while start < len(lam):
        stop = start + 1
        while stop < len(lam) and lam[stop] - lam[start] <= REPEATED * lam[stop]:
            stop += 1
        space = X[:, start:stop]
        if stop - start > 1:
            space = _aligned_basis(space, fields, mass)
        out[:, start:stop] = space * [_sign(x, fields, mass) for x in space.T]
        start = stop
    return out


def _reference_fields(surface: Surface, mass: Floats, axes: Floats) -> Floats:
    x = (surface.V - mass @ surface.V / mass.sum()) @ axes.T / surface.size
    x = np.ascontiguousarray(x.T)
    squares = [x[i] * x[j] for i in range(3) for j in range(i, 3)]
    cubes = [x[i] * square for i, start in ((0, 0), (1, 3), (2, 5)) for square in squares[start:]]
    fields = np.stack([*x, *squares, *cubes]).T
    fields -= mass @ fields / mass.sum()
    length = np.sqrt(mass @ (fields * fields))
    unit: Floats = np.divide(fields, length, out=np.zeros_like(fields), where=length > 1e-9 * length.max())
    return unit


def _aligned_basis(space: Floats, fields: Floats, mass: Floats) -> Floats:
    coordinates = space.T @ (mass[:, None] * fields)  # a column for each field
    basis: list[Floats] = []
    for candidate in [*coordinates.T, *np.eye(space.shape[1])]:
        rest = candidate - sum((b * (b @ candidate) for b in basis), np.zeros_like(candidate))
        if np.linalg.norm(rest) > VISIBLE:
            basis.append(rest / np.linalg.norm(rest))
        if len(basis) == space.shape[1]:
            break
    return np.asarray(space @ np.stack(basis, axis=1))


def _sign(x: Floats, fields: Floats, mass: Floats) -> float:
    norm = float(np.sqrt(mass @ x**2))
    skew = float(mass @ (x * x * x)) / norm**3 * float(np.sqrt(mass.sum()))
    if abs(skew) > VISIBLE:
        return float(np.sign(skew))
    shares = (mass * x) @ fields / norm
    clear = shares[np.abs(shares) > VISIBLE]
    return float(np.sign(clear[0])) if len(clear) else 1.0
