"""`member_graph`: the graph of a design's members, with their order and names."""

from collections.abc import Sequence
from string import ascii_lowercase
from typing import cast

import numpy as np

from dsfab.core.arrays import Floats, Ints, unit_vectors
from dsfab.members.axes import fitted_axis, sides
from dsfab.members.components import FAMILIES, Component, Kind, components, pattern_bands
from dsfab.members.graph import Joints, Member, MemberGraph, overlaps, with_ends
from dsfab.members.loose_cells import owners, with_loose, without_followers
from dsfab.results import PatternResult
from dsfab.slicing import Overlay, Sheet, overlaid
from dsfab.surface import Surface

TIE = 1e-3
"""Positions along the structure are equal if they differ by less than this share of its size."""
ROUND, HOLLOW = 0.5, 0.4
"""Members form a ring if their centroids spread in a second direction by more than ROUND times the first, and none is
nearer to the middle than HOLLOW times the farthest.
"""


def along_structure(places: Floats, lengths: Floats, size: float) -> Ints:
    """(k,) order for naming members with centroids (k, 3) and lengths (k,), metres, on a structure of a size.

    A ring is ordered counter-clockwise from the x axis, seen from above. Other members follow the direction of their
    largest spread, which points to growing x, y or z. At equal positions the shorter member is first, then the one
    with the smaller x, y, z.
    """
    if len(places) < 2:
        return np.arange(len(places))
    off = places - places.mean(axis=0)
    spread, axes = np.linalg.svd(off, full_matrices=False)[1:]
    spread, axes = np.append(spread, [0.0, 0.0])[:3], _pointing(np.linalg.svd(off)[2] if len(places) < 3 else axes)
    key = off @ axes[0]
    if len(places) > 2 and spread[1] > ROUND * spread[0]:
        up = axes[2]
        x = np.eye(3)[0] if abs(up[0]) < 1 / np.sqrt(2) else np.eye(3)[1]
        x = x - (x @ up) * up
        right, ahead = off @ x / np.linalg.norm(x), off @ np.cross(up, x / np.linalg.norm(x))
        radius = np.hypot(right, ahead)
        if radius.min() > HOLLOW * radius.max():
            turn = TIE * size / radius.max()
            key = np.mod(np.arctan2(ahead, right) + turn, 2 * np.pi) * radius.max()
        elif spread[1] > (1 - TIE) * spread[0]:
            key = off @ x
    columns = [_steps(values, TIE * size) for values in (*places.T[::-1], lengths, key)]
    return np.lexsort(columns)


def _pointing(axes: Floats) -> Floats:
    """Unit vectors (d, 3) turned so that the largest coordinate of each is positive."""
    largest = np.take_along_axis(axes, np.abs(axes).argmax(axis=1)[:, None], axis=1)
    return np.asarray(axes * np.where(largest < 0, -1.0, 1.0))


def _steps(values: Floats, gap: float) -> Ints:
    """(k,) ranks of values (k,), equal for neighbours without a gap between them."""
    order = np.argsort(values, kind="stable")
    found = np.empty(len(values), dtype=np.int64)
    found[order] = np.concatenate([[0], np.cumsum(np.diff(values[order]) > gap)])
    return found


KINDS = ("rim", "band", "ring", "disc", "plate", "fill")
"""Kinds of members besides strips, in the order of the list."""


def named(surface: Surface, found: Sequence[Component]) -> list[tuple[str, int, Component]]:
    """Return names, part numbers and components in the order of their names: "A01", "A02a", "A02b", ..., "B01", "rim
    1".

    surface : its cells are those of the components.
    """
    listed = list[tuple[str, int, Component]]()
    for letter, some in _kinds(found):
        groups = _groups(some) if len(letter) == 1 else [[one] for one in some]
        places = np.array([_place(surface, group) for group in groups]).reshape(-1, 3)
        lengths = np.array([sum(one.line.length if one.line else 0.0 for one in group) for group in groups])
        digits = len(str(max(len(groups), 10)))
        for number, k in enumerate(along_structure(places, lengths, surface.size).tolist(), 1):
            group = groups[k]
            label = f"{letter}{number:0{digits}d}" if len(letter) == 1 else f"{letter} {number}"
            for part, one in enumerate(group, 1):
                listed.append((label + (_letters(part) if len(group) > 1 else ""), part, one))
    return listed


def _kinds(found: Sequence[Component]) -> list[tuple[str, list[Component]]]:
    strips = [one for one in found if one.kind == "strip"]
    families = [(letter, [one for one in strips if one.family == name]) for name, letter in FAMILIES.items()]
    return families + [(kind, [one for one in found if one.kind == kind]) for kind in KINDS]


def _groups(some: list[Component]) -> list[list[Component]]:
    groups: dict[int, list[Component]] = {}
    for number, one in enumerate(some):
        groups.setdefault(one.group if one.group >= 0 else -1 - number, []).append(one)
    return list(groups.values())


def _place(surface: Surface, group: list[Component]) -> Floats:
    cells = np.concatenate([one.cells for one in group])
    return np.asarray(surface.areas[cells] @ surface.centroids[cells] / surface.areas[cells].sum())


def _letters(part: int) -> str:
    text = ""
    while part:
        part, digit = divmod(part - 1, len(ascii_lowercase))
        text = ascii_lowercase[digit] + text
    return text


def member_graph(surface: Surface, sheet: Sheet, pattern: PatternResult) -> MemberGraph:
    """Return the members of a sheet that was cut from `surface` along a pattern, and their nodes."""
    bands = pattern_bands(surface, sheet, pattern)
    overlay = overlaid(sheet, surface, [band.drawn for band in bands])
    normals = overlay.sheet.carry(spherical_normals(surface))
    found = components(overlay, bands, normals, surface.mean_edge)
    found = with_loose(overlay, without_followers(overlay, found))
    listed = named(overlay.sheet.surface, found)
    parts = [one for *_, one in listed]
    joints = Joints(overlay, [_member(overlay, *one, surface.mean_edge) for one in listed], parts, normals)
    owner = owners(overlay, parts)
    nodes = joints.nodes(overlaps(overlay, owner))
    members = with_ends(joints, owner, nodes, surface)
    return MemberGraph(overlay.sheet, overlay.source, tuple(members), tuple(nodes))


def spherical_normals(surface: Surface) -> Floats:
    """(n, 3) unit normals at the vertices, exact on a sphere [Max 1999].

    Each face counts by the cross product of its two edges over their squared lengths. Area-weighted normals have an
    error of first order where edges differ in length, and so have the twists of members.
    """
    total = np.zeros((surface.n, 3))
    for corner in range(3):
        at, one, two = (surface.V[surface.F[:, (corner + k) % 3]] for k in range(3))
        one, two = one - at, two - at
        size = np.einsum("mi,mi->m", one, one) * np.einsum("mi,mi->m", two, two)
        np.add.at(total, surface.F[:, corner], np.cross(one, two) / size[:, None])
    return unit_vectors(total)


def _member(overlay: Overlay, name: str, part: int, one: Component, edge: float) -> Member:
    surface = overlay.sheet.surface
    area, axis, reach = float(surface.areas[one.cells].sum()), None, np.zeros((0, 2))
    kind = one.kind
    if one.line:
        axis = fitted_axis(one.line, one.width(surface.areas), edge)
        reach = sides(surface, one.cells[one.core], axis)
        kind = "stub" if kind == "strip" and axis.length < 2 * one.width(surface.areas) else kind
    return Member(name, cast(Kind, kind), one.family, one.stripe, part, one.cells, area, axis, reach, ())
