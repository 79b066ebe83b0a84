"""Marks beside a structure, such as load arrows and support cones."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Bools, Floats, Ints, concatenated_mesh, group_sums, unit_vectors
from dsfab.core.errors import DsfabError
from dsfab.render.lettering import Palette
from dsfab.render.scene import Body
from dsfab.render.view import ViewSide
from dsfab.surface import LoadCase, Surface, centroid

if TYPE_CHECKING:
    from dsfab.design.design import Design

MarkMesh = tuple[Floats, Ints]  # vertices (n, 3) in metres, and faces (m, 3)


@dataclass(frozen=True)
class Spacing:
    """Limits for marks in a picture. apart : least distance / structure's size.    most : largest number of marks."""

    apart: float
    most: int


SPREAD_LOAD_SPACING = Spacing(0.13, 30)
POINT_LOAD_SPACING = Spacing(0.07, 16)
SUPPORT_SPACING = Spacing(0.05, 40)
GRADIENT_SPACING = Spacing(0.055, 160)

CONE_HEIGHT = 0.026  # height of a support cone, divided by the structure's size
LONGEST_POINT, LONGEST_SPREAD, LONGEST_GRADIENT = 0.15, 0.085, 0.06  # lengths of arrows / structure's size


def thin_points(points: Floats, size: float, spacing: Spacing) -> Ints:
    """Return the indices of a few evenly spaced points among points (k, 3) [Gonzalez 1985, Lloyd 1982].
    size : size of the structure, m."""
    chosen_list = [0]
    distances = np.linalg.norm(points - points[0], axis=1)
    while len(chosen_list) < spacing.most:
        farthest = int(np.argmax(distances))
        if distances[farthest] < spacing.apart * size:
            break
        chosen_list.append(farthest)
        distances = np.minimum(distances, np.linalg.norm(points - points[farthest], axis=1))
    chosen = np.array(chosen_list)
    for _ in range(20):
        owner = _nearest(points, points[chosen])
        counts = np.maximum(np.bincount(owner, minlength=len(chosen)), 1)
        chosen = np.unique(_nearest(group_sums(owner, points, len(chosen)) / counts[:, None], points))
    return chosen


@dataclass(frozen=True, eq=False)
class ForceArrows:
    """Arrows for forces. at : (k,) vertices.    pull : (k, 3) forces, N.    long : (k,) lengths of the arrows, m."""

    at: Ints
    pull: Floats
    long: Floats


def load_arrows(surface: Surface, load: LoadCase, size: float, lift: float, eye: Floats, up: Floats) -> MarkMesh:
    """Return a few slim arrows for the loads.
    size : size of the structure, m.    lift : half of the structure's thickness, m.
    eye  : (3,) unit vector towards the eye.    up : (3,) unit vector."""
    acts = (np.linalg.norm(load.force, axis=1) > 0) & ~load.fixed.all(axis=1)
    V, at_points, elsewhere = surface.V, acts & load.loaded, acts & ~load.loaded
    points = gathered_forces(V, load.force, at_points, POINT_LOAD_SPACING, LONGEST_POINT * size, size)
    spread = gathered_forces(V, load.force, elsewhere, SPREAD_LOAD_SPACING, LONGEST_SPREAD * size, size)
    vertices = np.concatenate([points.at, spread.at])
    pull, long = np.concatenate([points.pull, spread.pull]), np.concatenate([points.long, spread.long])
    along = pull / np.linalg.norm(pull, axis=1, keepdims=True)
    normal = surface.vertex_normals[vertices] * _outer(surface, up)
    out = np.einsum("ki,ki->k", along, normal)
    # tips of pressure arrows and tails of suction arrows touch the surface
    level = np.abs(out) < 0.3
    away = np.where(level, np.where(normal @ eye < 0, -1.0, 1.0), -np.sign(out))[:, None] * normal
    away[out > 0.3] *= -1
    start = np.where((out > 0.3)[:, None], 0.0, -along * long[:, None])
    gap = np.where(level, 1.4 * lift + 0.006 * size, 1.1 * lift)
    return _placed_copies(_arrow(), surface.V[vertices] + away * gap[:, None] + start, along, long)


