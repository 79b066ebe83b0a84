"""Natural frequencies and buckling factors of a sheet."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import eigh
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigsh

from dsfab.core.arrays import Bools, Floats, Ints, lock_floats
from dsfab.core.errors import StaticsError
from dsfab.core.units import GRAVITY
from dsfab.statics.bending import curvatures
from dsfab.statics.boundary_conditions import all_clamped, require_held, with_springs
from dsfab.statics.elements import BUBBLES, Elements, assemble_blocks, edge_frames, elements_of
from dsfab.statics.factorisation import (
    REFINEMENTS,
    Factor,
    FactorCache,
    FactorFunction,
    LinearMap,
    ScaledStiffness,
    refined_solution,
    stiffness_factor,
)
from dsfab.statics.model import SheetModel
from dsfab.statics.solve import Equilibrium, flat_axis, held_unknowns
from dsfab.statics.stiffness import sheet_stiffness
from dsfab.statics.stress import stress
from dsfab.surface import LoadCase, Surface
from dsfab.surface.fields import hat_gradients, tangents

HELD_ACROSS = "the supports are assumed to prevent movements out of the sheet's plane"
UPRIGHT = f"{HELD_ACROSS}, and to clamp the supported edges, because a sheet on hinged supports would fall over"


@dataclass(frozen=True, eq=False)
class ModeSupports:
    """Supports for vibration and buckling, in the load case `load`. told : message about assumed supports, or ''."""

    load: LoadCase
    told: str = ""


def mode_supports(surface: Surface, load: LoadCase, plane: bool | None = None) -> ModeSupports:
    """Return the supports for vibration and buckling.
    A flat sheet with in-plane loads also gets supports normal to its plane, unless `plane` is False."""
    axis = flat_axis(surface, load)
    if axis is None or plane is False:
        return ModeSupports(load)
    fixed, held_vertices = load.fixed.copy(), load.supported
    fixed[held_vertices, axis] = True
    across = replace(load, fixed=fixed)
    try:
        require_held(surface, across, fixed, all_clamped(across))
    except StaticsError:
        edges = surface.edges
        upright = edges.boundary & held_vertices[edges.ends].all(axis=1)
        clamped = all_clamped(load)
        return ModeSupports(replace(across, clamped=upright if clamped is None else upright | clamped), UPRIGHT)
    return ModeSupports(across, HELD_ACROSS)


FOR_FREQUENCIES, FOR_BUCKLING = elements_of("frequency"), elements_of("buckling")
"""Default elements of frequencies and of buckling."""
HATS = (np.eye(3) + 1) / 12  # Integrals of products of two linear functions phi over a triangle of area 1.
BUBBLE_PAIRS = (np.eye(3) + 1) * 4 / 45  # Integrals of products of two edge bubbles; a bubble is 4 phi_j phi_k.
HAT_BUBBLES = np.array([[2, 1, 2], [2, 2, 1], [1, 2, 2]]) / 15
"""Integrals of linear functions phi_i (row i) times the bubble of half-edge c (column c), which begins at corner c."""
VOIGT = np.array([[[1, 0], [0, 0]], [[0, 0], [0, 1]], [[0, 0.5], [0.5, 0]]])
"""Three symmetric matrices (2, 2): the curvature tensors with xx = 1, with yy = 1, and with 2 xy = 1."""

MODE_RESIDUAL = 1e-3
"""Largest accepted relative residual of a mode, in the energy norm.
The residual bounds the relative error of the frequency or buckling factor [Parlett 1980, 4.5]."""
LANCZOS_RESIDUAL = 1e-8  # relative residual of Ritz vectors at which ARPACK stops; eigenvalues are far more accurate

INDEPENDENT = 1e-6  # Combinations of unit-energy vectors with less energy than this are rounding errors.


@dataclass(frozen=True, eq=False)
class Vibration:
    """Natural frequencies `hertz` (k,), ascending, and mode shapes `shapes` (k, n, 3), with largest displacement 1."""

    hertz: Floats
    shapes: Floats

    def __post_init__(self) -> None:
        lock_floats(self, hertz=(None,), shapes=(len(self.hertz), None, 3))


@dataclass(frozen=True, eq=False)
class Buckling:
    """Result of a linear buckling analysis. It may have fewer modes than requested.
    factor : (k,) load factors at buckling, ascending.
    shapes : (k, n, 3) mode shapes, scaled to the largest displacement 1."""

    factor: Floats
    shapes: Floats

    def __post_init__(self) -> None:
        lock_floats(self, factor=(None,), shapes=(len(self.factor), None, 3))


def frequencies(
    sheet: SheetModel,
    fixed: Bools,
    count: int = 3,
    elements: Elements = FOR_FREQUENCIES,
    K: csr_array | None = None,
    factor_of: FactorFunction = stiffness_factor,
    spring: Floats | None = None,
) -> Vibration:
    """Return the lowest natural frequencies of small vibrations: K x = omega^2 M x.
    fixed     : (n, 3) mask of fixed directions.    spring : (n, 3) stiffness of spring supports, N/m.
    K         : stiffness matrix of the sheet without springs, if known.
    Raises StaticsError for a material without density, for mechanisms, and for more modes than unknowns."""
    surface, density = sheet.surface, sheet.material.density
    if not density > 0:
        raise StaticsError("natural frequencies need a material with a density; set density in kg/m3")
    M = mass_matrix(surface, density * sheet.thickness, elements)
    if sheet.carried is not None:
        M = csr_array(M + diags_array(np.pad(np.repeat(sheet.carried, 3), (0, M.shape[0] - 3 * surface.n))))
    if K is None:
        K = sheet_stiffness(sheet, elements)
    no_force, not_loaded = np.zeros((surface.n, 3)), np.zeros(surface.n, dtype=bool)
    sheet_load = sheet.with_clamped_edges(LoadCase(fixed, no_force, not_loaded, no_force if spring is None else spring))
    inverse, shapes = _supported_modes(surface, M, K, sheet_load, elements, count, factor_of)
    return Vibration(1 / (2 * np.pi * np.sqrt(inverse)), shapes)


def mass_of_loads(loads: Iterable[LoadCase]) -> Floats | None:
    """Return the masses (n,), kg, at the vertices with the same weight as the downward loads; None without loads."""
    masses = None
    for load in loads:
        up = load.force[:, 2]
        down = np.maximum(-up, 0.0)
        mass = down * (max(-float(up.sum()), 0.0) / GRAVITY / max(float(down.sum()), np.finfo(float).tiny))
        masses = mass if masses is None else masses + mass
    return masses


def buckling(
    sheet: SheetModel,
    load: LoadCase,
    answer: Equilibrium,
    count: int = 3,
    elements: Elements = FOR_BUCKLING,
    K: csr_array | None = None,
    factor_of: FactorFunction = stiffness_factor,
) -> Buckling:
    """Return the lowest positive load factors of linear buckling: K x = factor (-K_g) x.
    Real thin shells buckle at lower factors, cylinders at 0.2 to 0.5 of them [Koiter 1945; NASA SP-8007].
    answer : equilibrium under `load`.    K : stiffness matrix of the sheet without springs, if known.
    Raises StaticsError for mechanisms, and if the modes do not converge."""
    surface = sheet.surface
    resultant = sheet.thickness * stress(surface, sheet.material, answer.u, sheet.law, answer.bubbles)
    smallest = np.linalg.eigvalsh(resultant)[:, 0].min()
    if smallest >= -1e-9 * np.abs(resultant).max():  # without compression no mode exists, and Lanczos would run forever
        return Buckling(np.zeros(0), np.zeros((0, surface.n, 3)))
    minus_Kg = -geometric_stiffness(surface, resultant, elements)
    if K is None:
        K = sheet_stiffness(sheet, elements)
    inverse, shapes = _supported_modes(surface, minus_Kg, K, sheet.with_clamped_edges(load), elements, count, factor_of)
    return Buckling(1 / inverse, shapes)


LOCAL_SHARE = 0.02
"""A mode is local if less than this fraction of the sheet's area moves in it, for example only a loose end."""
MODES_BESIDE_LOCAL = 6  # number of modes to compute if the lowest mode is local


