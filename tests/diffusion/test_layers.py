"""Stress of all layers: closed forms of bent sheets, and laws that hold for any stress."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

import dsfab
from dsfab.design import draft
from dsfab.diffusion import layer_stress, principal_stresses
from dsfab.preset.file import load_preset
from dsfab.statics import sheet_stress, solve_for
from dsfab.surface import Surface
from dsfab.surface.fields import tangents
from dsfab.surface.shapes import cylinder
from tests.shapes import grid

THICK, PRESSURE, NU = 0.05, 1000.0, 0.3
STRESS = st.floats(-5, 5).map(lambda x: round(x, 3))
PLANE = st.tuples(STRESS, STRESS, STRESS)
TRIANGLE = Surface(np.array([[0.0, 0, 0], [1.0, 0.2, 0.1], [0.3, 0.9, -0.2]]), np.array([[0, 1, 2]]))


def in_space(surface, xx, yy, xy):
    """(1, 3, 3) the plane stress in the frame of a surface of one face."""
    t = tangents(surface)[0]
    return (t.T @ np.array([[xx, xy], [xy, yy]]) @ t)[None]


def shear(surface, membrane, bending, angle):
    """Mean over the thickness of the squared shear between axes at angles (k,): Simpson's rule, exact for squares."""
    t = tangents(surface)[0]
    a = np.outer(np.cos(angle), t[0]) + np.outer(np.sin(angle), t[1])
    b = np.outer(-np.sin(angle), t[0]) + np.outer(np.cos(angle), t[1])
    layers = ((1, -1.0), (4, 0.0), (1, 1.0))
    return sum(w / 6 * np.einsum("ki,ij,kj->k", a, (membrane + z * bending)[0], b) ** 2 for w, z in layers)


@settings(max_examples=60, deadline=None)
@given(PLANE, PLANE)
def test_axes_have_the_least_shear_and_sizes_are_root_mean_squares(flat, bent):
    membrane, bending = in_space(TRIANGLE, *flat), in_space(TRIANGLE, *bent)
    values, axes = principal_stresses(TRIANGLE, layer_stress(TRIANGLE, membrane, bending))
    values, axes = values[0], axes[0]
    scale = np.abs(membrane).max() + np.abs(bending).max()
    assume(scale > 0.01 and abs(values[0] - values[1]) > 1e-3 * scale)  # else any axes will do
    t = tangents(TRIANGLE)[0]
    at = np.arctan2(axes[0] @ t[1], axes[0] @ t[0])
    least = shear(TRIANGLE, membrane, bending, np.linspace(0, np.pi / 2, 721)).min()
    assert shear(TRIANGLE, membrane, bending, np.array([at]))[0] <= least + 1e-4 * scale**2
    for value, axis in zip(values, axes, strict=True):
        tractions = [(w / 6, (membrane[0] + z * bending[0]) @ axis) for w, z in ((1, -1.0), (4, 0.0), (1, 1.0))]
        assert value**2 == pytest.approx(sum(w * (q @ q) for w, q in tractions), abs=1e-6 * scale**2)
        along = axis @ membrane[0] @ axis
        if abs(along) > 1e-6 * scale and np.abs(membrane).max() > 0.01 * np.abs(bending).max():
            assert np.sign(value) == np.sign(along)


@settings(max_examples=40, deadline=None)
@given(PLANE, PLANE, st.integers(0, 10**6), st.floats(1e-3, 1e6))
def test_layer_stress_turns_with_the_sheet_and_scales_with_sign_and_unit(flat, bent, seed, unit):
    membrane, bending = in_space(TRIANGLE, *flat), in_space(TRIANGLE, *bent)
    found = layer_stress(TRIANGLE, membrane, bending)
    scale = np.abs(membrane).max() + np.abs(bending).max()
    values = principal_stresses(TRIANGLE, found)[0]
    along = principal_stresses(TRIANGLE, membrane)[0]
    # where an axis is free of mean stress its sign is rounding
    assume(scale > 0.01 and np.abs(along).min() > 1e-3 * scale and np.abs(np.diff(np.abs(values))).max() > 1e-3 * scale)
    delta = complex(flat[0] - flat[1], 2 * flat[2]) ** 2 + complex(bent[0] - bent[1], 2 * bent[2]) ** 2 / 3
    assume(abs(delta) > 1e-3 * scale**2)
    near = np.einsum(
        "mai,mij,maj->ma", principal_stresses(TRIANGLE, found)[1], membrane, principal_stresses(TRIANGLE, found)[1]
    )
    assume(np.abs(near).min() > 1e-6 * scale)
    R = Rotation.random(random_state=seed).as_matrix()
    turned = layer_stress(Surface(TRIANGLE.V @ R.T, TRIANGLE.F), R @ membrane @ R.T, R @ bending @ R.T)
    assert_allclose(turned, R @ found @ R.T, rtol=0, atol=1e-6 * scale)
    assert_allclose(layer_stress(TRIANGLE, -membrane, -bending), -found, rtol=0, atol=1e-9 * scale)
    assert_allclose(
        layer_stress(TRIANGLE, unit * membrane, unit * bending), unit * found, rtol=0, atol=1e-9 * unit * scale
    )
    over = Surface(TRIANGLE.V, TRIANGLE.F[:, ::-1])  # its bottom is the other side
    assert_allclose(layer_stress(over, membrane, -bending), found, rtol=0, atol=1e-6 * scale)


