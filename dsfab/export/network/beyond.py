r"""Seams that go on beyond corners that a fillet fills, on faces that go on as far.

       void           At a corner o of an opening where the void is less than a half turn, a fillet adds material, and
   \    x    /        one seam may end there. OCCT (8.0) asks where the seam's whole curve meets the fillet. If it
    \   .   /         ends at o, both faces beside it are lengthened and intersected: they touch all along the seam,
wall \  .  / wall     and any line may be found. Of 13 such corners of a shell on four feet none was rounded. So the
      \ . /           curve goes on to x, where no edge is: the vertex at o bounds the edge. Both surfaces go on with
       \o/            it, and the seam has its places on them in the file, because those that a reader finds are for
   A    |    B        what lies between its vertices only. So have both walls' edges that begin at o: OCCT finds the
        | seam        places of these up to .1 um off o, puts an end of the seam's there, and drops what is beyond it.
"""

from dataclasses import dataclass, replace

import numpy as np

from dsfab.arrays import Floats
from dsfab.export.network.corners import filled_corners
from dsfab.export.network.curves import parts_of
from dsfab.export.network.following import on_face, on_patch
from dsfab.export.network.model import NetModel, NetPatch
from dsfab.export.network.trimmed import TrimmedFace

CLEAR = 1 / 6
"""Of the thickness, radius of a fillet that a seam goes on for, times the tangent of half the turn."""

MOST = 3.0
"""Times its own length that a seam goes on, at most: a polynomial is not to be trusted farther."""

MARGIN = 0.1
"""Share of that by which surfaces go on farther."""

WIDE = 1 / 100
"""Of the thickness, by which a patch goes on beside a seam that a wall's edge goes straight on as: OCCT makes the seam
longer along that edge, nearly, and finds no places on the patch for what is beyond."""


@dataclass(frozen=True, eq=False)
class LongSeam:
    """A seam that goes on, or a wall's edge beside the corner where one does, which does not.

    poles : (4, 6) of its curves, millimetres.    on : by face, patches first and then trimmed ones, poles (2, k, 2) of
    the same curves over its outer and its inner surface, which are a square.
    """

    poles: Floats
    on: dict[int, Floats]


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
    """The same solid, on surfaces that go on as its seams do, and by edge these seams and what is beside their ends; a
    seam that one of its faces does not follow stays as it is."""
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
    """The seams that go on, over both of the faces beside them, and the walls' edges beside where they do, over one."""
    longer, shares, count = curves_beyond(model), _shares(model), len(model.patches)
    corners = [corner for corner in filled_corners(model) if corner.straight is None and corner.seam in longer]
    mine = {e for corner in corners for e in (corner.seam, *corner.beside)}
    curves = {e: longer.get(e, model.edges[e].poles) for e in mine}
    found = {e: LongSeam(poles, {}) for e, poles in curves.items()}
    loops = [patch.loop for patch in model.patches] + [[step for loop in face.loops for step in loop] for face in faces]
    for i, loop in enumerate(loops):
        for e in {e for e, _ in loop} & mine:
            if i < count:
                uv = on_patch(model.patches[i], model.edges[e].poles, shares.get(e, np.zeros(2)), curves[e])
            else:
                uv = on_face(faces[i - count], curves[e])
            if uv is not None:
                found[e].on[i] = uv
    sound = [corner for corner in corners if len(found[corner.seam].on) == 2]
    kept = {e for corner in sound for e in (corner.seam, *corner.beside)}
    return {e: seam for e, seam in found.items() if e in kept and seam.on}


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