def moved_share(surface: Surface, shapes: Floats) -> Floats:
    """Return the fraction (k,) of the area that moves in each of k mode shapes (k, n, 3) [Bell and Dean 1970]."""
    squares = (shapes**2).sum(axis=2)
    area = surface.vertex_areas
    return np.asarray((squares @ area) ** 2 / (area.sum() * (squares**2 @ area)))


def lowest_buckling(
    sheet: SheetModel,
    load: LoadCase,
    answer: Equilibrium,
    elements: Elements = FOR_BUCKLING,
    K: csr_array | None = None,
    factor_of: FactorFunction | None = None,
) -> tuple[float | None, str]:
    """Return the lowest buckling factor, None if nothing buckles, and a note if the lowest mode is local, else ''."""
    factors = factor_of or FactorCache()
    K = sheet_stiffness(sheet, elements) if K is None else K
    lowest = buckling(sheet, load, answer, 1, elements, K, factors)
    if not len(lowest.factor):
        return None, ""
    share = float(moved_share(sheet.surface, lowest.shapes)[0])
    if share >= LOCAL_SHARE:
        return float(lowest.factor[0]), ""
    several = buckling(sheet, load, answer, MODES_BESIDE_LOCAL, elements, K, factors)
    x, y, z = sheet.surface.V[np.linalg.norm(lowest.shapes[0], axis=1).argmax()].round(2).tolist()
    is_global = moved_share(sheet.surface, several.shapes) >= LOCAL_SHARE
    clause = (
        f"the first buckling mode that moves {LOCAL_SHARE:.0%} of the area or more has the factor "
        f"{several.factor[is_global][0]:.3g}"
        if is_global.any()
        else f"the first {len(several.factor)} buckling modes are all local"
    )
    return float(lowest.factor[0]), f"local: its mode moves {share:.1%} of the area, at ({x}, {y}, {z}) m; {clause}"


