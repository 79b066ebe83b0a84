"""Marks beside a structure: load arrows, support cones, principal directions, a person for scale."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Bools, Floats, Ints, group_sums
from dsfab.core.errors import DsfabError
from dsfab.render.lettering import Palette
from dsfab.render.scene import Body
from dsfab.surface import LoadCase, Surface, centroid

if TYPE_CHECKING:
    from dsfab.design.design import Design


Mesh = tuple[Floats, Ints]
"""V (n, 3), F (m, 3)."""


@dataclass(frozen=True)
class Spacing:
    """How marks are thinned: at least `apart` (share of the structure's size) from each other, at most `most`."""

    apart: float
    most: int


SPREAD_LOAD = Spacing(0.13, 30)
POINT_LOAD = Spacing(0.07, 16)
SUPPORTS = Spacing(0.05, 40)
GRADIENTS = Spacing(0.055, 160)

CONE = 0.026
"""Height of a support cone, share of the structure's size."""

LONGEST_POINT, LONGEST_SPREAD, LONGEST_GRADIENT = 0.15, 0.085, 0.06
"""Longest arrow of a concentrated load, of a spread load and of a gradient, share of the structure's size."""


def thinned(points: Floats, size: float, spacing: Spacing) -> Ints:
    """Indices of a few of (k, 3) points, evenly apart, each in the middle of its neighbourhood.

    Farthest points first (Gonzalez 1985), then moved to the middle of their patches (Lloyd 1982).
    """
    taken = [0]
    near = np.linalg.norm(points - points[0], axis=1)
    while len(taken) < spacing.most:
        farthest = int(np.argmax(near))
        if near[farthest] < spacing.apart * size:
            break
        taken.append(farthest)
        near = np.minimum(near, np.linalg.norm(points - points[farthest], axis=1))
    chosen = np.array(taken)
    for _ in range(20):
        owner = _nearest(points, points[chosen])
        counts = np.maximum(np.bincount(owner, minlength=len(chosen)), 1)
        chosen = np.unique(_nearest(group_sums(owner, points, len(chosen)) / counts[:, None], points))
    return chosen


@dataclass(frozen=True, eq=False)
class Pulls:
    """Arrows to draw: at (k,) vertices, pull (k, 3) N, long (k,) metres."""

    at: Ints
    pull: Floats
    long: Floats


def load_arrows(surface: Surface, load: LoadCase, size: float, lift: float, eye: Floats, up: Floats) -> Mesh:
    """Slim arrows for the loads, thinned: each stands for the force on the vertices nearest to it.

    size : of the structure, metres.   lift : half its thickness, metres: arrows start or end on the solid's skin.
    eye  : (3,) unit vector towards the eye: arrows along the surface are drawn on the side that is seen.
    up   : (3,) unit vector: of an open sheet the outer side is the upper one, whichever way its faces turn.
    """
    acts = (np.linalg.norm(load.force, axis=1) > 0) & ~load.fixed.all(axis=1)
    points = _gathered(surface.V, load.force, acts & load.loaded, POINT_LOAD, LONGEST_POINT * size, size)
    spread = _gathered(surface.V, load.force, acts & ~load.loaded, SPREAD_LOAD, LONGEST_SPREAD * size, size)
    at = np.concatenate([points.at, spread.at])
    pull, long = np.concatenate([points.pull, spread.pull]), np.concatenate([points.long, spread.long])
    along = pull / np.linalg.norm(pull, axis=1, keepdims=True)
    normal = surface.vertex_normals[at] * _outer(surface, up)
    out = np.einsum("ki,ki->k", along, normal)
    # pressing: the tip touches the surface; pulling outwards: the tail does; along the surface: drawn just above it
    level = np.abs(out) < 0.3
    away = np.where(level, np.where(normal @ eye < 0, -1.0, 1.0), -np.sign(out))[:, None] * normal
    away[out > 0.3] *= -1
    start = np.where((out > 0.3)[:, None], 0.0, -along * long[:, None])
    gap = np.where(level, 1.4 * lift + 0.006 * size, 1.1 * lift)
    return _placed(_arrow(), surface.V[at] + away * gap[:, None] + start, along, long)


def _outer(surface: Surface, up: Floats) -> float:
    """1, or -1 where the faces of an open sheet look down in the mean: what acts on a roof presses on it."""
    return -1.0 if not surface.is_closed and float(surface.areas @ (surface.normals @ up)) < 0 else 1.0


def _gathered(V: Floats, force: Floats, acts: Bools, spacing: Spacing, longest: float, size: float) -> Pulls:
    """The forces on the marked vertices, gathered at a few of them in the middle of their patches (Lloyd 1982)."""
    at = np.flatnonzero(acts)
    if not len(at):
        return Pulls(at, np.zeros((0, 3)), np.zeros(0))
    where = V[at]
    taken = thinned(where, size, spacing)
    owner = _nearest(where, where[taken])
    pull = group_sums(owner, force[at], len(taken))
    amount = np.linalg.norm(pull, axis=1)
    kept = amount > 1e-6 * amount.max()  # forces that cancel within a patch have no arrow
    long = longest * (0.35 + 0.65 * np.sqrt(amount[kept] / amount.max()))
    return Pulls(at[taken][kept], pull[kept], long)


def support_cones(surface: Surface, load: LoadCase, size: float, up: Floats, lift: float) -> Mesh:
    """Small cones whose points touch the supported vertices, thinned, on the side where the supports are; up: (3,)."""
    at = np.flatnonzero(load.held)
    if not len(at):
        return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    tips = surface.V[at[thinned(surface.V[at], size, SUPPORTS)]]
    away = support_side(surface, load, size, up)
    towards = np.repeat(-away[None], len(tips), axis=0)
    long = np.full(len(tips), CONE * size)
    return _placed(_cone(), tips + (0.3 * lift + long[:, None]) * away, towards, long)


def reaction_arrows(surface: Surface, load: LoadCase, reaction: Floats, size: float) -> Mesh:
    """Arrows for the forces (n, 3), N, of the supports on the structure, gathered as the cones are.

    They end at the support, or begin there where it pulls the structure down.
    """
    acts = load.held & (np.linalg.norm(reaction, axis=1) > 0)
    if not acts.any():
        return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    found = _gathered(surface.V, reaction, acts, SUPPORTS, LONGEST_POINT * size, size)
    along = found.pull / np.linalg.norm(found.pull, axis=1, keepdims=True)
    inwards = surface.V.mean(axis=0) - surface.V[found.at]
    pushes = np.einsum("ki,ki->k", along, inwards) > 0
    gap = 1.15 * CONE * size  # beyond the cone
    start = np.where(pushes[:, None], -along * (gap + found.long)[:, None], along * gap)
    return _placed(_arrow(), surface.V[found.at] + start, along, found.long)


def gradient_arrows(surface: Surface, gradient: Floats, size: float, lift: float, eye: Floats) -> Mesh:
    """Slim arrows along a gradient (m, 3), at faces that are evenly apart, longer where it is steeper; none where it
    vanishes everywhere. lift, eye : as for `load_arrows`."""
    steep = np.linalg.norm(gradient, axis=1)
    if not steep.any():
        return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    at = thinned(surface.centroids, size, GRADIENTS)
    at = at[steep[at] > 0]
    share = np.minimum(steep[at] / np.percentile(steep, 90), 1)
    along, long = gradient[at] / steep[at, None], LONGEST_GRADIENT * size * (0.35 + 0.65 * share)
    normal = surface.normals[at]
    away = np.where(normal @ eye < 0, -1.0, 1.0)[:, None] * normal * (1.4 * lift + 0.006 * size)
    return _placed(_arrow(), surface.centroids[at] + away - along * long[:, None] / 2, along, long)


def support_side(surface: Surface, load: LoadCase, size: float, up: Floats) -> Floats:
    """(3,) unit vector along an axis, from the structure to its supports; down when they lie all around it."""
    held = surface.V[load.held] - centroid(surface)
    offset = held[thinned(held, size, SUPPORTS)].mean(axis=0)  # not of more vertices where the mesh is finer
    axis = int(np.argmax(np.abs(offset)))
    side = np.sign(offset[axis])
    if np.linalg.norm(offset) < 0.08 * size or (side * held[:, axis]).min() < 0:
        return -up
    return np.asarray(np.eye(3)[axis] * side)


def _nearest(points: Floats, centres: Floats) -> Ints:
    """(k,) the centre nearest to each point."""
    return np.asarray(cKDTree(centres).query(points)[1], dtype=np.int64)


def _turned(profile: list[tuple[float, float]], sides: int = 16) -> Mesh:
    """A body of revolution about x from (x, radius) pairs; radius 0 at both ends closes it."""
    turn = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    rings = [np.stack([np.full(sides, x), r * np.cos(turn), r * np.sin(turn)], axis=1) for x, r in profile]
    low = np.arange(sides)
    high, faces = np.roll(low, -1), []
    for i in range(len(profile) - 1):
        a, b, c, d = i * sides + low, i * sides + high, (i + 1) * sides + high, (i + 1) * sides + low
        if profile[i + 1][1] > 0:
            faces.append(np.stack([a, c, d], axis=1))
        if profile[i][1] > 0:
            faces.append(np.stack([a, b, c], axis=1))
    return np.concatenate(rings), np.concatenate(faces)


def _arrow() -> Mesh:
    return _turned([(0.0, 0.0), (0.0, 0.014), (0.74, 0.014), (0.74, 0.05), (1.0, 0.0)])


def _cone() -> Mesh:
    return _turned([(0.0, 0.0), (0.0, 0.45), (1.0, 0.0)])


def _ball() -> Mesh:
    """Of diameter 1, its lowest point at the origin."""
    around = np.linspace(0, np.pi, 9)
    return _turned([((1 - np.cos(a)) / 2, np.sin(a) / 2 if 0 < i < 8 else 0.0) for i, a in enumerate(around)])


_CROWN = ((0.0, 0.0, 0.3, 0.5), (0.15, 0.05, 0.42, 0.36), (-0.13, 0.11, 0.46, 0.34), (-0.02, -0.12, 0.55, 0.34),
    (0.03, 0.04, 0.64, 0.36))  # fmt: skip
"""Balls of foliage: right, back and height of their lowest points, and their diameters, of a tree 1 high."""


def tree(foot: Floats, up: Floats, height: float) -> Mesh:
    """A model maker's tree, a trunk and balls of foliage, at `foot` (3,), `height` metres tall along `up` (3,)."""
    right = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    right /= np.linalg.norm(right)
    balls = np.array(_CROWN)
    frame = height * np.stack([right, np.cross(up, right), up])
    trunk = _placed(
        _turned([(0.0, 0.0), (0.0, 0.05), (0.8, 0.03), (1.0, 0.0)]), foot[None], up[None], np.array([0.6 * height])
    )
    crown = _placed(_ball(), foot + balls[:, :3] @ frame, np.tile(up, (len(balls), 1)), height * balls[:, 3])
    return np.concatenate([trunk[0], crown[0]]), np.concatenate([trunk[1], crown[1] + len(trunk[0])])


def _placed(template: Mesh, start: Floats, along: Floats, long: Floats) -> Mesh:
    """Copies of a template of length 1 along x, from `start` (k, 3) along unit vectors `along`, `long` (k,) metres."""
    vertices, faces = template
    helper = np.eye(3)[np.argmin(np.abs(along), axis=1)]
    second = np.cross(along, helper)
    second /= np.linalg.norm(second, axis=1, keepdims=True)
    frame = np.stack([along, second, np.cross(along, second)], axis=1) * long[:, None, None]
    copies = np.einsum("vi,kij->kvj", vertices, frame) + start[:, None]
    shifted = faces[None] + (np.arange(len(start)) * len(vertices))[:, None, None]
    return copies.reshape(-1, 3), shifted.reshape(-1, 3)


CROSSES = Spacing(0.034, 500)
"""How crosses are thinned; their number bounds the time."""

LONG, WIDE = 0.8, 0.09
"""Length and width of a bar, as shares of the distance between neighbouring crosses."""


def crosses(design: "Design", palette: Palette) -> Body:
    """Bars along the two directions that diffusion follows, at places evenly apart; none where neither is preferred.

    Raises DsfabError where no direction is preferred anywhere: at r = 1, or without a stress.
    """
    surface, tensors, r = design.surface, design.diffusion.tensors, design.preset.diffusion.r
    if r <= 1 or tensors.isotropic.all():
        why = f"r = {r:g}" if r <= 1 else "the stress is the same in all directions"
        raise DsfabError(f"there are no directions to show: {why}, so that diffusion prefers none")
    at = thinned(surface.centroids, surface.size, CROSSES)
    apart = float(np.sqrt(1.3 * surface.area / len(at)))  # of places that are evenly spread
    at = at[~tensors.isotropic[at]]
    along = np.linalg.eigh(tensors.major[at])[1][:, :, 2]  # r along the first direction, 1 and 0 across
    normal = surface.normals[at]
    both = np.concatenate([along, np.cross(normal, along)])
    vertices, faces = _bars(np.tile(surface.centroids[at], (2, 1)), both, np.tile(normal, (2, 1)), apart)
    if design.preset.combines:  # sizes of the stress in several cases: they pull in one and push in another
        red = (np.arange(2 * len(at)) < len(at))[:, None]
        colour = np.where(red, *(np.array(tint, dtype=np.uint8) for tint in palette.tints[:2]))
    else:
        pulled = tensors.principal[at].T.reshape(-1, 1) > 0
        colour = np.where(pulled, palette.of("tension"), palette.of("compression"))
    return Body(vertices, faces, np.repeat(colour, len(_BOX), axis=0))


def _bars(middle: Floats, along: Floats, normal: Floats, apart: float) -> Mesh:
    """Boxes around `middle` (k, 3), seen from both sides of the surface."""
    across = np.cross(normal, along)
    half = apart / 2 * np.array([LONG, WIDE, WIDE])
    frame = np.stack([along, across, normal], axis=1) * half[:, None]
    corners = np.einsum("ci,kij->kcj", _CORNERS, frame) + middle[:, None]
    faces = _BOX[None] + (len(_CORNERS) * np.arange(len(middle)))[:, None, None]
    return corners.reshape(-1, 3), faces.reshape(-1, 3)


_CORNERS = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
_BOX = np.array([
    (0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4),
    (1, 5, 7), (1, 7, 3),
])  # fmt: skip
