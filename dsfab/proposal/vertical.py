"""A guess which axis of a mesh points to the sky: z, or y as in files of Blender and web tools."""

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from dsfab.arrays import Floats, closed_length
from dsfab.surface import Surface, Up, upright

CLEAR = 0.1
"""By this much y has to look better than z before it is taken for the vertical axis."""
CLEAR_IN = {".3mf": np.inf, ".3dm": np.inf, ".dxf": np.inf, ".glb": np.inf, ".gltf": np.inf}
CLEAR_IN |= dict.fromkeys((".stl", ".step", ".stp", ".brep"), 0.5)
"""The same for files whose format or program says which axis is up (glTF's is z once it is read), and for those of
which most have z up: a bench and a facade were laid on their backs."""
SLICE = 0.05
"""Share of the height in which boundary counts as the bottom or the top."""
SOLE = 0.03
"""Share of the height over its lowest point in which vertices are what a surface stands on."""
PINHOLES = 0.02
"""Boundary shorter than this share of the side of a square of the same area makes no surface open."""
GROUND = 1e-3
"""Share of its size within which a surface touches the plane through the origin."""
LONG_EDGE = 0.7
"""Share of its length in plan along which a wall's edge is on the ground."""
RINGS = 0.8
"""Share of the boundary that has to lie in level rings, for a structure that stands on one or hangs from it; the rest
are doors and windows."""


def likely_up(surface: Surface, suffix: str = "", usual: str | None = None) -> Up:
    """z; or y, or -y, where the surface plainly stands better that way up, as files of Blender and web tools may.

    suffix : of its file, with the dot; files of some formats have z up: see `CLEAR_IN`.
    usual  : "y" or "z", which the program that wrote the file has up unasked; None where that is not known.

    An open surface is judged by how much of it a plan shows, by how much more of its boundary lies at its bottom than
    at its top, and by how well it stands; a closed one by how well it stands alone. What ends in level rings, as a
    tower, a vase or a bowl does, has z up. What has y over 0 everywhere has not -y up. A wall shows nothing in plan,
    and would always be laid on its back: what stands on the ground with a long edge has z up, or y where its program
    has.
    """
    if usual == "z" or _ends_in_level_rings(surface) or _stands_on_ground(surface, "z"):
        return "z"
    if usual == "y" and _stands_on_ground(surface, "y"):
        return "y"
    below = surface.V[:, 1].min() < -GROUND * surface.size  # else -y would put all of it under the ground
    others: tuple[Up, ...] = ("y", "-y") if below else ("y",)
    score = {axis: _standing(surface, axis) for axis in others}
    best = max(others, key=lambda axis: score[axis])
    return best if score[best] > _standing(surface, "z") + CLEAR_IN.get(suffix.lower(), CLEAR) else "z"


def _stands_on_ground(surface: Surface, up: Up) -> bool:
    """Whether it stands on the plane through the origin with a long edge, and its face is drawn about that plane, not
    on it, with the other axis up: as a wall is, or a screen.

    A roof with y up stands on y = 0, or is above it: there is none of it under that plane.
    """
    V = upright(surface.V, up)
    level, through = V[:, 2], V[:, 1]  # the other axis of the two
    near = GROUND * surface.size
    if abs(level.min()) > near or not (through.min() < -near < near < through.max() or np.ptp(through) < near):
        return False
    ends = surface.edges.ends[surface.edges.boundary]
    on = (np.abs(level[ends]) <= near).all(axis=1)
    length = np.linalg.norm(V[ends[:, 0]] - V[ends[:, 1]], axis=1)
    return bool(length[on].sum() > LONG_EDGE * np.ptp(V[:, 0]))


def _ends_in_level_rings(surface: Surface) -> bool:
    """Whether nearly all of its boundary are closed lines that are level with z up."""
    if is_nearly_closed(surface):
        return False
    flat = SLICE * float(np.ptp(surface.V[:, 2]))
    rings = [surface.V[loop] for loop in surface.loops]
    length = np.array([closed_length(ring) for ring in rings])
    level = np.array([np.ptp(ring[:, 2]) <= flat for ring in rings])
    return bool(length[level].sum() > RINGS * length.sum())


def _standing(surface: Surface, up: Up) -> float:
    """How well a surface stands with that axis up; about 0 to 2 of an open one, -0.2 to 0.4 of a closed one."""
    V = upright(surface.V, up)
    stability = _stability(V, surface)
    if is_nearly_closed(surface):
        return stability
    k = "xyz".index(up[-1])
    plan = float(surface.areas @ np.abs(surface.normals[:, k]) / surface.area)
    ends = surface.edges.ends[surface.edges.boundary]
    length = np.linalg.norm(V[ends[:, 0]] - V[ends[:, 1]], axis=1)
    z = V[ends, 2].mean(axis=1)
    low, high = V[:, 2].min(), V[:, 2].max()
    bottom = length[z < low + SLICE * (high - low)].sum()
    top = length[z > high - SLICE * (high - low)].sum()
    return plan + float((bottom - top) / length.sum()) + 0.5 * stability


def is_nearly_closed(surface: Surface) -> bool:
    """Whether it has no boundary, or pinholes only."""
    return bool(surface.edge_lengths[surface.edges.boundary].sum() < PINHOLES * np.sqrt(surface.area))


def _stability(V: Floats, surface: Surface) -> float:
    """How far inside of what it stands on the middle of its weight lies, over the side of a square of its area.

    V : (n, 3) its vertices with z up. Between -0.2, it falls over, and 0.4.
    """
    height = np.ptp(V[:, 2])
    on = V[V[:, 2] <= V[:, 2].min() + SOLE * height, :2]
    middle = surface.areas @ V[surface.F, :2].mean(axis=1) / surface.area
    try:
        plane = ConvexHull(on).equations  # a point is inside where all of them are negative
    except (QhullError, ValueError):
        return -0.2  # a point or a line: it stands on no area
    inside = -(plane[:, :2] @ middle + plane[:, 2]).max()
    return float(np.clip(inside / np.sqrt(surface.area), -0.2, 0.4))
