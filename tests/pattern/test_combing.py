"""Families that change names where the principal stresses cross: closed forms on a plate, then rings of revolution."""

import numpy as np
import pytest

import dsfab
from dsfab.design.directions import Steering
from dsfab.design.even_stripes import stripe_directions
from dsfab.design.output.archive import even_arrays, even_stripes_from
from dsfab.design.pattern_measures import pattern_chart
from dsfab.pattern import Frames, Images, StressDirections, family_crossings
from dsfab.preset.file import load_preset, with_overrides
from dsfab.preset.model import Pattern
from dsfab.surface import Surface
from tests.shapes import grid, jittered, two_pieces

PLATE = jittered(grid(24, 24, 1.0, 1.0), 0.2)
X, Y = PLATE.V[:, 0], PLATE.V[:, 1]


def upright_where(marked: np.ndarray, angle: float = 0.0) -> np.ndarray:
    """(n, 3) directions along x, and along y where marked, all turned by an angle; signs at random."""
    a = angle + np.where(marked, np.pi / 2, 0.0)
    sign = np.random.default_rng(0).choice([-1.0, 1.0], len(a))
    return np.c_[np.cos(a) * sign, np.sin(a) * sign, 0 * a]


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.2])
@pytest.mark.parametrize("inside", [X > 0.7, np.hypot(X - 0.4, Y - 0.5) < 0.25, np.abs(Y - 0.5) > 0.35])
def test_the_smaller_regions_change_names(inside, angle):
    over = family_crossings(Frames.for_surface(PLATE), upright_where(inside, angle))
    assert (over == (inside if inside.mean() < 0.5 else ~inside)).all()


def test_regions_in_each_other_change_names_in_turns():
    r = np.hypot(X - 0.5, Y - 0.5)
    ring = (r > 0.15) & (r < 0.35)
    assert (family_crossings(Frames.for_surface(PLATE), upright_where(ring)) == ring).all()


def test_an_open_curve_and_a_smooth_turn_exchange_no_families():
    """Across y = 1/2 the direction is another one only left of x = 1/2: from there it turns back, little by little."""
    open_curve = np.where(Y > 0.5, 1.0, -1.0) * np.pi / 4 * np.clip(1.5 - 2 * X, 0, 1)
    a = np.c_[np.cos(open_curve), np.sin(open_curve), 0 * X]
    jump = np.abs((a[PLATE.edges.ends[:, 0]] * a[PLATE.edges.ends[:, 1]]).sum(axis=1)) < 0.1
    assert jump.any()
    assert not family_crossings(Frames.for_surface(PLATE), a).any()
    smooth = np.c_[np.cos(3 * X), np.sin(3 * X), 0 * X]
    assert not family_crossings(Frames.for_surface(PLATE), smooth).any()


def test_pieces_are_named_by_themselves():
    pieces = two_pieces()
    along = np.tile(np.array([1.0, 0, 0]), (pieces.n, 1))
    assert not family_crossings(Frames.for_surface(pieces), along).any()


@pytest.mark.parametrize("jitter", [0.0, 0.2])
def test_crossing_principal_stresses_are_detected_before_smoothing(jitter):
    """Around a point the larger stress is that along the rays inside of a circle, and that around outside; over a
    length in which they differ little no direction is clear near the circle, and no region was told from another."""
    plate = jittered(grid(24, 24, 1.0, 1.0), jitter)
    out = plate.centroids - [0.5, 0.5, 0]
    r = np.linalg.norm(out, axis=1, keepdims=True)
    ray, around = out / r, np.c_[-out[:, 1], out[:, 0], 0 * r] / r
    inside = r < 0.3
    stress = np.stack([1 + np.abs(r[:, 0] - 0.3), np.ones(plate.m)], axis=1)
    given = StressDirections(stress, np.stack([np.where(inside, ray, around), np.where(inside, around, ray)], axis=1))
    frames, steer = Frames.for_surface(plate), Steering(0.0, (), None)
    along, over = stripe_directions(Pattern(method="stripes"), frames, given, steer, Images.identity(plate.n), 0.2)
    at = plate.V - [0.5, 0.5, 0]
    far = np.linalg.norm(at, axis=1)
    assert not over[far > 0.34].any()
    assert over[(far < 0.26) & (far > 0.05)].all()
    clear = far > 0.12
    turned = np.abs(np.einsum("ni,ni->n", along, at))[clear] / far[clear]
    assert turned.max() < 0.3


def swelling_ring(r: float, across: float, up: float, waves: float = 0.0, around: int = 72, about: int = 20) -> Surface:
    """A closed ring about y: an ellipse of half-axes across and up, whose distance from the axis swells in waves."""
    i, j = np.meshgrid(np.arange(around), np.arange(about), indexing="ij")
    a, b = 2 * np.pi * (i + j / 2) / around, 2 * np.pi * j / about  # staggered: rings do not close on themselves
    radius = r + across * np.cos(b) + waves * np.cos(2 * b)
    V = np.stack([radius * np.cos(a), up * np.sin(b), -radius * np.sin(a)], axis=2).reshape(-1, 3)

    def at(di: int, dj: int) -> np.ndarray:
        wrap = (j + dj) // about  # the seam is about / 2 columns further on
        return ((i + di + wrap * (about // 2)) % around * about + (j + dj) % about).ravel()

    F = np.concatenate([np.c_[at(0, 0), at(1, 0), at(0, 1)], np.c_[at(1, 0), at(1, 1), at(0, 1)]])
    return Surface(V, F)


RINGS = ((1.0, 0.25, 0.25, 0.0), (1.0, 0.2, 0.3, 0.05), (0.8, 0.3, 0.2, 0.0))


@pytest.fixture(scope="module", params=[RINGS[0], *(pytest.param(one, marks=pytest.mark.slow) for one in RINGS[1:])])
def pressed(request, tmp_path_factory):
    """Rings that stand on their lowest circle and are pressed on their highest."""
    surface = swelling_ring(*request.param)
    path = tmp_path_factory.mktemp("ring") / "ring.obj"
    rows = [("v", *v) for v in surface.V.tolist()] + [("f", *f) for f in (surface.F + 1).tolist()]
    path.write_text("\n".join(" ".join(map(str, row)) for row in rows))
    changes = {"surface.file": str(path), "pattern.keep": 0.0, "pattern.fillet": 0.0}
    return dsfab.run(with_overrides(load_preset("figurine"), changes))


def test_members_of_a_ring_go_on_where_the_stresses_cross(pressed):
    even = pressed.pattern.even
    assert even.steered is not None
    assert 0.05 < pressed.surface.areas @ even.steered.over / pressed.surface.area < 0.5
    assert "change their family" in even.steered.told
    quality = pressed.quality()
    assert quality.major.evenness < 1.3
    assert quality.minor.evenness < 2.2
    assert quality.dead_ends == 0
    assert quality.slits == 0
    assert quality.major.deviation < 8
    assert quality.symmetry_error < 0.02


def test_an_archive_keeps_where_names_have_changed(pressed):
    even = pressed.pattern.even
    back = even_stripes_from(pressed.surface, even_arrays(even))
    assert (back.steered.over == even.steered.over).all()
    assert (back.steered.along == even.steered.along).all()
    assert pattern_chart(pressed) is even.chart
