"""`member_graph`: the graph of a design's members, from its pattern and its finished sheet."""

from typing import cast

import numpy as np

from dsfab.arrays import Floats, unit_vectors
from dsfab.members.axis import fitted_axis
from dsfab.members.bands import Kind, pattern_bands
from dsfab.members.components import Component, components
from dsfab.members.following import without_followers
from dsfab.members.graph import Member, MemberGraph
from dsfab.members.loose import owners, with_loose
from dsfab.members.naming import named
from dsfab.members.nodes import Joints, with_ends
from dsfab.members.overlaps import overlaps
from dsfab.members.widths import sides
from dsfab.results import PatternResult
from dsfab.slicing import Overlay, Sheet, overlaid
from dsfab.surface import Surface

STUB = 2.0
"""A strip is a stub if it is shorter than so many times its width."""


def member_graph(surface: Surface, sheet: Sheet, pattern: PatternResult) -> MemberGraph:
    """The members of a kept sheet that was cut from `surface` along a pattern, and their nodes."""
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
    """(n, 3) unit normals at the vertices, exact where these lie on a sphere [Max 1999].

    Each face counts by the cross product of its two edges there over their squared lengths; area-weighted normals are
    off in the first order of the edges where these differ, and twists of members along with them.
    """
    total = np.zeros((surface.n, 3))
    for corner in range(3):
        at, one, two = (surface.V[surface.F[:, (corner + k) % 3]] for k in range(3))
        one, two = one - at, two - at
        size = np.einsum("mi,mi->m", one, one) * np.einsum("mi,mi->m", two, two)
        np.add.at(total, surface.F[:, corner], np.cross(one, two) / size[:, None])
    return unit_vectors(total)


def _member(overlay: Overlay, name: str, part: int, one: Component, edge: float) -> Member:
    """A component by its name, with its axis; `edge` of the uncut mesh, metres."""
    surface = overlay.sheet.surface
    area, axis, reach = float(surface.areas[one.cells].sum()), None, np.zeros((0, 2))
    kind = one.kind
    if one.line:
        axis = fitted_axis(one.line, one.width(surface.areas), edge)
        reach = sides(surface, one.cells[one.core], axis)
        kind = "stub" if kind == "strip" and axis.length < STUB * one.width(surface.areas) else kind
    return Member(name, cast(Kind, kind), one.family, one.stripe, part, one.cells, area, axis, reach, ())