def mass_matrix(surface: Surface, per_area: float, elements: Elements) -> csr_array:
    """Return the mass matrix (u, u), kg, for the u unknowns of `elements`. per_area : mass per area, kg/m2."""
    scalar = np.block([[HATS, HAT_BUBBLES], [HAT_BUBBLES.T, BUBBLE_PAIRS]])
    names = [name for name in BUBBLES if name in elements.on_edges]
    frames = edge_frames(surface)[surface.edges.of]
    axes = np.broadcast_to(np.tile(np.eye(3), (3, 1)), (surface.m, 9, 3))
    direction = np.concatenate([axes, *(frames[:, :, BUBBLES.index(name)] for name in names)], axis=1)
    function = np.concatenate([np.repeat(np.arange(3), 3), *(np.arange(3, 6) for _ in names)])
    shapes = per_area * scalar[function][:, function] * surface.areas[:, None, None]
    blocks = shapes * (direction @ direction.transpose(0, 2, 1))
    return assemble_blocks(blocks, elements.columns(surface, *names), elements.unknowns(surface))


def geometric_stiffness(surface: Surface, resultant: Floats, elements: Elements) -> csr_array:
    """Return the geometric stiffness matrix K_g, N/m, for the unknowns x of `elements` and membrane forces N:

        x . K_g x  =  integral of  sum over i of  grad x_i . N grad x_i     [Zienkiewicz and Taylor 2000, vol. 2, 11]

    resultant : (m, 3, 3) membrane forces N of each face, N/m, as tensors tangent to the face."""
    slopes, columns = _slopes(surface, elements)
    blocks = np.einsum("majx,mab,mbjy->mxy", slopes, _in_faces(surface, resultant), slopes, optimize=True)
    return assemble_blocks(blocks, columns, elements.unknowns(surface))


