"""Members as they are built: the bodies of their parts, each in its layer, for building models."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.export import MemberShape
from dsfab.surface import signed_volume
from dsfab.workshop.bars import BarPlan, bar_body
from dsfab.workshop.plan import WorkshopPlan
from dsfab.workshop.refolding import RefoldedStrip, refolded


def built_shapes(plan: WorkshopPlan, shapes: Sequence[MemberShape], shift: int) -> tuple[MemberShape, ...]:
    """The members of a plan that are built, in the order of the bodies that the design has of them; metres.

    shapes : as `dsfab.delivery` has them: vertices of the upper skin, then those of the lower one; `shift` says by how
    many halves of their thickness the middle between both lies over the surface.
    Strips and planks are bent back from their flat parts, cover plates with them; plates are as thick as the stock.
    Bars are as they are cut, but for mitres.
    """
    if plan.bars:
        return _bars(plan.bars, shapes, shift)
    built = {part.member for part in plan.parts}
    strips: dict[str, list[RefoldedStrip]] = {}
    for strip in refolded(plan).strips:
        strips.setdefault(strip.member, []).append(strip)
    found = []
    for shape in shapes:
        if shape.id in strips:
            V, F = _joined([strip_body(strip, plan.thickness) for strip in strips[shape.id]])
            found.append(replace(shape, V=V, F=F, plate=False))
        elif shape.id in built:
            layering, own = plan.layering, next(part.layer for part in plan.parts if part.member == shape.id)
            height = layering.height(layering.plates) if layering else own
            found.append(replace(shape, V=_moved(shape.V, plan.thickness, height, shift), plate=True))
    return tuple(found)


def _bars(plan: BarPlan, shapes: Sequence[MemberShape], shift: int) -> tuple[MemberShape, ...]:
    """Members as their bars, and those that are plates as thick as these, below the plates of nodes."""
    bodies: dict[str, list[tuple[Floats, Ints]]] = {}
    for bar in plan.found.bars:
        bodies.setdefault(bar.bay.member, []).append(bar_body(bar, plan.stock))
    discs = {part.member: part.layer for part in plan.parts if part.member and not len(part.axis)}
    found = []
    for shape in shapes:
        if shape.id in bodies:
            V, F = _joined(bodies[shape.id])
            found.append(replace(shape, V=V, F=F, plate=False))
        elif shape.id in discs:
            found.append(replace(shape, V=_moved(shape.V, plan.stock.bar, discs[shape.id], shift), plate=True))
    return tuple(found)


def strip_body(strip: RefoldedStrip, thickness: float) -> tuple[Floats, Ints]:
    """Vertices (4 k, 3), metres, and triangles of a strip of a thickness: four corners at each of its k stations."""
    up = thickness / 2 * strip.normals
    right, left = strip.edges[:, 0], strip.edges[:, 1]
    V = np.stack([right - up, right + up, left + up, left - up], axis=1).reshape(-1, 3)
    k = np.arange(len(up) - 1)[:, None]
    a = 4 * k + np.arange(4)
    b = 4 * k + np.roll(np.arange(4), -1)
    quads = np.stack([a, b, b + 4, a + 4], axis=-1).reshape(-1, 4)
    ends = np.array([[3, 2, 1, 0], np.arange(4) + 4 * (len(up) - 1)])
    quads = np.concatenate([quads, ends])
    F = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return V, F if signed_volume(V, F) > 0 else F[:, ::-1]


def _joined(bodies: Sequence[tuple[Floats, Ints]]) -> tuple[Floats, Ints]:
    first = np.cumsum([0, *(len(V) for V, _ in bodies)])
    faces = [F + start for (_, F), start in zip(bodies, first, strict=False)]
    return np.concatenate([V for V, _ in bodies]), np.concatenate(faces)


def _moved(V: Floats, thickness: float, height: float, shift: int) -> Floats:
    """Both skins (2 n, 3) of a thickness about a height over the surface."""
    upper, lower = V.reshape(2, -1, 3)
    middle, half = (upper + lower) / 2, (upper - lower) / 2
    n = half / np.linalg.norm(half, axis=1)[:, None]
    middle = middle - shift * half + height * n
    return np.concatenate([middle + thickness / 2 * n, middle - thickness / 2 * n])