def test_a_membrane_keeps_its_stress_to_the_bit():
    surface = grid(3, 3, 1.0, 1.0)
    planar = np.random.default_rng(0).normal(size=(surface.m, 3))
    sigma = np.zeros((surface.m, 3, 3))
    sigma[:, 0, 0], sigma[:, 1, 1], sigma[:, 0, 1] = planar.T
    sigma[:, 1, 0] = sigma[:, 0, 1]
    assert np.array_equal(layer_stress(surface, sigma, np.zeros_like(sigma)), sigma)
    some = np.zeros_like(sigma)
    some[0] = sigma[1]
    assert np.array_equal(layer_stress(surface, sigma, some)[1:], sigma[1:])


@pytest.mark.parametrize("little", [1e-6, 1e-3, 1e-2])
def test_pure_shear_keeps_its_axes_beside_a_little_bending_at_45_degrees(little):
    """n n^T / t + 12 m m^T / t^3 has none of its own there, and would be led by that little: 45 degrees off."""
    membrane, bending = in_space(TRIANGLE, 1.0, -1.0, 0.0), in_space(TRIANGLE, little, -little / 2, 1.5 * little)
    axis = principal_stresses(TRIANGLE, layer_stress(TRIANGLE, membrane, bending))[1][0, 0]
    assert abs(axis @ tangents(TRIANGLE)[0, 0]) > np.cos(little)
    squares = membrane @ membrane + bending @ bending / 3
    blind = principal_stresses(TRIANGLE, squares)[1][0, 0]
    assert abs(blind @ tangents(TRIANGLE)[0, 0]) < np.cos(np.radians(15))


def loaded_sheet(surface, at, **statics):
    return dsfab.Preset(
        surface=surface,
        supports=at,
        loads=[dsfab.Pressure(PRESSURE)],
        statics={"thickness": THICK, "young": 30e9, "poisson": NU, "stress": "layers", **statics},
    )


def layers_of(preset):
    """The design and its stress of all layers by the elements for stress."""
    design = draft(preset)
    load = design.statics.load
    model = preset.statics.sheet().model_for(design.surface)
    one = solve_for(model, {"load": load}, "stress")["load"]
    stress = sheet_stress(model, one.elements, one)
    membrane = stress.tensor("middle")
    return design, layer_stress(design.surface, membrane, stress.tensor("bottom") - membrane)


def test_a_strip_on_its_ends_is_followed_along_its_bending():
    """Cylindrical bending: M = q x (L - x) / 2 along the strip, 6 M / h^2 at its sides, over root 3 in the mean; the
    free sides let it curl, so that across it there is next to nothing."""
    surface = grid(40, 6, 4.0, 0.6)
    ends = [dsfab.Support({"pick": "side", "axis": "x", "end": end}) for end in ("min", "max")]
    design, sigma = layers_of(loaded_sheet(surface, ends))
    values, axes = principal_stresses(surface, sigma)
    x = surface.centroids[:, 0]
    inner = (x > 0.6) & (x < 3.4)
    larger = np.abs(values).argmax(axis=1)
    along = axes[np.arange(surface.m), larger]
    assert np.degrees(np.arccos(np.clip(np.abs(along[inner, 0]), 0, 1))).max() < 5
    middle = np.abs(x - 2.0) < 0.15
    exact = 6 * PRESSURE * (x * (4 - x) / 2)[middle] / THICK**2 / np.sqrt(3)
    assert np.abs(values[middle]).max(axis=1).mean() == pytest.approx(exact.mean(), rel=0.03)
    # the pipeline follows the same axes
    followed = principal_stresses(surface, design.statics.cases["load"].followed_stress)[1]
    turned = np.abs(np.einsum("mi,mki->mk", along, followed)).max(axis=1)
    assert np.degrees(np.arccos(np.clip(turned[inner], 0, 1))).max() < 1e-3


def navier(x, y, a, terms=79):
    """(k, 2, 2) curvature moments of a simply supported square plate under q = 1 at points (k,), origin in a corner
    [Navier 1823; Timoshenko and Woinowsky-Krieger 1959, art. 28]."""
    odd = np.arange(1, terms, 2)
    i, j = (each.ravel()[:, None] for each in np.meshgrid(odd, odd))
    w = 16 / (np.pi**6 * i * j * (i**2 + j**2) ** 2) * a**4
    si, sj, ci, cj = (
        f(k * np.pi * z / a) for f, k, z in ((np.sin, i, x), (np.sin, j, y), (np.cos, i, x), (np.cos, j, y))
    )
    xx, yy = (w * (k * np.pi / a) ** 2 * si * sj for k in (i, j))
    xy = -w * (i * j * np.pi**2 / a**2) * ci * cj
    xx, yy, xy = (each.sum(axis=0) for each in (xx, yy, xy))
    return np.stack([np.stack([xx + NU * yy, (1 - NU) * xy], 1), np.stack([(1 - NU) * xy, yy + NU * xx], 1)], 1)


