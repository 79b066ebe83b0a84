"""Seams of STEP by members that go on beyond corners that a fillet fills: by hand, and by OCCT (slow)."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dsfab.export.cad.step.by_members import draft
from dsfab.export.cad.step.by_members.curves import parts_of
from dsfab.export.cad.step.by_members.draft import NetWriter, member_draft
from dsfab.export.cad.step.by_members.fillet_edges import (
    FILLET_SHARE,
    LARGE_FILLET_SHARE,
    POLE_OFFSET,
    TANGENT_GAP,
    LongSeam,
    curves_beyond,
    with_long_seams,
    with_ordered_walls,
)
from dsfab.export.cad.step.by_members.model import NetEdge, NetModel, NetPatch, NetWall, backwards, filled_corners
from dsfab.export.cad.step.by_members.trimmed import TrimmedFace
from dsfab.export.cad.step.entities import StepEntities, closing, header
from dsfab.export.cad.step.shared.plan import SolidPlan
from dsfab.export.cad.step.worker import use
from dsfab.export.cad.step.worker.shapes import is_valid
from dsfab.export.cad.step.worker.shapes import read as read_shape
from dsfab.export.part import StripedSheet
from dsfab.export.splines import bernstein
from dsfab.surface import Surface
from tests.export.member_networks import RADIUS, cylinder_strip, draft_of, striped

THICK = 40.0

NOTCH = np.array([[0, 0], [100, 50], [100, -100], [0, -100], [-100, -100], [-100, 50.0]])
"""A plate with a seam from 3 to the corner 0, where the void turns by 127 degrees."""

STEP = np.array([[0, 0], [100, 50], [100, -100], [0, -100], [-100, -100], [-100, 100], [0, 100.0]])
"""One whose seam from 3 to the corner 0 goes straight on to 6."""

BENT = np.array([[0, 0], [33, 10], [27, -78], [-2, -79], [-11, -82], [-14, 3.0]])
"""One like the first whose void turns by 30 degrees, to be bent."""

Way = tuple[float, float]


def dish_points(points: np.ndarray, wave: float = 0.0, bend: Way = (0, 0)) -> np.ndarray:
    """(k, 6) on both skins of a dish, which may have waves; it is bent in the plane by as much as `bend` at 80 mm."""
    x, y = points.T
    points = points + np.c_[bend[0] * (y / 80) ** 2, bend[1] * (x / 80) ** 2]
    z = wave * np.sin(x / 40) * np.cos(y / 50 + 0.3) - (x**2 + 0.5 * x * y + y**2) / 2000
    return np.c_[points, z + THICK / 2, points, z - THICK / 2]


def patch_poles(corners: np.ndarray, wave: float, bend: Way) -> np.ndarray:
    """(4, 4, 6) of the cubics through the dish over a quadrangle (4, 2)."""
    x = np.linspace(0, 1, 4)
    u, v = x[:, None, None], x[None, :, None]
    a, b, c, d = corners
    at = (1 - u) * (1 - v) * a + u * (1 - v) * b + u * v * c + (1 - u) * v * d
    B = np.linalg.inv(bernstein(x))
    return np.einsum("ai,bj,ijk->abk", B, B, dish_points(at.reshape(-1, 2), wave, bend).reshape(4, 4, 6))


def dish(points: np.ndarray, one: list[int], four: list[int], ahead: bool, wave: float, bend: Way = (0, 0)) -> NetModel:
    """A patch over a loop of points with four corners, and one beside the seam from 3 to 0, with a wall along each of
    their other edges; the seam runs to the corner, or from there."""
    first, second = (patch_poles(points[quad], wave, bend) for quad in (four, [3, 2, 1, 0]))
    right = parts_of(first[None, 3], np.zeros(1), np.full(1, 1.0 if len(one) == 4 else 0.5))[0]
    second[0], beyond = right, parts_of(first[None, 3], np.full(1, 0.5), np.ones(1))[0]
    model = NetModel(vertices=list(dish_points(points, wave, bend)))
    model.edges.append(NetEdge(3, 0, right) if ahead else NetEdge(0, 3, right[::-1]))
    around = [first[::-1, 3], first[0, ::-1], first[:, 0]]
    both = (
        (first, [*one[2:], *one[:2]], [beyond, *around] if len(one) == 5 else around),
        (second, [3, 2, 1, 0], [second[:, 0], second[3], second[::-1, 3]]),
    )
    for i, (P, loop, sides) in enumerate(both):
        steps = [(len(model.edges) + k, True) for k in range(len(sides))]
        model.edges += [NetEdge(a, b, side) for (a, b), side in zip(pairwise(loop), sides, strict=True)]
        model.walls += [NetWall([step], model.poles(step)) for step in steps]
        model.patches.append(NetPatch([*steps, (0, ahead != bool(i))], P))
    return model


def notch(ahead: bool = True, wave: float = 0.0) -> NetModel:
    return dish(NOTCH, [4, 3, 0, 5], [4, 3, 0, 5], ahead, wave)


def stair(ahead: bool = True, wave: float = 0.0) -> NetModel:
    return dish(STEP, [4, 3, 0, 6, 5], [4, 3, 6, 5], ahead, wave)


def mirrored(model: NetModel) -> NetModel:
    """The same in a mirror, where outlines run the other way."""
    flip = np.array([-1, 1, 1, -1, 1, 1])
    walls = [NetWall(backwards(wall.steps), wall.poles[::-1] * flip) for wall in model.walls]
    patches = [NetPatch(backwards(patch.loop), (patch.poles * flip).swapaxes(0, 1)) for patch in model.patches]
    edges = [replace(edge, poles=edge.poles * flip) for edge in model.edges]
    return replace(model, vertices=[v * flip for v in model.vertices], edges=edges, walls=walls, patches=patches)


def over(P: np.ndarray, uv: np.ndarray, x: np.ndarray) -> np.ndarray:
    """(k, 6) points of a patch at shares of a line over it."""
    at = uv[0] + x[:, None] * (uv[1] - uv[0])
    return np.einsum("ka,kb,abi->ki", bernstein(at[:, 0]), bernstein(at[:, 1]), P)


@pytest.mark.parametrize("ahead", [True, False])
def test_the_seam_at_a_corner_that_is_filled_goes_on_over_both_patches(ahead):
    model, _, seams = with_long_seams(given := notch(ahead), [])
    x, poles = np.linspace(0, 1, 9), seams[0].poles
    assert set(seams[0].on) == {0, 1}
    for i, uv in seams[0].on.items():
        assert np.abs(over(model.patches[i].poles, uv[0], x) - bernstein(x) @ poles).max() < 1e-9
        assert ((uv >= -1e-12) & (uv <= 1 + 1e-12)).all()
    start, end = poles[:, :2][[0, -1]] if ahead else poles[:, :2][[-1, 0]]
    np.testing.assert_allclose(start, NOTCH[3], atol=1e-9)
    half = filled_corners(given)[0].half
    assert end == pytest.approx([0, FILLET_SHARE * THICK * half], abs=0.1 * THICK)
    assert end[1] > THICK / 8 * half


@pytest.mark.parametrize("ahead", [True, False])
def test_wall_edges_beside_a_long_seam_lie_on_their_patches(ahead):
    model, _, seams = with_long_seams(given := notch(ahead), [])
    (corner,) = filled_corners(given)
    assert set(seams) == {0, *corner.beside}
    x = np.linspace(0, 1, 9)
    for e in corner.beside:
        ((i, uv),) = seams[e].on.items()
        assert e in {k for k, _ in given.patches[i].loop}
        np.testing.assert_array_equal(seams[e].poles, given.edges[e].poles)
        assert np.abs(over(model.patches[i].poles, uv[0], x) - bernstein(x) @ seams[e].poles).max() < 1e-9


def test_a_corner_that_is_cut_off_and_one_with_two_seams_are_left():
    model = notch()
    assert [corner.vertex for corner in filled_corners(model)] == [0]
    assert list(curves_beyond(model)) == [0]
    two = replace(model, edges=[*model.edges, NetEdge(0, 4, np.linspace(model.vertices[0], model.vertices[4], 4))])
    assert curves_beyond(two) == {}
    assert curves_beyond(replace(model, seam=True)) == {}


def test_a_seam_continues_over_a_trimmed_face_only_if_the_face_contains_it():
    model = notch()
    x = np.linspace(-130, 130, 3)
    flat = np.stack(np.meshgrid(x, x, indexing="ij"), axis=2).reshape(-1, 2)
    B = np.linalg.inv(np.stack([(1 - u) ** np.array([2, 1, 0]) * u ** np.arange(3) * [1, 2, 1] for u in (0, 0.5, 1)]))
    both = np.einsum("ai,bj,ijk->abk", B, B, dish_points(flat).reshape(3, 3, 6))
    face = TrimmedFace([model.patches[0].loop], both[..., :3], both[..., 3:], (np.eye(3), np.eye(3)), 0.0, 0.0)
    one = replace(model, patches=model.patches[1:])
    new, (found,), seams = with_long_seams(one, [face])
    assert np.abs(found.gaps(bernstein(x / 260 + 0.5) @ seams[0].poles)).max() < 1e-9
    near, far = (replace(face, outer=face.outer + [0, 0, gap]) for gap in (0.5e-6, 2e-6))
    assert with_long_seams(one, [near])[2]
    assert with_long_seams(one, [far])[2] == {}
    assert new.patches[0].within


def test_a_seam_that_a_wall_continues_ends_beside_a_wider_patch():
    model, _ = with_ordered_walls(stair(ahead=False), [])
    (corner,) = filled_corners(model)
    assert (corner.seam, corner.end) == (0, 1)
    assert model.edges[0].end == 0
    new, _, seams = with_long_seams(model, [])
    assert seams == {}
    assert [patch.within for patch in new.patches] == [True, True]
    assert new.patches[0].poles[3, :, 0] == pytest.approx(np.full(4, THICK / 100), rel=0.01)


def test_the_patch_beyond_a_long_seam_is_extended_until_its_tangents_leave_the_gap():
    model, _ = with_ordered_walls(stair(ahead=False), [])
    patch, (corner,) = with_long_seams(model, [])[0].patches[1], filled_corners(model)
    far = LARGE_FILLET_SHARE * THICK * corner.half
    went = patch.poles[0, 3, 1]
    assert far / 2 < went < far
    assert (far - went) ** 2 / 2000 == pytest.approx(TANGENT_GAP, rel=0.1)  # its height is -y^2 / 2000


def test_a_seam_beside_a_trimmed_face_is_moved_within_its_tolerance():
    model, _ = with_ordered_walls(stair(ahead=False), [])
    face = TrimmedFace([model.patches[1].loop], *np.zeros((2, 3, 3, 3)), (np.eye(3), np.eye(3)), 0.0, 0.0)
    new, _, _ = with_long_seams(replace(model, patches=model.patches[:1]), [face])
    off = new.edges[0].poles - model.edges[0].poles
    assert np.linalg.norm(off[1, :3]) == pytest.approx(POLE_OFFSET)
    np.testing.assert_array_equal(off[[0, 2, 3]], 0)
    assert with_long_seams(model, [])[0].edges == model.edges


def chevron() -> tuple[Surface, StripedSheet]:
    """Members around an opening in a part of a sphere, bent in its middle, where a seam ends at a corner that a fillet
    fills, and at one that it cuts off."""
    a, b = np.meshgrid(np.linspace(-0.5, 0.5, 41), np.linspace(-0.3, 0.3, 25), indexing="ij")
    c = b + 0.6 * np.abs(a)
    V = RADIUS * np.stack([np.cos(c) * np.cos(a), np.cos(c) * np.sin(a), np.sin(c)], axis=2).reshape(-1, 3)
    surface = Surface(V, cylinder_strip(40, 24).F)
    x, y = (at.ravel()[surface.F].mean(axis=1) for at in (a, b))
    beside = np.abs(x) > 0.3
    label = np.where(beside, 1, np.where(y > 0, 2, 3)) + 4 * (x > 0)
    return surface, striped(surface, beside | (np.abs(y) > 0.1), label.astype(np.int64))


@pytest.mark.slow
def test_occt_rounds_more_corners_of_an_opening_whose_seams_go_on(tmp_path, monkeypatch):
    """7 of 12, where they end at corners; those that are left turn by 122 degrees."""
    part, _, _ = draft_of(*chevron())
    monkeypatch.setattr(use, "FILLETS", 12)
    found = list[tuple[int, int]]()
    for _ in range(2):
        (path := tmp_path / "chevron.step").write_text(member_draft(part, SolidPlan(part)).text)
        shape = read_shape(path)
        assert is_valid(shape)
        found.append(use.fillet_counts(shape))
        monkeypatch.setattr(draft, "with_long_seams", lambda model, faces: (model, faces, {}))
    assert [tried for _, tried in found] == [12, 12]
    assert found[0][0] >= 10 > found[1][0] + 2


@pytest.mark.slow
@pytest.mark.parametrize("given", [notch, stair, lambda wave: mirrored(stair(wave=wave))])
def test_occt_reads_seams_with_their_places_on_faces_and_rounds_the_corner(given, tmp_path):
    model, _ = with_ordered_walls(given(wave=4.0), [])
    model, _, seams = with_long_seams(model, [])
    shape, text = read(model, seams, tmp_path)
    assert sum("=PCURVE(" in entity for entity in text) == 2 * sum(len(seam.on) for seam in seams.values())
    assert is_valid(shape)
    good, tried = use.fillet_counts(shape)
    assert good == tried > 4


@pytest.mark.slow
def test_occt_keeps_a_long_seam_if_the_walls_beside_it_have_parameters(tmp_path):
    """It puts the end of one to the end of the other, if they are .1 um apart, and drops what is beyond."""
    model, _ = with_ordered_walls(dish(BENT, [4, 3, 0, 5], [4, 3, 0, 5], False, 20.0, (37, 36)), [])
    model, _, seams = with_long_seams(model, [])
    both = [use.fillet_counts(read(model, some, tmp_path)[0]) for some in (seams, {0: seams[0]})]
    assert both[0] == (6, 6)
    assert both[1][0] < both[1][1] == 6


def read(model: NetModel, seams: dict[int, LongSeam], folder: Path) -> tuple[Any, list[str]]:
    """What OCCT reads of a model with such seams, and its entities."""
    faces = NetWriter(new := StepEntities(), model, THICK).faces([], seams)
    end = closing(np.zeros(len(faces), int), [[0]], np.array(faces), new.free, "dish")
    (path := folder / "dish.step").write_text("".join([header("dish", "dish", 1), *new.text, *end]))
    return read_shape(path), new.text


def test_patches_extend_a_tenth_farther_than_the_seam_between_them():
    model, _, seams = with_long_seams(notch(), [])
    past = seams[0].poles[-1, 1]  # the corner is at 0
    assert [model.patches[0].poles[3, 3, 1] / past, model.patches[1].poles[0, 3, 1] / past] == (
        pytest.approx([1.1, 1.1], rel=0.01)
    )
