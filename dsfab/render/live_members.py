"""The members of what is drawn: their names and measures, and where they run, so that the page finds them."""

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial import cKDTree

from dsfab.arrays import Floats
from dsfab.pipeline import Design
from dsfab.render.striped_mesh import StripedMesh

if TYPE_CHECKING:
    from dsfab.members import Member

STEP, MOST = 0.5, 400
"""Widths between two places along a member, and places of one member at most."""
SPOTS = 60
"""Places of a member without an axis, at most."""


def member_places(draft: Design, judged: bool = False) -> dict[str, Any]:
    """Each member with its name, length, width (metres), largest curvature (1/m) and places, ready for JSON.

    `members` have `places` [x, y, z, ...], metres from the middle of the structure's box as the page draws it, and
    `reach`, how far the member goes from these; `nearest` is the number of the member at each vertex of the drawn mesh.

    judged : also how much of what each can bear it bears (`utilisation`); None of those that are not judged. Raises
    DsfabError where no strength is known, nothing carries the loads, or the pattern leaves no material.
    """
    graph, V = draft.members, draft.surface.V
    middle = (V.min(axis=0) + V.max(axis=0)) / 2
    found = [_places(member, graph.sheet.surface.centroids) for member in graph.members]
    bears = draft.member_utilisation.by_member if judged else {}
    listed = [
        {
            "id": member.id,
            "length": member.length,
            "width": member.mean_width if member.axis else 2 * reach,
            "curvature": _curvature(member),
            "utilisation": bears.get(member.id),
            "reach": reach,
            "places": (P - middle).round(3).ravel().tolist(),
        }
        for member, (P, reach) in zip(graph.members, found, strict=True)
    ]
    return {"members": listed, "judged": judged, "nearest": _nearest(StripedMesh.of(draft).surface.V, found)}


def _places(member: "Member", centroids: Floats) -> tuple[Floats, float]:
    """(q, 3) places of a member, and how far it reaches from them, metres."""
    if member.axis:
        count = int(np.clip(np.ceil(member.length / (STEP * member.mean_width)), 2, MOST))
        P = member.axis.at(np.linspace(0, member.length, count))[0]
        return P, float(np.max(member.width)) / 2
    some = centroids[member.cells[:: max(1, len(member.cells) // SPOTS)]]
    return some, float(np.sqrt(member.area / (np.pi * len(some)))) * 2


def _curvature(member: "Member") -> float | None:
    """The largest of its axis but near its ends, where a spline knows less, 1/m; None without an axis."""
    axis = member.axis
    if axis is None:
        return None
    past = 0.0 if axis.closed else min(1.5 * member.mean_width, axis.length / 3)
    inside = (axis.s >= past) & (axis.s <= axis.length - past)
    return float(np.hypot(axis.kn, axis.kg)[inside].max(initial=0.0))


def _nearest(V: Floats, found: list[tuple[Floats, float]]) -> list[int]:
    """(n,) the number of the member whose places are nearest to each vertex, over how far it reaches."""
    best, number = np.full(len(V), np.inf), np.zeros(len(V), dtype=int)
    for k, (P, reach) in enumerate(found):
        away = np.asarray(cKDTree(P).query(V)[0]) / max(reach, 1e-9)
        nearer = away < best
        best[nearer], number[nearer] = away[nearer], k
    return [int(k) for k in number]