def _outer(surface: Surface, up: Floats) -> float:
    """Return -1 if the normals of an open sheet point down on average, else 1."""
    return -1.0 if not surface.is_closed and float(surface.areas @ (surface.normals @ up)) < 0 else 1.0


def gathered_forces(
    V: Floats, force: Floats, acts: Bools, spacing: Spacing, longest: float, size: float
) -> ForceArrows:
    """Sum the forces (n, 3) at the vertices in the mask `acts` (n,) into a few arrows. longest : longest arrow, m."""
    vertices = np.flatnonzero(acts)
    if not len(vertices):
        return ForceArrows(vertices, np.zeros((0, 3)), np.zeros(0))
    points = V[vertices]
    taken = thin_points(points, size, spacing)
    owner = _nearest(points, points[taken])
    pull = group_sums(owner, force[vertices], len(taken))
    amount = np.linalg.norm(pull, axis=1)
    is_drawn = amount > 1e-6 * amount.max()  # forces that are summed in an arrow may cancel out
    long = longest * (0.35 + 0.65 * np.sqrt(amount[is_drawn] / amount.max()))
    return ForceArrows(vertices[taken][is_drawn], pull[is_drawn], long)


def support_cones(surface: Surface, load: LoadCase, size: float, up: Floats, lift: float) -> MarkMesh:
    """Return cones with their tips at a few of the supports. size : of the structure, m.
    up : (3,) unit vector.    lift : half of the structure's thickness, m."""
    vertices = np.flatnonzero(load.supported)
    if not len(vertices):
        return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    tips = surface.V[vertices[thin_points(surface.V[vertices], size, SUPPORT_SPACING)]]
    away = support_side(surface, load, size, up)
    towards = np.repeat(-away[None], len(tips), axis=0)
    long = np.full(len(tips), CONE_HEIGHT * size)
    return _placed_copies(_cone(), tips + (0.3 * lift + long[:, None]) * away, towards, long)


def reaction_arrows(surface: Surface, load: LoadCase, reaction: Floats, size: float) -> MarkMesh:
    """Return arrows for the forces (n, 3) of supports, N. size : of the structure, m."""
    acts = load.supported & (np.linalg.norm(reaction, axis=1) > 0)
    if not acts.any():
        return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    arrows = gathered_forces(surface.V, reaction, acts, SUPPORT_SPACING, LONGEST_POINT * size, size)
    along = arrows.pull / np.linalg.norm(arrows.pull, axis=1, keepdims=True)
    inwards = surface.V.mean(axis=0) - surface.V[arrows.at]
    pushes = np.einsum("ki,ki->k", along, inwards) > 0
    gap = 1.15 * CONE_HEIGHT * size  # the arrow begins outside the support's cone
    start = np.where(pushes[:, None], -along * (gap + arrows.long)[:, None], along * gap)
    return _placed_copies(_arrow(), surface.V[arrows.at] + start, along, arrows.long)


def gradient_arrows(surface: Surface, gradient: Floats, size: float, lift: float, eye: Floats) -> MarkMesh:
    """Return slim arrows along a gradient (m, 3) at a few faces. eye : (3,) unit vector towards the eye.
    size : of the structure, m.    lift : half of the structure's thickness, m."""
    steep = np.linalg.norm(gradient, axis=1)
    if not steep.any():
        return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    faces = thin_points(surface.centroids, size, GRADIENT_SPACING)
    faces = faces[steep[faces] > 0]
    share = np.minimum(steep[faces] / np.percentile(steep, 90), 1)
    along, long = gradient[faces] / steep[faces, None], LONGEST_GRADIENT * size * (0.35 + 0.65 * share)
    normal = surface.normals[faces]
    away = np.where(normal @ eye < 0, -1.0, 1.0)[:, None] * normal * (1.4 * lift + 0.006 * size)
    return _placed_copies(_arrow(), surface.centroids[faces] + away - along * long[:, None] / 2, along, long)