def geometric_products(surface: Surface, resultants: Floats, elements: Elements, modes: Floats) -> Floats:
    """Return x_i . K_g x_j (b, s, s) for each pair of columns x of `modes` (u, s).
    K_g is the geometric stiffness under each of b fields of membrane forces, `resultants` (b, m, 3, 3), N/m."""
    slopes, columns = _slopes(surface, elements)
    along = np.einsum("majx,mxs->majs", slopes, modes[columns], optimize=True)
    rows, count = 10 * surface.m, modes.shape[1]
    forces = ((_in_faces(surface, N) @ along.reshape(surface.m, 2, 5 * count)).reshape(rows, count) for N in resultants)
    return np.array([along.reshape(rows, count).T @ force for force in forces])


def _in_faces(surface: Surface, resultant: Floats) -> Floats:
    t = tangents(surface)
    return np.asarray(np.einsum("mai,mij,mbj->mab", t, resultant, t))


def _slopes(surface: Surface, elements: Elements) -> tuple[Floats, Ints]:
    """Return displacement gradients (m, 2, 5, c) of faces per unit of c unknowns, and the unknowns' indices (m, c)."""
    names = ("normal", "rotation") if elements.bending == "hhj" else ()
    mean = _mean_gradients(surface, names) * np.sqrt(surface.areas)[:, None, None, None]
    slopes = np.concatenate([mean, np.zeros((surface.m, 2, 2, mean.shape[3]))], axis=2)
    if names:
        corner = np.einsum("mci,mai->mca", surface.V[surface.F] - surface.centroids[:, None], tangents(surface))
        inertia, axes = np.linalg.eigh(np.einsum("mca,mcb,m->mab", corner, corner, surface.areas / 12))
        places = axes * np.sqrt(inertia.clip(min=0))[:, None, :]
        bent = np.einsum("uab,mux,mbj->majx", VOIGT, curvatures(surface), places, optimize=True)
        slopes[:, :, 3:, [*range(9), -3, -2, -1]] = bent
    return slopes, elements.columns(surface, *names)


def _mean_gradients(surface: Surface, names: tuple[str, ...]) -> Floats:
    slope = np.einsum("mik,mak->mai", hat_gradients(surface), tangents(surface))
    gradients = np.zeros((surface.m, 2, 3, 9 + 3 * len(names)))
    for i in range(3):
        gradients[:, :, i, i:9:3] = slope
    if names:
        normal = surface.normals
        share = np.einsum("mci,mi->mc", edge_frames(surface)[surface.edges.of, 2], normal)
        # the mean of grad (4 phi_j phi_k) is 4/3 (grad phi_j + grad phi_k) = -4/3 grad phi_i
        mean = -4 / 3 * np.roll(slope, -2, axis=2) * share[:, None, :]
        gradients[:, :, :, 9:12] = mean[:, :, None, :] * normal[:, None, :, None]
    return gradients


def _supported_modes(
    surface: Surface,
    A: csr_array,
    K: csr_array,
    load: LoadCase,
    elements: Elements,
    count: int,
    factor_of: FactorFunction,
) -> tuple[Floats, Floats]:
    is_held = held_unknowns(surface, [load], elements, plane=False)
    mu, x = largest_eigenpairs(A, factor_of(surface, with_springs(K, load), is_held), count)
    return mu, _normalised_shapes(x[:, : 3 * surface.n].reshape(-1, surface.n, 3))


