"""Graph of a design's members and nodes, with the order and names of the members."""

from collections.abc import Sequence
from string import ascii_lowercase
from typing import cast

import numpy as np

from dsfab.core.arrays import Floats, Ints, unit_vectors
from dsfab.members.axes import fitted_axis, sides
from dsfab.members.components import FAMILIES, Component, Kind, components, pattern_bands
from dsfab.members.graph import Joints, Member, MemberGraph, overlaps, with_ends
from dsfab.members.loose_cells import owners, with_loose_cells, without_followers
from dsfab.results import PatternResult
from dsfab.slicing import Overlay, Sheet, stripe_overlay
from dsfab.surface import Surface

TIE = 1e-3  # Positions along a structure with a smaller difference (fraction of the structure's size) count as equal.
ROUND, HOLLOW = 0.5, 0.4
"""Members form a ring if two ratios of their centroids exceed these values.
ROUND  : spread in the second principal direction / spread in the first principal direction.
HOLLOW : smallest distance of a centroid from the centre / largest distance."""


def along_structure(places: Floats, lengths: Floats, size: float) -> Ints:
    """Return the order (k,) of members along a structure, from centroids (k, 3) and lengths (k,), metres.
    size : largest dimension, m.    Members of a ring are ordered counter-clockwise from the x axis, seen from above."""
    if len(places) < 2:
        return np.arange(len(places))
    offset = places - places.mean(axis=0)
    spread, axes = np.linalg.svd(offset, full_matrices=False)[1:]
    spread, axes = np.append(spread, [0.0, 0.0])[:3], _pointing(np.linalg.svd(offset)[2] if len(places) < 3 else axes)
    key = offset @ axes[0]
    if len(places) > 2 and spread[1] > ROUND * spread[0]:
        up = axes[2]
        x = np.eye(3)[0] if abs(up[0]) < 1 / np.sqrt(2) else np.eye(3)[1]
        x = x - (x @ up) * up
        right, ahead = offset @ x / np.linalg.norm(x), offset @ np.cross(up, x / np.linalg.norm(x))
        radius = np.hypot(right, ahead)
        if radius.min() > HOLLOW * radius.max():
            turn = TIE * size / radius.max()
            key = np.mod(np.arctan2(ahead, right) + turn, 2 * np.pi) * radius.max()
        elif spread[1] > (1 - TIE) * spread[0]:
            key = offset @ x
    columns = [_steps(values, TIE * size) for values in (*places.T[::-1], lengths, key)]
    return np.lexsort(columns)


def _pointing(axes: Floats) -> Floats:
    largest = np.take_along_axis(axes, np.abs(axes).argmax(axis=1)[:, None], axis=1)
    return np.asarray(axes * np.where(largest < 0, -1.0, 1.0))


def _steps(values: Floats, gap: float) -> Ints:
    order = np.argsort(values, kind="stable")
    steps = np.empty(len(values), dtype=np.int64)
    steps[order] = np.concatenate([[0], np.cumsum(np.diff(values[order]) > gap)])
    return steps


KINDS = ("rim", "band", "ring", "disc", "plate", "fill")
"""Kinds of members besides strips, in their order in the list of members."""


def named_components(surface: Surface, pieces: Sequence[Component]) -> list[tuple[str, int, Component]]:
    """Return (name, part number, component) for each piece, in the order "A01", "A02a", "A02b" (part 2), "rim 1"."""
    listed = list[tuple[str, int, Component]]()
    for letter, same_kind in _kinds(pieces):
        groups = _groups(same_kind) if len(letter) == 1 else [[c] for c in same_kind]
        places = np.array([_place(surface, group) for group in groups]).reshape(-1, 3)
        lengths = np.array([sum(c.line.length if c.line else 0.0 for c in group) for group in groups])
        digits = len(str(max(len(groups), 10)))
        for number, k in enumerate(along_structure(places, lengths, surface.size).tolist(), 1):
            group = groups[k]
            label = f"{letter}{number:0{digits}d}" if len(letter) == 1 else f"{letter} {number}"
            for part, c in enumerate(group, 1):
                listed.append((label + (_letters(part) if len(group) > 1 else ""), part, c))
    return listed


def _kinds(pieces: Sequence[Component]) -> list[tuple[str, list[Component]]]:
    strips = [c for c in pieces if c.kind == "strip"]
    families = [(letter, [c for c in strips if c.family == name]) for name, letter in FAMILIES.items()]
    return families + [(kind, [c for c in pieces if c.kind == kind]) for kind in KINDS]


def _groups(pieces: list[Component]) -> list[list[Component]]:
    groups: dict[int, list[Component]] = {}
    for number, component in enumerate(pieces):
        groups.setdefault(component.group if component.group >= 0 else -1 - number, []).append(component)
    return list(groups.values())


def _place(surface: Surface, group: list[Component]) -> Floats:
    cells = np.concatenate([component.cells for component in group])
    return np.asarray(surface.areas[cells] @ surface.centroids[cells] / surface.areas[cells].sum())


def _letters(part: int) -> str:
    text = ""
    while part:
        part, digit = divmod(part - 1, len(ascii_lowercase))
        text = ascii_lowercase[digit] + text
    return text


def member_graph(surface: Surface, sheet: Sheet, pattern: PatternResult) -> MemberGraph:
    """Return the members of a sheet that was cut along a pattern, and the nodes where members meet."""
    bands = pattern_bands(surface, sheet, pattern)
    overlay = stripe_overlay(sheet, surface, [band.drawn for band in bands])
    normals = overlay.sheet.carry(spherical_normals(surface))
    pieces = components(overlay, bands, normals, surface.mean_edge)
    pieces = with_loose_cells(overlay, without_followers(overlay, pieces))
    listed = named_components(overlay.sheet.surface, pieces)
    parts = [entry for *_, entry in listed]
    joints = Joints(overlay, [_member(overlay, *entry, surface.mean_edge) for entry in listed], parts, normals)
    owner = owners(overlay, parts)
    nodes = joints.nodes(overlaps(overlay, owner))
    members = with_ends(joints, owner, nodes, surface)
    return MemberGraph(overlay.sheet, overlay.source, tuple(members), tuple(nodes))


def spherical_normals(surface: Surface) -> Floats:
    """Return unit normals (n, 3) at the vertices, exact on a sphere [Max 1999]."""
    total = np.zeros((surface.n, 3))
    for corner in range(3):
        corner_points, side_a, side_b = (surface.V[surface.F[:, (corner + k) % 3]] for k in range(3))
        side_a, side_b = side_a - corner_points, side_b - corner_points
        size = np.einsum("mi,mi->m", side_a, side_a) * np.einsum("mi,mi->m", side_b, side_b)
        np.add.at(total, surface.F[:, corner], np.cross(side_a, side_b) / size[:, None])
    return unit_vectors(total)


def _member(overlay: Overlay, name: str, part: int, component: Component, edge: float) -> Member:
    surface = overlay.sheet.surface
    area, axis, reach = float(surface.areas[component.cells].sum()), None, np.zeros((0, 2))
    kind = component.kind
    if component.line:
        axis = fitted_axis(component.line, component.width(surface.areas), edge)
        reach = sides(surface, component.cells[component.core], axis)
        kind = "stub" if kind == "strip" and axis.length < 2 * component.width(surface.areas) else kind
    return Member(
        name, cast(Kind, kind), component.family, component.stripe, part, component.cells, area, axis, reach, ()
    )