def support_side(surface: Surface, load: LoadCase, size: float, up: Floats) -> Floats:
    """Return the unit vector (3,), along a coordinate axis, from the surface's centroid towards the supports.
    Return -`up` if supports lie on several sides."""
    offsets = surface.V[load.supported] - centroid(surface)
    # evenly spaced points make the mean independent of the mesh density
    offset = offsets[thin_points(offsets, size, SUPPORT_SPACING)].mean(axis=0)
    axis = int(np.argmax(np.abs(offset)))
    side = np.sign(offset[axis])
    if np.linalg.norm(offset) < 0.08 * size or (side * offsets[:, axis]).min() < 0:
        return -up
    return np.asarray(np.eye(3)[axis] * side)


def _nearest(points: Floats, centres: Floats) -> Ints:
    return np.asarray(cKDTree(centres).query(points)[1], dtype=np.int64)


def _body_of_revolution(profile: list[tuple[float, float]], sides: int = 16) -> MarkMesh:
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


def _arrow() -> MarkMesh:
    return _body_of_revolution([(0.0, 0.0), (0.0, 0.014), (0.74, 0.014), (0.74, 0.05), (1.0, 0.0)])


def _cone() -> MarkMesh:
    return _body_of_revolution([(0.0, 0.0), (0.0, 0.45), (1.0, 0.0)])


_CROWN = ((0.0, 0.0, 0.3, 0.5), (0.15, 0.05, 0.42, 0.36), (-0.13, 0.11, 0.46, 0.34), (-0.02, -0.12, 0.55, 0.34),
    (0.03, 0.04, 0.64, 0.36))  # fmt: skip
"""Balls of foliage of a tree of height 1: lowest point (right, back, height) and diameter of each ball."""


def tree(foot: Floats, up: Floats, height: float) -> MarkMesh:
    """Return a tree at `foot` (3,), `height` metres tall along `up` (3,)."""
    right = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    right /= np.linalg.norm(right)
    balls = np.array(_CROWN)
    frame = height * np.stack([right, np.cross(up, right), up])
    cone = _body_of_revolution([(0.0, 0.0), (0.0, 0.05), (0.8, 0.03), (1.0, 0.0)])
    trunk = _placed_copies(cone, foot[None], up[None], np.array([0.6 * height]))
    around = enumerate(np.linspace(0, np.pi, 9))
    ball = _body_of_revolution([((1 - np.cos(a)) / 2, np.sin(a) / 2 if 0 < i < 8 else 0.0) for i, a in around])
    crown = _placed_copies(ball, foot + balls[:, :3] @ frame, np.tile(up, (len(balls), 1)), height * balls[:, 3])
    return concatenated_mesh([trunk, crown])


def place_beside(V: Floats, side: ViewSide, up: Floats, level: float, which: float = 1.0) -> tuple[Floats, Floats]:
    """Return a place (3,) on the ground beside vertices V (n, 3), and the picture's unit vector (3,) to the right.
    level : height of the ground, m.    which : 1 for right and in front, -1 for left and behind."""
    right = unit_vectors(np.cross(side.up, side.towards)[None])[0]
    x, y, front = V @ right * which, V @ np.cross(right, up), np.cross(right, up)
    gap = max(0.03 * float(np.ptp(x)), min(0.6, 0.12 * float(np.ptp(x))))
    depth = (y.min() + y.max()) / 2 + which * 0.25 * np.ptp(y)
    return which * (x.max() + gap) * right + depth * front + level * up, right


PENCIL_LENGTH, PENCIL_WIDTH = 0.175, 0.007  # m


