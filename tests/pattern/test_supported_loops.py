"""Rings and rays of stripes around small supported loops."""

import numpy as np
import pytest

import dsfab
from dsfab.core.arrays import unit_vectors
from dsfab.design.even_stripes import StripeDirections
from dsfab.design.surface_and_statics import statics_step
from dsfab.pattern import Frames, LoopSurroundings, StressDirections, cross_field
from dsfab.pattern.supported_loops import REACH, small_loops
from dsfab.results import Log
from tests.shapes import annulus, wrapped

INNER, SPACING = 0.2, 0.4


def ring():
    return annulus(48, 36, inner=INNER, outer=2.0)


def inner_edge(surface):
    return np.isclose(np.linalg.norm(surface.V[:, :2], axis=1), INNER)


def spiral(surface, angle):
    """Uniaxial stress that deviates everywhere by `angle` (degrees) from the direction away from the origin."""
    outwards = surface.centroids / np.linalg.norm(surface.centroids, axis=1)[:, None]
    square = np.cross([0.0, 0.0, 1.0], outwards)
    a = np.radians(angle)
    first = np.cos(a) * outwards + np.sin(a) * square
    second = np.cos(a) * square - np.sin(a) * outwards
    return StressDirections(np.tile([1.0, 0.0], (surface.m, 1)), np.stack([first, second], axis=1))


def test_a_small_loop_is_a_supported_boundary_loop_with_a_radius_below_the_spacing():
    surface = ring()
    inner, whole = inner_edge(surface), np.ones(surface.n, dtype=bool)
    (loop,) = small_loops(surface, inner, 1.1 * INNER)
    assert set(loop.tolist()) == set(np.flatnonzero(inner).tolist())
    assert small_loops(surface, inner, 0.9 * INNER) == []
    assert small_loops(surface, ~inner, SPACING) == []
    assert small_loops(surface, inner & (surface.V[:, 0] > 0), SPACING) == []
    assert len(small_loops(surface, whole, 3.0)) == 2


@pytest.mark.parametrize(("angle", "along_rays"), [(30, 1.0), (60, 0.0)])
def test_the_family_with_more_stress_along_rays_has_the_rays(angle, along_rays):
    surface = ring()
    frames, stress = Frames.for_surface(surface), spiral(surface, angle)
    loops = LoopSurroundings.from_support(frames, inner_edge(surface), SPACING)
    along = cross_field(frames, stress, 0.1, 0.0, [loop.guidance(frames, stress, 0.0) for loop in loops])
    radius = np.linalg.norm(surface.V, axis=1)
    cosine = np.einsum("nx,nx->n", along, surface.V) / radius
    assert np.abs(cosine[radius < INNER + 0.5 * SPACING]) == pytest.approx(along_rays, abs=0.05)
    beyond = radius > INNER + (REACH + 1) * SPACING
    assert np.abs(cosine[beyond]) == pytest.approx(np.cos(np.radians(angle)), abs=0.03)


def test_a_rotation_turns_rings_and_rays_as_well():
    surface = ring()
    frames, stress = Frames.for_surface(surface), spiral(surface, 30)
    (loop,) = LoopSurroundings.from_support(frames, inner_edge(surface), SPACING)
    straight, turned = (loop.guidance(frames, stress, turn) for turn in (0.0, 0.3))
    assert turned.square == pytest.approx(straight.square * np.exp(0.6j))


def umbrella():
    """A roof of 6 m x 5 m on a funnel off its middle."""

    def place(u, v):
        c, s = np.cos(2 * np.pi * u), np.sin(2 * np.pi * u)
        x, y = (1 - v) * 0.25 * c + v * (3.0 * c + 1.6), (1 - v) * 0.25 * s + v * (2.5 * s + 0.8)
        return x, y, 2.5 * v**0.4

    return wrapped(40, 24, place)


def test_stripes_form_rings_and_rays_at_the_head_of_a_column():
    """The stress has a singular point beside this head. Without guidance, rings become rays along the head."""
    surface, spacing = umbrella(), 0.6
    preset = dsfab.Preset(
        surface=surface,
        supports=[dsfab.Support(dsfab.Boundary(loop=1))],
        loads=[dsfab.SelfWeight()],
        statics={"thickness": 0.05},
        pattern={"method": "stripes", "major": {"spacing": spacing}, "minor": {"spacing": spacing}},
    )
    statics = statics_step(preset, surface, Log(None))
    along = StripeDirections.from_statics(preset, surface, statics, [spacing, spacing]).along
    loop = surface.loops[1]
    tangent = unit_vectors(surface.V[np.roll(loop, -1)] - surface.V[np.roll(loop, 1)])
    cosine = np.abs(np.einsum("kx,kx->k", along[loop], tangent))
    assert min(cosine.max(), (1 - cosine).max()) < 0.05
