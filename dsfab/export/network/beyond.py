r"""Seams that go on beyond corners that a fillet fills, on faces that go on as far.

       void           At a corner o of an opening where the void is less than a half turn, a fillet adds material, and
   \    x    /        one seam may end there. OCCT (8.0) asks where the seam's whole curve meets the fillet. If it
    \   .   /         ends at o, both faces beside it are lengthened and intersected: they touch all along the seam,
wall \  .  / wall     and any line may be found. Of 13 such corners of a shell on four feet none was rounded. So the
      \ . /           curve goes on to x, where no edge is: the vertex at o bounds the edge. Both surfaces go on with
       \o/            it, and the seam has its places on them in the file, because those that a reader finds are for
   A    |    B        what lies between its vertices only.
        | seam
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from dsfab.arrays import Floats
from dsfab.export.network.corners import filled_corners
from dsfab.export.network.curves import parts_of
from dsfab.export.network.heights import places
from dsfab.export.network.model import NetModel, NetPatch
from dsfab.export.network.trimmed import TrimmedFace
from dsfab.export.splines import bernstein

CLEAR = 1 / 6
"""Of the thickness, radius of a fillet that a seam goes on for, times the tangent of half the turn."""

MOST = 3.0
"""Times its own length that a seam goes on, at most: a polynomial is not to be trusted farther."""

NEAR = 1e-5
"""Millimetres between a patch's corner and a vertex there."""

NEARLY = 1e-6
"""Millimetres that faces may be off what a seam goes on for."""

MARGIN = 0.1
"""Share of that by which surfaces go on farther."""

WIDE = 1 / 100
"""Of the thickness, by which a patch goes on beside a seam that a wall's edge goes straight on as: OCCT makes the seam
longer along that edge, nearly, and finds no places on the patch for what is beyond."""

ALONG = np.linspace(0, 1, 17)
"""Where that is measured."""


@dataclass(frozen=True, eq=False)
class LongSeam:
    """poles : (4, 6) of a seam's curves, millimetres.    on : by face, patches first and then trimmed ones, poles
    (2, k, 2) of the same curves over its outer and its inner surface, which are a square."""

    poles: Floats
    on: Mapping[int, Floats]


def curves_beyond(model: NetModel) -> dict[int, Floats]:
    """By edge the poles (4, 6) of seams that go on: each of them the only one at a corner that is filled."""
    shares = _shares(model)
    if not shares:
        return {}
    P, share = np.stack([model.edges[e].poles for e in shares]), np.stack(list(shares.values()))
    return dict(zip(shares, parts_of(P, -share[:, 0], 1 + share[:, 1]), strict=True))


def _shares(model: NetModel) -> dict[int, Floats]:
    """By edge the shares (2,) of its own parameter by which a seam goes on before its start and after its end."""
    found = dict[int, Floats]()
    for corner in filled_corners(model):
        if corner.straight is None:
            share = found.setdefault(corner.seam, np.zeros(2))
            share[corner.end] = _share(model.edges[corner.seam].poles, corner.end, corner.half)
    return {e: share for e, share in found.items() if share.max() <= MOST}


def _share(poles: Floats, end: int, half: float) -> float:
    """Of an edge's own parameter by which its curves go on."""
    radius = CLEAR * float(np.linalg.norm(poles[-end, :3] - poles[-end, 3:]))
    way = poles[-end] - poles[-2 if end else 1]
    slow = min(float(np.linalg.norm(part)) for part in np.split(way, 2))
    return radius * half / max(3 * slow, 1e-300)


def with_long_seams(
    model: NetModel, faces: list[TrimmedFace]
) -> tuple[NetModel, list[TrimmedFace], dict[int, LongSeam]]:
    """The same solid, on surfaces that go on as its seams do, and these by edge; a seam that one of its faces does not
    follow stays as it is."""
    seams = _on_both(model, faces)
    boxes = {i: _wide(model.patches[i]) for i in _beside_straight(model)}
    for i in {i for seam in seams.values() for i in seam.on}:
        found = [uv for seam in seams.values() for k, uv in seam.on.items() if k == i]
        boxes[i] = _box(np.concatenate([*found, *([boxes[i]] if i in boxes else [])], axis=1))
    patches, faces = list(model.patches), list(faces)
    for i, box in boxes.items():
        if i < len(patches):
            patches[i] = replace(patches[i], poles=_over(patches[i].poles, box[0]), within=True)
        else:
            face = faces[i - len(patches)]
            outer, inner = (_over(poles, part) for poles, part in zip((face.outer, face.inner), box, strict=True))
            faces[i - len(patches)] = replace(face, outer=outer, inner=inner, exact=True)
    moved = {
        e: replace(seam, on={i: (uv - boxes[i][:, :1]) / np.diff(boxes[i], axis=1) for i, uv in seam.on.items()})
        for e, seam in seams.items()
    }
    return replace(model, patches=patches), faces, moved


