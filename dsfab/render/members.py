"""Pictures of the members of a design, coloured by family and with names."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Floats, Ints
from dsfab.design import Design
from dsfab.render.colouring import rising_colours
from dsfab.render.drawing import FINER, Annotations, GroundKind, Stage, check_ground, legend, render_stage, set_stage
from dsfab.render.lettering import PAPER, Nameplate, Palette, place_names, with_legend, with_names
from dsfab.render.opengl import require_rendering
from dsfab.render.scene import Body, Bytes, Colour, Scene
from dsfab.render.striped_mesh import StripedMesh
from dsfab.render.view import View, named_side, up_axis

if TYPE_CHECKING:
    from dsfab.members import Member, MemberGraph


def member_places(draft: Design, judged: bool = False) -> dict[str, Any]:
    """Return data of all members for JSON: name, length and width (m), largest curvature (1/m), half-width `reach` (m).
    `places` are points [x, y, z, ...] on the member, m, from the middle of the surface's bounding box.
    `nearest` is the number of the nearest member at each vertex of the drawn mesh.
    judged : True to add `utilisation`, a number or None.    Raises DsfabError."""
    graph, V = draft.members, draft.surface.V
    middle = (V.min(axis=0) + V.max(axis=0)) / 2
    places = [_places(member, graph.sheet.surface.centroids) for member in graph.members]
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
        for member, (P, reach) in zip(graph.members, places, strict=True)
    ]
    return {"members": listed, "judged": judged, "nearest": _nearest(StripedMesh.from_design(draft).surface.V, places)}


def _places(member: "Member", centroids: Floats) -> tuple[Floats, float]:
    if member.axis:
        count = int(np.clip(np.ceil(member.length / (0.5 * member.mean_width)), 2, 400))
        return member.axis.frames_at(np.linspace(0, member.length, count))[0], float(np.max(member.width)) / 2
    points = centroids[member.cells[:: max(1, len(member.cells) // 60)]]
    return points, float(np.sqrt(member.area / (np.pi * len(points)))) * 2


def _curvature(member: "Member") -> float | None:
    axis = member.axis
    if axis is None:
        return None
    past = 0.0 if axis.closed else min(1.5 * member.mean_width, axis.length / 3)
    inside = (axis.s >= past) & (axis.s <= axis.length - past)
    return float(np.hypot(axis.kn, axis.kg)[inside].max(initial=0.0))


def _nearest(V: Floats, places: list[tuple[Floats, float]]) -> list[int]:
    least, number = np.full(len(V), np.inf), np.zeros(len(V), dtype=int)
    for k, (P, reach) in enumerate(places):
        away = np.asarray(cKDTree(P).query(V)[0]) / max(reach, 1e-9)
        nearer = away < least
        least[nearer], number[nearer] = away[nearer], k
    return [int(k) for k in number]


def members_picture(
    design: "Design",
    *,
    size: tuple[int, int] = (1600, 1200),
    view: str = "iso",
    ground: GroundKind = "paper",
    palette: Palette = PAPER,
) -> Bytes:
    """Return a picture of a design's sheet with named members, (height, width, 3 or 4) bytes. Raises DsfabError."""
    graph, palette = design.members, replace(palette, paper=(255, 255, 255)) if ground == "white" else palette
    words = f"{design.preset.name} - {len(graph.members)} members, {len(graph.nodes)} nodes"
    names = {member.id: _colour(member.kind, member.family, palette) for member in graph.members}
    drawing = _MembersDrawing(design, size, view, ground, palette)
    return drawing.picture(_colours(design, palette), names, words, _swatches(graph, palette))


def rated_members_picture(
    design: "Design", band: Ints, count: int, names: Sequence[str], *, size: tuple[int, int], palette: Palette = PAPER
) -> Bytes:
    """Return a picture of a design's sheet, coloured by band, with names of members: (height, width, 3) bytes.
    band : (m,) number of each cell's band, 0 to `count` - 1; -1 without a band.    Raises DsfabError."""
    table = np.array([*band_colours(count), palette.plain], dtype=np.uint8)
    ink = dict.fromkeys(names, palette.text)
    return _MembersDrawing(design, size, "iso", "paper", palette).picture(table[band], ink, "", ())


def band_colours(count: int) -> list[Colour]:
    """Return `count` colours, from pale to dark."""
    return [(int(r), int(g), int(b)) for r, g, b in rising_colours(np.linspace(0.04, 1, count))]


