"""Diffusion: closed-form spectra with rate 2, the operator built by other roads, modes that can be trusted twice."""

import igl
import numpy as np
import pytest

from dsfab.core.errors import PatternError
from dsfab.diffusion import DiffusionTensors, diffusion_modes, diffusion_operator, diffusion_tensors
from dsfab.surface import Surface
from dsfab.surface.fields import voronoi_mass
from tests.shapes import ZOO, grid, jittered, sphere, zoo


def constant_stress(surface: Surface, xx: float, yy: float, xy: float = 0.0) -> np.ndarray:
    return np.broadcast_to(np.array([[xx, xy, 0], [xy, yy, 0], [0, 0, 0.0]]), (surface.m, 3, 3))


def tangent_stress(surface: Surface, seed: int = 0) -> np.ndarray:
    """A random symmetric tensor in each face's plane."""
    random = np.random.default_rng(seed).normal(size=(surface.m, 3, 3))
    P = np.eye(3) - np.einsum("mi,mj->mij", surface.normals, surface.normals)
    return P @ (random + np.swapaxes(random, 1, 2)) @ P


def plate_eigenvalues(r: float, count: int) -> np.ndarray:
    """-div(diag(r, 1) grad u) on 2 x 1 with free edges: pi^2 (r p^2 / 4 + q^2)."""
    p, q = np.meshgrid(np.arange(12), np.arange(40))
    return np.sort((np.pi**2 * (r * p**2 / 4 + q**2)).ravel())[1 : count + 1]


@pytest.mark.parametrize(
    ("labelling", "sign", "family"), [("signed", 1, "major"), ("signed", -1, "minor"), ("magnitude", -1, "major")]
)
@pytest.mark.parametrize("r", [1, 10])
def test_plate_spectrum_has_rate_two(r, labelling, sign, family):
    """Stress along x only: tension is major either way, compression minor by sign and major by magnitude."""
    exact = plate_eigenvalues(r, 3)
    errors = []
    for cells in (12, 24, 48):
        plate = grid(2 * cells, cells, 2.0, 1.0)
        D = getattr(diffusion_tensors(plate, constant_stress(plate, sign, 0.0), r=r, labelling=labelling), family)
        lam = diffusion_modes(plate, diffusion_operator(plate, D), 3).lam
        errors.append(np.abs(lam / exact - 1).max())
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2, abs=0.15)
    assert errors[2] < 5e-3