def largest_eigenpairs(A: csr_array, factor: Factor, count: int, are_results: bool = True) -> tuple[Floats, Floats]:
    """Return the largest positive eigenvalues mu (k,) of A x = mu K x, descending, and eigenvectors x (k, u).
    factor : factorisation of K.    are_results : False for a faster, less accurate solution.
    Raises StaticsError if the eigenvalues do not converge or are not accurate."""
    N = len(factor.free)
    if not 1 <= count < N:
        raise StaticsError(
            f"the model of the sheet has {N} unknowns, so {count} modes are impossible; request 1 to {N - 1} modes"
        )
    scaled = ScaledStiffness(A, factor.free, factor.scale)
    products = scaled.__matmul__, factor.map.__matmul__, factor.solve
    operator, M, Minv = (LinearOperator((N, N), matvec=product, dtype=np.float64) for product in products)
    start = np.random.default_rng(0).standard_normal(N)  # a fixed seed gives repeatable numbers
    tolerance = LANCZOS_RESIDUAL if are_results else MODE_RESIDUAL
    try:
        # the Lanczos method needs many restarts if the load barely compresses the sheet
        mu, x = eigsh(operator, count, M=M, Minv=Minv, which="LA", v0=start, maxiter=500, tol=tolerance)
    except ArpackNoConvergence as error:
        raise StaticsError(
            "the computation of buckling modes does not converge: the load compresses the sheet too little"
        ) from error
    is_mode = mu > 1e-10 * np.abs(mu).max()  # smaller values are rounding errors
    mu, x = mu[is_mode], x[:, is_mode]
    if are_results and len(mu):
        mu, x = _accurate_eigenpairs(scaled, factor, mu, x)
    order = np.argsort(-mu)
    full = np.zeros((len(mu), A.shape[0]))
    full[:, factor.free] = (factor.scale[:, None] * x[:, order]).T
    return mu[order], full


def _accurate_eigenpairs(A: LinearMap, factor: Factor, mu: Floats, x: Floats) -> tuple[Floats, Floats]:
    defects = A @ x - mu * (factor.map @ x)
    residual = np.sqrt(np.einsum("nk,nk->k", defects, np.stack([factor.solve(c) for c in defects.T], axis=1)).clip(0))
    if not (residual <= MODE_RESIDUAL * mu).all():
        mu, x, residual = refined_eigenpairs(A, factor, mu, x)
    if not (residual <= MODE_RESIDUAL * mu).all():
        raise StaticsError("the modes are not accurate: the sheet is too thin for its size or nearly a mechanism")
    return mu, x


def refined_eigenpairs(A: LinearMap, factor: Factor, mu: Floats, x: Floats) -> tuple[Floats, Floats, Floats]:
    """Return more accurate eigenvalues mu (k,) and eigenvectors x (N, k) of A x = mu K x [Davidson 1975].
    Return also the last change (k,) of each eigenvalue. factor : factorisation of K."""
    K, change = factor.map.astype(np.longdouble), np.full(len(mu), np.inf)
    Kx = (K @ x).astype(np.float64)
    for _ in range(REFINEMENTS):
        if (change <= MODE_RESIDUAL * mu).all():
            break
        steps, _ = refined_solution(factor.map, A @ x - mu * Kx, factor.solve)
        moves = (K @ steps).astype(np.float64)
        energies = np.sqrt(np.einsum("nk,nk->k", steps, moves).clip(0))
        inexact = energies > MODE_RESIDUAL * mu  # smaller steps are rounding errors
        basis = np.concatenate([x, steps[:, inexact] / energies[inexact]], axis=1)
        forces = np.concatenate([Kx, moves[:, inexact] / energies[inexact]], axis=1)
        energy = basis.T @ forces
        weight, axes = eigh((energy + energy.T) / 2)
        axes = axes[:, weight > INDEPENDENT] / np.sqrt(weight[weight > INDEPENDENT])  # drops dependent vectors
        c = axes @ eigh(axes.T @ (basis.T @ (A @ basis)) @ axes)[1][:, -len(mu) :]
        x, Kx = basis @ c, forces @ c
        earlier, mu = mu, np.einsum("nk,nk->k", x, A @ x) / np.einsum("nk,nk->k", x, Kx)
        change = np.abs(mu - earlier)
    return mu, x, change


def _normalised_shapes(shapes: Floats) -> Floats:
    flat = shapes.reshape(len(shapes), 3 * shapes.shape[1])
    sign = np.sign(flat[np.arange(len(flat)), np.abs(flat).argmax(axis=1)])
    longest = np.linalg.norm(shapes, axis=2).max(axis=1)
    return np.asarray(shapes * (sign / longest)[:, None, None])