def _beside_straight(model: NetModel) -> set[int]:
    """The patches beside both a seam and the wall's edge that it goes straight on from, at a corner that is filled."""
    pairs = [{corner.seam, corner.straight} for corner in filled_corners(model) if corner.straight is not None]
    edges = {e for pair in pairs for e in pair}
    loops = {i: {e for e, _ in patch.loop} for i, patch in enumerate(model.patches)}
    return {i for i, mine in loops.items() if mine & edges and any(pair <= mine for pair in pairs)}


def _wide(patch: NetPatch) -> Floats:
    """(2, 2, 2) a little more than the square of a patch, as `_box`."""
    P = patch.poles[:, :, :3]
    thick = float(np.linalg.norm(patch.poles[0, 0, :3] - patch.poles[0, 0, 3:]))
    long = np.linalg.norm([P[3, 0] - P[0, 0], P[0, 3] - P[0, 0]], axis=1)
    more = WIDE * thick / np.maximum(long, WIDE * thick)
    return np.tile(np.stack([-more, 1 + more]), (2, 1, 1))


def _on_both(model: NetModel, faces: list[TrimmedFace]) -> dict[int, LongSeam]:
    """The seams that go on, over both of the faces beside them."""
    curves, shares, count = curves_beyond(model), _shares(model), len(model.patches)
    loops = [patch.loop for patch in model.patches] + [[step for loop in face.loops for step in loop] for face in faces]
    beside = dict[int, list[int]]()
    for i, loop in enumerate(loops):
        for e in {e for e, _ in loop} & curves.keys():
            beside.setdefault(e, []).append(i)
    found = dict[int, LongSeam]()
    for e, two in beside.items():
        sound = dict[int, Floats]()
        for i in two:
            if i < count:
                uv = _on_patch(model.patches[i], model.edges[e].poles, shares[e], curves[e])
            else:
                uv = _on_face(faces[i - count], curves[e])
            if uv is not None:
                sound[i] = uv
        if len(sound) == 2:
            found[e] = LongSeam(curves[e], sound)
    return found


def _on_face(face: TrimmedFace, poles: Floats) -> Floats | None:
    """(2, 4, 2) poles of curves over a trimmed face, if this follows them."""
    if np.abs(face.gaps(bernstein(ALONG) @ poles)).max() > NEARLY:
        return None
    both = zip((face.outer, face.inner), face.axes, np.split(poles, 2, axis=1), strict=True)
    return np.stack([places(*each) for each in both])


def _on_patch(patch: NetPatch, edge: Floats, share: Floats, poles: Floats) -> Floats | None:
    """(2, 2, 2) ends of curves over a patch, if they go on from an edge (4, 6) along a side of it, at its corner."""
    P, lines = patch.poles, ([-share[0], 1 + share[1]], [1 + share[0], -share[1]])
    for a, b in ((0, 0), (0, 1), (1, 0), (1, 1)):
        corner, ways = P[-a, -b], (P[-2 if a else 1, -b] - P[-a, -b], P[-a, -2 if b else 1] - P[-a, -b])
        for end in (0, 1):
            if np.abs(edge[-end] - corner).max() > NEAR:
                continue
            way = edge[-2 if end else 1] - corner
            axis = int(np.argmax([abs(way @ w) / max(float(np.linalg.norm(w)), 1e-300) for w in ways]))
            uv = np.tile([float(a), float(b)], (2, 1))
            speed = float(way @ ways[axis]) / max(float(ways[axis] @ ways[axis]), 1e-300)
            uv[:, axis] += (-1.0 if (a, b)[axis] else 1.0) * speed * np.array(lines[end])
            if _is_on(P, uv, poles):
                return np.stack([uv, uv])
    return None


def _is_on(P: Floats, uv: Floats, poles: Floats) -> bool:
    """Whether a line over a patch is a curve."""
    at = uv[0] + ALONG[:, None] * (uv[1] - uv[0])
    points = np.einsum("ka,kb,abi->ki", bernstein(at[:, 0]), bernstein(at[:, 1]), P)
    return bool(np.abs(points - bernstein(ALONG) @ poles).max() < NEARLY)


def _box(uv: Floats) -> Floats:
    """(2, 2, 2) on each skin the lowest and the highest place that a surface needs for curves (2, k, 2)."""
    low, high = np.minimum(uv.min(axis=1), 0), np.maximum(uv.max(axis=1), 1)
    return np.stack([(1 + MARGIN) * low, 1 + (1 + MARGIN) * (high - 1)], axis=1)


def _over(poles: Floats, box: Floats) -> Floats:
    """Poles (j, k, d) of the same surface over another part (2, 2) of the plane: from its lowest place to its
    highest."""
    for axis in (0, 1):
        if box[0, axis] != 0 or box[1, axis] != 1:
            poles = _part(poles.swapaxes(0, axis), box[0, axis], box[1, axis]).swapaxes(0, axis)
    return poles


def _part(P: Floats, low: float, high: float) -> Floats:
    """Poles (k, ..) of the part of a polynomial between two parameters, by de Casteljau."""
    count, found = len(P) - 1, list[Floats]()
    for j in range(count + 1):
        Q = P
        for x in [low] * (count - j) + [high] * j:
            Q = (1 - x) * Q[:-1] + x * Q[1:]
        found.append(Q[0])
    return np.stack(found)