@pytest.mark.parametrize(("r", "exact"), [(1, [1, 1, np.pi**2 / 4, np.pi**2 / 4 + 1]), (10, [1, 1, 4, 4])])
def test_open_cylinder_spectrum_has_rate_two(r, exact):
    """Radius 1, height 2, r along the axis: r (p pi / 2)^2 + k^2, every k > 0 twice."""
    errors = []
    for cells in (24, 48):
        flat = grid(cells, cells // 2, 2 * np.pi, 2.0)
        keep = np.flatnonzero(flat.V[:, 0] < 2 * np.pi - 1e-9)
        home = np.arange(flat.n)
        home[len(keep) :] = np.arange(flat.n - len(keep))
        V = np.c_[np.cos(flat.V[:, 0]), np.sin(flat.V[:, 0]), flat.V[:, 1]][keep]
        tube = Surface(V, home[flat.F])
        axial = np.zeros((tube.m, 3, 3))
        axial[:, 2, 2] = 1
        lam = diffusion_modes(tube, diffusion_operator(tube, diffusion_tensors(tube, axial, r=r).major), 4).lam
        errors.append(np.abs(lam / np.array(exact) - 1).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.2)
    assert errors[1] < 2e-2


@zoo
def test_operator_without_anisotropy_is_the_cotangent_laplacian(name):
    surface = ZOO[name]()
    L = diffusion_operator(surface, diffusion_tensors(surface, tangent_stress(surface), r=1).major)
    C = -igl.cotmatrix(surface.V, surface.F)
    assert abs(L - C).max() <= 1e-12 * abs(C).max()


@zoo
@pytest.mark.parametrize("labelling", ["signed", "magnitude"])
@pytest.mark.parametrize("r", [10, 100])
def test_operator_is_the_laplacian_of_the_intrinsic_metric(name, r, labelling):
    """With D of determinant r in the plane, div(D grad) is sqrt(r) times the Laplacian of the metric D^-1."""
    surface = ZOO[name]()
    tensors = diffusion_tensors(surface, tangent_stress(surface), r=r, labelling=labelling, isotropy=0)
    for D in (tensors.major, tensors.minor):
        L = diffusion_operator(surface, D)
        metric = np.linalg.inv(D + np.einsum("mi,mj->mij", surface.normals, surface.normals))
        P = surface.V[surface.F]
        sides = np.roll(P, -2, axis=1) - np.roll(P, -1, axis=1)
        squared = np.einsum("mci,mij,mcj->mc", sides, metric, sides)
        C = -igl.cotmatrix_intrinsic(np.sqrt(squared), surface.F) * np.sqrt(r)
        assert abs(L - C).max() <= 1e-12 * abs(C).max()


@zoo
def test_the_diffusion_operator_is_symmetric_with_zero_row_sums(name):
    surface = ZOO[name]()
    L = diffusion_operator(surface, diffusion_tensors(surface, tangent_stress(surface)).major)
    assert abs(L - L.T).max() <= 1e-13 * abs(L).max()
    assert np.abs(L @ np.ones(surface.n)).max() <= 1e-11 * abs(L).max()


@zoo
def test_modes_solve_the_eigenproblem_and_are_scaled_as_on_the_unit_sphere(name):
    surface = ZOO[name]()
    L = diffusion_operator(surface, diffusion_tensors(surface, tangent_stress(surface), r=10).major)
    modes = diffusion_modes(surface, L, 5)
    mass = voronoi_mass(surface)
    gram = modes.X.T @ (mass[:, None] * modes.X)
    assert np.allclose(gram, np.eye(5) * surface.area / (4 * np.pi), atol=1e-9 * surface.area)
    residual = L @ modes.X - modes.lam * (mass[:, None] * modes.X)
    assert np.abs(residual).max() <= 1e-8 * modes.lam[-1] * mass.max() * np.abs(modes.X).max()
    assert np.all(np.diff(modes.lam) >= -1e-12 * modes.lam[-1])
    assert modes.lam[0] > 1e-6 / surface.area


def test_sphere_modes_are_the_linear_functions_in_the_order_of_the_axes():
    """lambda = 2 three times over: the canonical basis is x, y, z, each scaled by sqrt(3 / 4 pi) of the M-norm."""
    ball = sphere(4)
    modes = diffusion_modes(ball, diffusion_operator(ball, diffusion_tensors(ball, np.zeros((ball.m, 3, 3))).major), 3)
    assert modes.lam == pytest.approx([2, 2, 2], rel=1e-2)
    assert np.abs(modes.X - ball.V * np.sqrt(3 / (4 * np.pi))).max() < 1e-3


def test_modes_do_not_depend_on_the_numbering_of_the_mesh():
    surface = sphere(3)
    sigma = np.zeros((surface.m, 3, 3))
    base = diffusion_modes(surface, diffusion_operator(surface, diffusion_tensors(surface, sigma).major), 5)
    rng = np.random.default_rng(3)
    shuffle, faces = rng.permutation(surface.n), rng.permutation(surface.m)
    back = np.argsort(shuffle)
    other = Surface(surface.V[shuffle], back[surface.F][faces])
    again = diffusion_modes(other, diffusion_operator(other, diffusion_tensors(other, sigma).major), 5)
    assert again.lam == pytest.approx(base.lam, rel=1e-9)
    assert np.abs(again.X[back] - base.X).max() < 1e-6


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_size_scales_eigenvalues_and_leaves_modes_alone(scale):
    surface = ZOO["saddle"]()
    larger = Surface(surface.V * scale, surface.F)
    sigma = tangent_stress(surface)
    one, other = (
        diffusion_modes(s, diffusion_operator(s, diffusion_tensors(s, sigma).major), 4) for s in (surface, larger)
    )
    assert other.lam * scale**2 == pytest.approx(one.lam, rel=1e-8)
    assert np.abs(other.X - one.X).max() < 1e-6


def test_two_pieces_have_two_constant_modes_and_neither_is_returned():
    surface = ZOO["two pieces"]()
    L = diffusion_operator(surface, diffusion_tensors(surface, np.zeros((surface.m, 3, 3))).major)
    assert diffusion_modes(surface, L, 3).lam[0] > 1


def test_modes_beyond_the_vertices_are_refused():
    surface = grid(2, 2, 1.0, 1.0)
    L = diffusion_operator(surface, diffusion_tensors(surface, constant_stress(surface, 1, 0)).major)
    with pytest.raises(PatternError, match="the surface has 9; refine the mesh"):
        diffusion_modes(surface, L, 7)
    big = diffusion_modes(
        ZOO["flat"](),
        diffusion_operator(ZOO["flat"](), diffusion_tensors(ZOO["flat"](), constant_stress(ZOO["flat"](), 1, 0)).major),
        2,
    )
    with pytest.raises(PatternError, match="mode 3 does not exist; modes 1 to 2"):
        big.mode(3)
    assert np.array_equal(big.mode(2), big.X[:, 1])


@zoo
@pytest.mark.parametrize("labelling", ["signed", "magnitude"])
def test_tensors_have_the_directions_of_the_stress_and_eigenvalues_one_and_r(name, labelling):
    surface = ZOO[name]()
    sigma = tangent_stress(surface)
    tensors = diffusion_tensors(surface, sigma, r=50, labelling=labelling, isotropy=0)
    for D in (tensors.major, tensors.minor):
        assert np.allclose(np.linalg.eigvalsh(D), [0, 1, 50], atol=1e-9)
        assert np.abs(D @ sigma - sigma @ D).max() < 1e-9 * 50 * np.abs(sigma).max()  # they share eigenvectors
    total = tensors.major + tensors.minor
    P = np.eye(3) - np.einsum("mi,mj->mij", surface.normals, surface.normals)
    assert np.allclose(total, 51 * P, atol=1e-9)


def test_signed_follows_tension_and_magnitude_follows_the_larger_stress():
    plate = grid(2, 2, 1.0, 1.0)
    sigma = constant_stress(plate, -3.0, 1.0)  # compression along x, less tension along y
    assert diffusion_tensors(plate, sigma, r=7).major[0] == pytest.approx(np.diag([1, 7, 0]))
    assert diffusion_tensors(plate, sigma, r=7).principal[0] == pytest.approx([1, -3])
    assert diffusion_tensors(plate, sigma, r=7, labelling="magnitude").major[0] == pytest.approx(np.diag([7, 1, 0]))
    assert diffusion_tensors(plate, sigma, r=7, labelling="magnitude").minor[0] == pytest.approx(np.diag([1, 7, 0]))


@pytest.mark.parametrize("labelling", ["signed", "magnitude"])
def test_isotropic_faces_have_no_direction_and_gamma_reduces_their_number(labelling):
    plate = grid(20, 2, 1.0, 1.0)
    sigma = constant_stress(plate, 1.0, 1.0).copy()
    sigma[:, 0, 0] += np.linspace(0, 0.2, plate.m)
    shares = [diffusion_tensors(plate, sigma, gamma=g, labelling=labelling).isotropic.mean() for g in (0.2, 1, 50)]
    if labelling == "signed":
        assert shares[0] > shares[1] > shares[2]
    calm = diffusion_tensors(plate, constant_stress(plate, 2.0, 2.0), labelling=labelling)
    assert calm.isotropic.all()
    assert np.allclose(calm.major, np.diag([1, 1, 0]))
    nothing = diffusion_tensors(plate, np.zeros((plate.m, 3, 3)), labelling=labelling)
    assert nothing.isotropic.all()


def test_under_the_magnitude_rule_weak_stress_is_isotropic_until_gamma_raises_it():
    """The paper tunes the force magnitude where 'the original forces are too small'."""
    plate = grid(20, 2, 1.0, 1.0)
    sigma = constant_stress(plate, 1.0, 0.0).copy()
    sigma[:10] *= 1e-5
    weak = diffusion_tensors(plate, sigma, labelling="magnitude").isotropic
    assert weak[:10].all()
    assert not weak[10:].any()
    assert not diffusion_tensors(plate, sigma, labelling="magnitude", gamma=1e4).isotropic.any()


def test_a_stress_that_vanishes_in_the_plane_is_not_taken_for_the_normal():
    """Uniaxial stress: the eigenvalue 0 belongs to a direction in the plane as well as to the normal."""
    surface = jittered(ZOO["dome"](), 0)
    t = np.cross(surface.normals, [0.3, 0.2, 0.9])
    t /= np.linalg.norm(t, axis=1, keepdims=True)
    tensors = diffusion_tensors(surface, np.einsum("mi,mj->mij", t, t), r=9)
    assert np.abs(np.einsum("mij,mj->mi", tensors.major, surface.normals)).max() < 1e-12
    assert np.allclose(np.einsum("mi,mij,mj->m", t, tensors.major, t), 9)


def test_tensors_are_frozen():
    tensors = DiffusionTensors(np.eye(3)[None], np.eye(3)[None], [False], [[1, 0]])
    with pytest.raises(ValueError, match="read-only"):
        tensors.major[0, 0, 0] = 2


def test_a_repeated_eigenvalue_at_the_end_is_complete():
    # on two equal spheres the first eigenvalue is sixfold: cut after any of its modes, those before stay what they are
    one = sphere(2)
    surface = Surface(np.concatenate([one.V, one.V + [3.0, 0.4, 0.2]]), np.concatenate([one.F, one.F + one.n]))
    L = diffusion_operator(surface, np.broadcast_to(np.eye(3), (surface.m, 3, 3)))
    whole = diffusion_modes(surface, L, 6)
    assert np.ptp(whole.lam) < 1e-8
    for k in range(1, 6):
        assert np.allclose(diffusion_modes(surface, L, k).X, whole.X[:, :k], atol=1e-7)


def test_the_magnitude_rule_takes_a_tenth_of_the_smaller_stress_and_a_little_for_none():
    """|s1| + eps <= 1.1 (|s2| + eps) with eps = .1 of the reference: up to 1.1 |s2| + .01 of it."""
    sizes = np.array([[1.109, 1.0], [-1.111, 1.0], [0.009, 0.0], [0.011, 0.0], [-2.209, -2.0], [2.211, -2.0]])
    plate = grid(4, 4, 1.0, 1.0)
    rest = np.sqrt((plate.m - (sizes**2).sum() / 2) / (plate.m - len(sizes)))  # the reference is 2 then
    principal = np.concatenate([sizes, np.full((plate.m - len(sizes), 2), rest)])
    sigma = np.zeros((plate.m, 3, 3))
    sigma[:, [0, 1], [0, 1]] = 2 * principal
    found = diffusion_tensors(plate, sigma, labelling="magnitude", isotropy=0.1)
    assert found.isotropic[: len(sizes)].tolist() == [True, False] * 3


@pytest.mark.parametrize(("share", "is_isotropic"), [(0.016, True), (0.025, False)])
def test_a_face_has_no_direction_if_its_stresses_differ_by_less_than_a_fiftieth(share, is_isotropic):
    plate = grid(2, 2, 1.0, 1.0)
    sigma = np.tile(np.diag([1e6, (1 - share) * 1e6, 0.0]), (plate.m, 1, 1))
    assert (diffusion_tensors(plate, sigma).isotropic == is_isotropic).all()