def test_a_square_plate_is_followed_along_naviers_moments():
    """Within 2 degrees wherever the principal moments differ by a fifth of the largest one."""
    surface, a = grid(24, 24, 2.0, 2.0), 2.0
    _, sigma = layers_of(loaded_sheet(surface, [dsfab.Support(dsfab.Boundary())]))
    x, y = surface.centroids[:, :2].T
    moments = navier(x, y, a)
    value, axis = np.linalg.eigh(moments)
    clear = (value[:, 1] - value[:, 0] > 0.2 * np.abs(value).max()) & (surface.areas > 0)
    inside = np.minimum.reduce([x, y, a - x, a - y]) > 0.1
    _, found = principal_stresses(surface, sigma)
    cosines = np.abs(np.einsum("mi,mki->mk", axis[:, :, 1], found[:, :, :2])).max(axis=1)
    off = np.degrees(np.arccos(np.clip(cosines, 0, 1)))[clear & inside]
    assert len(off) > 300
    assert off.max() < 2


@pytest.mark.slow
def test_a_clamped_pipe_bends_along_its_axis_at_the_edge_and_has_hoop_tension_elsewhere():
    """With b^4 = 3 (1 - nu^2) / (R h)^2, x from the edge: M = p / (2 b^2) e^(-bx) (cos bx - sin bx) along the pipe and
    N = p R (1 - e^(-bx) (cos bx + sin bx)) around it [Timoshenko and Woinowsky-Krieger 1959, art. 114]."""
    R, H, h = 1.0, 2.0, 0.05
    surface = cylinder(radius=R, height=H, edge=0.07)
    edges = [dsfab.Support(dsfab.Boundary(), "xyz", clamp=True)]
    loads = {"thickness": h, "membrane": "hybrid", "bending": "hhj"}
    _, sigma = layers_of(loaded_sheet(surface, edges, **loads))
    up = np.array([0, 0, 1.0])
    around = np.cross(up, surface.centroids * [1, 1, 0])
    around /= np.linalg.norm(around, axis=1, keepdims=True)
    size = [np.sqrt(np.einsum("mi,mij,mjk,mk->m", e, sigma, sigma, e)) for e in (around, np.tile(up, (surface.m, 1)))]
    z = surface.centroids[:, 2]
    x = np.minimum(z - z.min(), z.max() - z) + (z.min() - surface.V[:, 2].min())
    b = (3 * (1 - NU**2)) ** 0.25 / np.sqrt(R * h)
    N = PRESSURE * R * (1 - np.exp(-b * x) * (np.cos(b * x) + np.sin(b * x)))
    M = PRESSURE / (2 * b**2) * np.exp(-b * x) * (np.cos(b * x) - np.sin(b * x))
    along = 6 * M / h**2
    hoop = np.sqrt((N / h) ** 2 + (NU * along) ** 2 / 3)
    scale, middle = PRESSURE * R / h, x > 3 / b
    assert np.abs(size[0] - hoop)[~middle].mean() < 0.05 * scale
    edge = x < 0.3 / b
    assert size[1][edge].mean() == pytest.approx((np.abs(along[edge]) / np.sqrt(3)).mean(), rel=0.12)
    assert (size[1] > 2 * size[0])[edge].all()  # the membrane alone has it the other way round: 0.3 of what is around
    assert size[0][middle].mean() == pytest.approx(scale, rel=0.03)
    axes = principal_stresses(surface, sigma)[1]
    turned = np.abs(np.einsum("mki,mi->mk", axes, around)).max(axis=1)
    assert np.degrees(np.arccos(np.clip(turned, 0, 1))).max() < 5


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "share"), [("tower", "small"), pytest.param("snow_vault", "large", marks=pytest.mark.slow)]
)
def test_auto_follows_the_layers_where_bending_stores_the_energy(name, share):
    changes = {"surface.edge": 0.8}
    plain, auto, layers = (
        draft(load_preset(name, changes | {"statics.stress": stress})) for stress in ("membrane", "auto", "layers")
    )
    kept = list(plain.statics.cases)
    assert all(one.layered is None for one in plain.statics.cases.values())
    assert all(one.layered is not None for one in layers.statics.cases.values())
    same = plain if share == "small" else layers
    for case in kept:
        assert np.array_equal(auto.statics.cases[case].followed_stress, same.statics.cases[case].followed_stress)
    assert np.array_equal(auto.diffusion.tensors.major, same.diffusion.tensors.major)
    told = [note.text for note in plain.notes if 'statics.stress = "layers" may give' in note.text]
    assert bool(told) == (share == "large")


def test_a_sheet_in_its_plane_has_one_layer():
    plain, layers = (
        draft(load_preset("cantilever", {"surface.edge": 0.1, "statics.stress": stress}))
        for stress in ("membrane", "layers")
    )
    assert np.array_equal(plain.diffusion.tensors.major, layers.diffusion.tensors.major)
    assert layers.statics.cases["load"].layered is None
