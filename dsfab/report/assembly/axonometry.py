"""Members in parallel projection [painter's algorithm]."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.members import Member, MemberGraph
from dsfab.render import Palette
from dsfab.workshop import Layering, WorkshopPlan, is_strip, layer_numbers, placed_parts

DRAWN_PIECES = 90  # Number of drawn pieces of a member that is as long as the structure.
PLATE_COLOUR = (150, 146, 140)  # Colour of the plates of nodes.
LEAST_ELEVATION, AZIMUTH = 28.0, -58.0  # Direction of the usual view, degrees.


@dataclass(frozen=True, eq=False)
class Axonometry:
    """Direction of a view: unit vectors (3,) to the right, upwards and towards the eye."""

    right: Floats
    upwards: Floats
    eye: Floats

    @classmethod
    def from_angles(cls, up: Floats, azimuth: float = AZIMUTH, elevation: float = LEAST_ELEVATION) -> Self:
        """Return a view by its azimuth about `up` and its elevation, degrees; elevation 90 is a plan."""
        x = np.array([1.0, 0.0, 0.0])
        y = np.cross(up, x)
        a, e = np.radians(azimuth), np.radians(elevation)
        outwards = np.cos(a) * x + np.sin(a) * y
        eye = np.cos(e) * outwards + np.sin(e) * up
        upwards = -np.sin(e) * outwards + np.cos(e) * up
        return cls(np.cross(upwards, eye), upwards, eye)

    def projected(self, points: Floats) -> Floats:
        """Project points (..., 3) onto the picture (..., 2), metres."""
        return np.asarray(points @ np.stack([self.right, self.upwards], axis=1))


@dataclass(frozen=True, eq=False)
class MemberFaces:
    """Faces of a member as quads (q, 4, 3), metres; a triangle repeats its last corner."""

    id: str
    colour: tuple[float, float, float]
    quads: Floats

    @property
    def middle(self) -> Floats:
        """Point (3,) near the middle of the member, metres."""
        return np.asarray(self.quads[len(self.quads) // 2].mean(axis=0))


def drawn_faces(plan: WorkshopPlan, palette: Palette) -> list[MemberFaces]:
    """Return the faces to draw: of all bars and plates, or of all members if the plan has no bars."""
    assert plan.graph is not None
    if plan.bars:
        return bar_faces(plan, palette)
    graph, stock = plan.graph, plan.planks.stock if plan.planks else None
    layering, built = plan.layering or Layering(0.0, 2, 0.0), {part.member for part in plan.parts}
    piece = float(np.linalg.norm(np.ptp(graph.sheet.surface.V, axis=0))) / DRAWN_PIECES
    faces = []
    for member in graph.members:
        if member.id not in built or (member.kind == "fill" and not stock):
            continue
        if not is_strip(member):
            quads = _cell_quads(graph, member)
        elif stock:
            quads = _plank_quads(member, piece, stock.thickness, stock.depth)
        else:
            quads = _strip_quads(member, piece, layering.layer_height(layer_numbers(layering, member)[0]))
        faces.append(MemberFaces(member.id, _shares(_member_colour(member, palette)), quads))
    return faces


def bar_faces(plan: WorkshopPlan, palette: Palette) -> list[MemberFaces]:
    """Return the faces of all bars and of all plates at nodes."""
    assert plan.bars is not None
    assert plan.graph is not None
    members, faces = plan.graph.by_id, []
    for part in placed_parts(plan.bars):
        tint = _member_colour(members[part.member], palette) if part.member else PLATE_COLOUR
        faces.append(MemberFaces(part.id, _shares(tint), part.quads))
    return faces


def _shares(colour: tuple[int, int, int]) -> tuple[float, float, float]:
    red, green, blue = colour
    return red / 255, green / 255, blue / 255


def _plank_quads(member: Member, piece: float, thickness: float, depth: float) -> Floats:
    axis = member.axis
    assert axis is not None
    P, T, N = axis.frames_at(np.linspace(0, axis.length, max(int(np.ceil(axis.length / piece)), 2) + 1))
    aside, up = thickness / 2 * np.cross(N, T), depth / 2 * N
    pairs = ((P - up - aside, P + up - aside), (P - up + aside, P + up + aside), (P + up - aside, P + up + aside))
    sides = [np.stack([lower[:-1], lower[1:], upper[1:], upper[:-1]], axis=1) for lower, upper in pairs]
    return np.stack(sides, axis=1).reshape(-1, 4, 3)


def faces_by_member(faces: list[MemberFaces], plan: WorkshopPlan) -> list[MemberFaces]:
    """Return the faces of each member: the faces of all bars of the member, without plates at nodes."""
    member = {part.id: part.member for part in plan.parts}
    faces_of: dict[str, list[MemberFaces]] = {}
    for face in faces:
        if member[face.id]:
            faces_of.setdefault(member[face.id], []).append(face)
    return [
        MemberFaces(name, parts[0].colour, np.concatenate([face.quads for face in parts]))
        for name, parts in faces_of.items()
    ]


def _member_colour(member: Member, palette: Palette) -> tuple[int, int, int]:
    families = {"major": 0, "minor": 1}
    return palette.tints[families.get(member.family, 2) if member.kind in ("strip", "stub") else 2]


def _cell_quads(graph: MemberGraph, member: Member) -> Floats:
    corners = graph.sheet.surface.V[graph.sheet.surface.F[member.cells]]
    return np.concatenate([corners, corners[:, 2:]], axis=1)


def _strip_quads(member: Member, piece: float, height: float) -> Floats:
    axis = member.axis
    assert axis is not None
    s = np.linspace(0, axis.length, max(int(np.ceil(axis.length / piece)), 2) + 1)
    P, T, N = axis.frames_at(s)
    B = np.cross(N, T)
    left_side, right_side = (np.interp(s, axis.s, side)[:, None] for side in member.sides.T)
    right_edge, left_edge = P + height * N - right_side * B, P + height * N + left_side * B
    return np.stack([right_edge[:-1], right_edge[1:], left_edge[1:], left_edge[:-1]], axis=1)


@dataclass(frozen=True, eq=False)
class FaceList:
    """Faces in drawing order: corners (q, 4, 2), metres, and colours (q, 3), 0 to 1."""

    corners: Floats
    colours: Floats


def painted_faces(
    faces: list[MemberFaces], view: Axonometry, colours: dict[str, tuple[float, float, float]]
) -> FaceList:
    """Return all faces in drawing order, the farthest first. colours : new colours of some members, by name."""
    quads = np.concatenate([face.quads for face in faces])
    tints = np.concatenate([np.tile(colours.get(face.id, face.colour), (len(face.quads), 1)) for face in faces])
    n = np.cross(quads[:, 1] - quads[:, 0], quads[:, 2] - quads[:, 0])
    facing = np.abs(n @ view.eye) / np.maximum(np.linalg.norm(n, axis=1), 1e-30)
    tints = tints * (0.7 + 0.3 * facing)[:, None]  # faces seen edge-on are darker
    order = (quads.mean(axis=1) @ view.eye).argsort(kind="stable")
    return FaceList(view.projected(quads[order]), tints[order])