@dataclass(frozen=True)
class _MembersDrawing:
    design: "Design"
    size: tuple[int, int]
    view: str
    ground: GroundKind
    palette: Palette

    def picture(
        self, face: Bytes, names: Mapping[str, Colour], words: str, swatches: tuple[tuple[str, Colour], ...]
    ) -> Bytes:
        """Return the picture. face : (m, 3) colours of cells.    names : members to name, with colours.
        words : caption.    swatches : names of colours for the legend, with the colours."""
        check_ground(self.ground)
        require_rendering()
        design, size, palette = self.design, self.size, self.palette
        graph, sheet = design.members, design.members.sheet.surface
        load = design.load if design.has("statics") else None
        up = up_axis(sheet.V, design.surface, load)
        body = Body(sheet.V, sheet.F, face, casts=True)
        stage = set_stage(body, named_side(sheet.V, up, self.view), up, 0.0, Annotations(layers=()), palette, size)
        with Scene(stage.bodies, stage.centre, stage.radius) as scene:
            image = render_stage(scene, stage, palette, size, transparent=self.ground == "transparent")
            depth = scene.pixels(stage.view, FINER * size[0], FINER * size[1]).depth * stage.radius
        # letters are smaller if there are over 90 members and over 12 names
        letter = size[1] / 62 * min(1.0, np.sqrt(90 / len(graph.members)) if len(names) > 12 else 1.0)
        plates = list(nameplates(graph, stage, depth, (size, names, palette)))
        image = with_names(image, place_names(plates, size, letter), letter, palette.paper)
        return np.asarray(with_legend(image, legend(stage, words, palette, size, swatches), palette))


def _colour(kind: str, family: str, palette: Palette) -> Colour:
    if kind not in ("strip", "stub"):
        return palette.tints[2]
    return palette.tints[0] if family == "major" else palette.tints[1]


def _colours(design: "Design", palette: Palette) -> Bytes:
    graph, names = design.members, design.pattern.names
    family = np.array([_colour("strip" if name in ("major", "minor") else name, name, palette) for name in names])
    colours = family[graph.sheet.family].astype(np.uint8)
    for member in graph.members:
        if member.kind in ("fill", "plate"):
            colours[member.cells] = palette.tints[2]
    return colours


def _swatches(graph: "MemberGraph", palette: Palette) -> tuple[tuple[str, Colour], ...]:
    families = (("A: major", "major"), ("B: minor", "minor"))
    present = {member.family for member in graph.members if member.kind in ("strip", "stub")}
    swatches = [(words, _colour("strip", name, palette)) for words, name in families if name in present]
    if any(member.kind not in ("strip", "stub") for member in graph.members):
        swatches.append(("rims, kept and filled", palette.tints[2]))
    return tuple(swatches)


def nameplates(
    graph: "MemberGraph", stage: Stage, depth: np.ndarray, look: tuple[tuple[int, int], Mapping[str, Colour], Palette]
) -> Iterator[Nameplate]:
    """Yield a nameplate for each member to name. depth : (h, w) depth of each pixel, m.
    look : picture size in pixels; members to name, with colours; palette."""
    size, names, palette = look
    for member in (member for member in graph.members if member.id in names):
        seen = stage.view.page_coordinates(_points(graph, member, stage.view))
        pixels = np.stack([size[0] / 2 + seen[:, 0] * size[1] / 2, size[1] / 2 - seen[:, 1] * size[1] / 2], axis=1)
        column, row = (np.clip(FINER * pixels[:, k], 0, FINER * size[k] - 1).astype(int) for k in (0, 1))
        visible = np.asarray(depth[row, column] > seen[:, 2] - 0.02 * stage.radius)
        shade = 0.55 * np.array(names[member.id])
        if not visible.any():
            shade = (shade + palette.paper) / 2
        red, green, blue = shade.astype(int).tolist()
        yield Nameplate(member.id, (red, green, blue), pixels, visible)


def _points(graph: "MemberGraph", member: "Member", view: View, count: int = 41) -> Floats:
    """Return places (k, 3) for a member's name, the best place first."""
    if member.axis is None or member.kind == "disc":
        places = graph.sheet.surface.centroids[member.cells]
        return np.asarray(places[np.linalg.norm(places - places.mean(axis=0), axis=1).argsort(kind="stable")[:count]])
    s = np.linspace(0.04, 0.96, count) * member.length
    points = member.axis.frames_at(s)[0]
    away = view.page_coordinates(points)[:, 2] if member.axis.closed else np.abs(s - member.length / 2)
    nodes = np.array([node.at[node.members.index(member.id)] for node in graph.nodes_along[member.id]])
    near_node = np.abs(s[:, None] - nodes).min(axis=1, initial=np.inf) < 1.5 * member.mean_width
    return np.asarray(points[np.lexsort([away, near_node])])