def pencil(foot: Floats, right: Floats, up: Floats) -> MarkMesh:
    """Return a pencil that lies on the ground near `foot` (3,). right, up : (3,) unit vectors."""
    slender = PENCIL_WIDTH / PENCIL_LENGTH
    wood = _body_of_revolution([(0.0, 0.0), (0.0, slender / 2), (1 - 3 * slender, slender / 2), (1.0, 0.0)], 6)
    front = np.cross(right, up)
    along, foot = 0.28 * right - 0.96 * front, foot + 0.4 * PENCIL_LENGTH * front
    return _placed_copies(wood, (foot + PENCIL_WIDTH / 2 * up)[None], along[None], np.array([PENCIL_LENGTH]))


def _placed_copies(template: MarkMesh, start: Floats, along: Floats, long: Floats) -> MarkMesh:
    """Return k copies of a template mesh. start : (k, 3) first point of each copy.
    along : (k, 3) unit vectors of the axes of the copies.    long : (k,) lengths, m."""
    vertices, faces = template
    second = np.cross(along, np.eye(3)[np.argmin(np.abs(along), axis=1)])
    second /= np.linalg.norm(second, axis=1, keepdims=True)
    frame = np.stack([along, second, np.cross(along, second)], axis=1) * long[:, None, None]
    copies = np.einsum("vi,kij->kvj", vertices, frame) + start[:, None]
    shifted = faces[None] + (np.arange(len(start)) * len(vertices))[:, None, None]
    return copies.reshape(-1, 3), shifted.reshape(-1, 3)


CROSS_SPACING = Spacing(0.034, 500)  # at most 500, because many crosses are slow to draw
BAR_LENGTH, BAR_WIDTH = 0.8, 0.09  # length and width of each bar of a cross, divided by the distance between crosses


def crosses(design: "Design", palette: Palette) -> Body:
    """Return crosses of two bars along the directions of diffusion. Blue is compression, red is tension.
    For combined cases, red is the first direction, blue the second. Raises DsfabError if all faces are isotropic."""
    surface, tensors, r = design.surface, design.diffusion.tensors, design.preset.diffusion.r
    if r <= 1 or tensors.isotropic.all():
        why = f"r = {r:g}" if r <= 1 else "the stress is the same in all directions"
        raise DsfabError(f"the diffusion prefers no direction, so there are no directions to show, because {why}")
    places = thin_points(surface.centroids, surface.size, CROSS_SPACING)
    apart = float(np.sqrt(1.3 * surface.area / len(places)))  # distance between neighbouring crosses
    places = places[~tensors.isotropic[places]]
    along = np.linalg.eigh(tensors.major[places])[1][:, :, 2]  # eigenvectors of the largest eigenvalue
    normal = surface.normals[places]
    directions = np.concatenate([along, np.cross(normal, along)])
    vertices, faces = _bars(np.tile(surface.centroids[places], (2, 1)), directions, np.tile(normal, (2, 1)), apart)
    if design.preset.combines:  # stress signs may differ between load cases, so colours show no sign
        red = (np.arange(2 * len(places)) < len(places))[:, None]
        colour = np.where(red, *(np.array(tint, dtype=np.uint8) for tint in palette.tints[:2]))
    else:
        pulled = tensors.principal[places].T.reshape(-1, 1) > 0
        colour = np.where(pulled, palette.colour_bytes("tension"), palette.colour_bytes("compression"))
    return Body(vertices, faces, np.repeat(colour, len(_BOX), axis=0))


def _bars(middle: Floats, along: Floats, normal: Floats, apart: float) -> MarkMesh:
    across = np.cross(normal, along)
    half = apart / 2 * np.array([BAR_LENGTH, BAR_WIDTH, BAR_WIDTH])
    frame = np.stack([along, across, normal], axis=1) * half[:, None]
    corners = np.einsum("ci,kij->kcj", _CORNERS, frame) + middle[:, None]
    faces = _BOX[None] + (len(_CORNERS) * np.arange(len(middle)))[:, None, None]
    return corners.reshape(-1, 3), faces.reshape(-1, 3)


_CORNERS = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
_BOX = np.array([
    (0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4),
    (1, 5, 7), (1, 7, 3),
])  # fmt: skip
