"""Card models: their scale and limits, and panels with tabs.

══════════╗╔══════════   a continuous member
     ─────╢╟─────        crossing members end at the edges of the continuous member, each with a tab glued beneath it
══════════╝╚══════════

Edges and kept regions are continuous; where stripes cross, the major family is continuous. Panels lie in the surface.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise, product

import numpy as np

from dsfab.core.arrays import Floats, lock
from dsfab.core.messages import length, names_and_count
from dsfab.core.units import MM_PER_M
from dsfab.members import Member, MemberGraph, Node
from dsfab.surface import Surface
from dsfab.workshop.development import Development, StripCourse, member_course
from dsfab.workshop.ground import BasePlane, StripFoot
from dsfab.workshop.layers import Layering
from dsfab.workshop.parts import NAME_SHARE, FlatPart, Hole, label, text_length
from dsfab.workshop.splices import splice_cuts, strip_fits
from dsfab.workshop.strips import HOLE_FIT, StripLimits, bending_strain, is_strip, letter_height

CREASE_STRAIN = 0.01  # rule of thumb: greyboard creases at a bending radius of 50 thicknesses
NARROWEST = 0.002  # smallest width of card strips (m); narrower strips tear at holes
MODEL_LETTERS = (0.003, 0.002)  # largest heights of part names and of node names (m)


def scaled_surface(surface: Surface, scale: float) -> Surface:
    """Return a surface at the size of a model at 1 : `scale`."""
    return Surface(surface.V / scale, surface.F)


def scaled_graph(graph: MemberGraph, scale: float) -> MemberGraph:
    """Return members and nodes at the size of a model at 1 : `scale`."""
    sheet = replace(graph.sheet, surface=scaled_surface(graph.sheet.surface, scale))
    members = tuple(_scaled_member(member, scale) for member in graph.members)
    nodes = [replace(n, point=n.point / scale, area=n.area / scale**2) for n in graph.nodes]
    nodes = [replace(node, at=(node.at[0] / scale, node.at[1] / scale)) for node in nodes]
    return replace(graph, sheet=sheet, members=members, nodes=tuple(nodes))


def _scaled_member(member: Member, scale: float) -> Member:
    axis = member.axis
    if axis is not None:
        lengths = {name: getattr(axis, name) / scale for name in ("s", "P", "traced", "strayed")}
        axis = replace(axis, **lengths, **{name: getattr(axis, name) * scale for name in ("kg", "kn", "tg")})
    return replace(member, area=member.area / scale**2, axis=axis, sides=member.sides / scale)


def model_notes(limits: StripLimits, graph: MemberGraph, scale: float, bolt: float) -> list[str]:
    """Return notes on a card model. graph : members at the size of the model. bolt : diameter of the pins (m)."""
    notes = []
    card = f"card of {length(limits.thickness)}"
    bending_text = f"{card} bends to a strain of {limits.bending:.2%} ({limits.member} most)"
    thinner = np.floor(1e4 * limits.thickest) / 1e4 if limits.bending else 0.0
    if limits.bending > CREASE_STRAIN:
        notes.append(
            f"NOT SMOOTH: {bending_text}, and greyboard creases at a strain of about {CREASE_STRAIN:.0%}: set "
            f"--thickness to {MM_PER_M * thinner:g}mm or less, or build a larger model"
        )
    else:
        notes.append(f"{bending_text}; greyboard creases at about {CREASE_STRAIN:.0%}")
    narrow = sorted((member for member in graph.members if is_strip(member)), key=lambda member: member.mean_width)
    narrow = [member for member in narrow if member.mean_width < NARROWEST]
    if narrow:
        least = narrow[0].mean_width
        larger = _rounded_scale(scale * least / NARROWEST)
        notes.append(
            f"TOO NARROW: {len(narrow)} of the members are narrower than {length(NARROWEST)} and would tear "
            f"({narrow[0].id} is {length(least)} wide): build at 1:{larger:g} or larger, or make members "
            f"{length(NARROWEST * scale)} wide in the structure, see [pattern.width]"
        )
    fit = 1e-4  # largest error (m) that a coarse mesh may cause in the length between two pins of the model
    wanted_edge = limits.wanted_edge * np.sqrt(fit / HOLE_FIT) * scale if bolt else np.inf
    if limits.edge * scale > 1.05 * wanted_edge:
        notes.append(
            f"HOLES MAY MISS EACH OTHER: the mesh, with edges of {length(limits.edge * scale)}, is too coarse for "
            f"this model; set surface.edge to {wanted_edge:.2g} or less"
        )
    return notes


def packing_parts(graph: MemberGraph, layering: Layering) -> list[FlatPart]:
    """Return squares of card that fill gaps between the strips at nodes."""
    families = {member.id: member.family for member in graph.members}
    squares = []
    for node in graph.nodes:
        if node.kind != "grazing" and all(is_strip(graph.by_id[name]) for name in node.members):
            side = min(graph.by_id[name].mean_width for name in node.members)
            square = side / 2 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
            hole = Hole(np.zeros(2), layering.bolt, node.id)
            squares += [
                FlatPart(f"{node.id}.p{k}", "", (0.0, 0.0), square, (hole,))
                for k in range(1, layering.packing_layers(node, families) + 1)
            ]
    return squares


def _rounded_scale(limit: float) -> float:
    usual = [k * 10.0**power for power in range(5) for k in (1.0, 2.0, 2.5, 5.0)]
    return max((scale for scale in usual if scale <= limit), default=float(np.floor(10 * limit) / 10))


THROUGH_ORDER = ("keep", "rim", "major", "minor")  # where two families cross, the family named first here is continuous
ROOT_SHARE, TIP_SHARE = 0.8, 0.6  # widths of a tab at its base and tip, in panel widths
TAB_GAP_SHARE = 0.15  # distance of a tab's tip from the axis of the crossing member, in half widths of that member
SHARP_SINE = float(np.sin(np.radians(25.0)))  # members that cross at sharper angles are glued on each other, not cut


@dataclass
class PanelParts:
    """Panels (pieces of members) of a card model, with counts for notes.
    sharp   : names of nodes with a sharp angle between members.
    covered : number of pieces that are too short for a panel.
    feet    : name and foot of each panel that stands on the base plate."""

    parts: list[FlatPart] = field(default_factory=list)
    sharp: list[str] = field(default_factory=list)
    covered: int = 0
    tabs: int = 0
    feet: list[tuple[str, StripFoot]] = field(default_factory=list)

    @property
    def lines(self) -> list[str]:
        """Sentences for the builder about the panels."""
        sentences = [
            f"{len(self.parts)} panels in one skin with {self.tabs} tabs: at crossings, members of family A are "
            f"uninterrupted and members of family B are cut; members along edges cut both families"
        ]
        if self.sharp:
            nodes = names_and_count(self.sharp)
            sentences.append(f"two members meet at an angle below 25 degrees at {nodes}: glue one on top of the other")
        if self.covered:
            sentences.append(
                f"{self.covered} bays (parts between nodes) are too short for a panel: the members at both ends cover "
                f"these bays"
            )
        return sentences


@dataclass(frozen=True, eq=False)
class _CrossingEdge:
    name: str
    s: float
    way: Floats
    half: float
    over: bool

    def __post_init__(self) -> None:
        lock(self, "way", np.float64, (2,))

    def stations(self, side: int, away: float, y: Floats) -> Floats:
        """Return the arc lengths (q,) of points `away` metres from the axis of the crossing member.
        y : (q,) distances of the points left of this member's axis, metres."""
        nx, ny = np.array([-self.way[1], self.way[0]]) * np.sign(-self.way[1]) * side
        return np.asarray(self.s + (away - y * ny) / nx)


def panel_parts(
    graph: MemberGraph,
    thickness: float,
    letters: float,
    room: list[tuple[float, float]],
    ground: BasePlane | None = None,
) -> PanelParts:
    """Return the panels of all strips of a graph at model size.
    letters : largest height of names, metres.    room : lengths and widths of the stock, metres.
    ground  : base plate for feet with tabs; None for ends without feet."""
    members = [member for member in graph.members if is_strip(member)]
    widest = max((member.mean_width for member in members), default=0.0)
    courses = {member.id: member_course(graph, member, 0.0, 6 * widest) for member in members}
    rank = {member.id: (THROUGH_ORDER.index(member.family), k) for k, member in enumerate(members)}
    panels = PanelParts()
    for member in members:
        crossings = (_crossing_edge(graph, node, member, courses, rank) for node in graph.nodes_along[member.id])
        edges = [edge for edge in crossings if edge is not None]
        course, feet = ground.cut_course(courses[member.id], 0.0) if ground else (courses[member.id], ())
        _MemberPanels(member, course, thickness, letters, feet).add_panels(panels, edges, room)
    panels.sharp = list(dict.fromkeys(panels.sharp))
    return panels


def _crossing_edge(
    graph: MemberGraph, node: Node, member: Member, courses: dict[str, StripCourse], rank: dict[str, tuple[int, int]]
) -> _CrossingEdge | None:
    k = node.members.index(member.id)
    crossing_name = node.members[1 - k]
    if crossing_name not in courses or crossing_name == member.id or not np.isfinite(node.at).all():
        return None
    course, across = courses[member.id], courses[crossing_name]
    s, t = course.wrapped_station(node.at[k]), across.wrapped_station(node.at[1 - k])
    (_, T, N), (_, U, _) = (tuple(x[0] for x in c.frame_at(np.array([r]))) for c, r in ((course, s), (across, t)))
    direction = np.array([U @ T, U @ np.cross(N, T)])
    half = float(across.width(np.array([t]))[0]) / 2
    return _CrossingEdge(node.id, s, direction / np.linalg.norm(direction), half, rank[crossing_name] < rank[member.id])


@dataclass(frozen=True)
class _PanelEnd:
    right: float
    left: float
    tab: tuple[Floats, Floats] = (np.zeros(0), np.zeros(0))
    foot: StripFoot | None = None


@dataclass(frozen=True)
class _MemberPanels:
    member: Member
    course: StripCourse
    thickness: float
    letters: float
    feet: tuple[StripFoot, ...] = ()

    def add_panels(self, panels: PanelParts, edges: Sequence[_CrossingEdge], room: list[tuple[float, float]]) -> None:
        layer = Development(self.course, 0.0)
        panels.sharp += [edge.name for edge in edges if edge.over and abs(edge.way[1]) < SHARP_SINE]
        cuts = sorted((e for e in edges if e.over and abs(e.way[1]) >= SHARP_SINE), key=lambda edge: edge.s)
        under = [edge for edge in edges if not edge.over and abs(edge.way[1]) >= SHARP_SINE]
        bounds = [None, *cuts, None]
        pieces = list[tuple[_PanelEnd, _PanelEnd]]()
        for before, after in pairwise(bounds):
            ends = self._ends_with_foot(self._end(before, 1), self._end(after, -1))
            if min(ends[1].right - ends[0].right, ends[1].left - ends[0].left) <= 0:
                panels.covered += before is not None and after is not None
                continue
            pieces += self._pieces(layer, ends, under, room)
        for number, (begin, end) in enumerate(pieces, 1):
            name = self.member.id if len(pieces) == 1 else f"{self.member.id}.{number}"
            panels.tabs += sum(len(panel_end.tab[0]) > 0 and panel_end.foot is None for panel_end in (begin, end))
            panels.feet += [(name, panel_end.foot) for panel_end in (begin, end) if panel_end.foot]
            panels.parts.append(self._part(layer, name, begin, end, under))

    def _sides(self, s: float) -> tuple[float, float]:
        course = self.course
        return float(np.interp(s, course.s, course.right)), float(np.interp(s, course.s, course.left))

    def _end(self, edge: _CrossingEdge | None, side: int) -> _PanelEnd:
        if edge is None:
            if foot := next((foot for foot in self.feet if foot.at_end == (side == -1)), None):
                along = np.array([foot.shoulders[1], *foot.tips, foot.shoulders[2]])
                corners = along, np.repeat(foot.sides[1:3], 2)
                return _PanelEnd(float(foot.shoulders[0]), float(foot.shoulders[3]), corners, foot)
            s = self.course.begin if side == 1 else self.course.end
            return self._splice_end(s) if self.course.closed and side == -1 else _PanelEnd(s, s)
        w_right, w_left = self._sides(edge.s)
        shoulders = edge.stations(side, edge.half, np.array([-w_right, w_left]))
        y = np.array([-ROOT_SHARE * w_right, -TIP_SHARE * w_right, TIP_SHARE * w_left, ROOT_SHARE * w_left])
        away = edge.half * np.array([1.0, TAB_GAP_SHARE, TAB_GAP_SHARE, 1.0])
        tab = np.array([float(edge.stations(side, a, np.array([b]))[0]) for a, b in zip(away, y, strict=True)])
        return _PanelEnd(float(shoulders[0]), float(shoulders[1]), (tab, y))

    def _ends_with_foot(self, begin: _PanelEnd, end: _PanelEnd) -> tuple[_PanelEnd, _PanelEnd]:
        least = 0.1 * self.member.mean_width  # least length of the panel between its two tabs
        if begin.foot and len(end.tab[0]):
            low = max(begin.right, begin.left) + least
            if low < end.tab[0][1:3].min():
                tab = np.maximum(end.tab[0], low), end.tab[1]
                return begin, replace(end, right=max(end.right, low), left=max(end.left, low), tab=tab)
        if end.foot and len(begin.tab[0]):
            high = min(end.right, end.left) - least
            if high > begin.tab[0][1:3].max():
                tab = np.minimum(begin.tab[0], high), begin.tab[1]
                return replace(begin, right=min(begin.right, high), left=min(begin.left, high), tab=tab), end
        return begin, end

    def _splice_end(self, s: float) -> _PanelEnd:
        w_right, w_left = self._sides(s)
        y = np.array([-ROOT_SHARE * w_right, -TIP_SHARE * w_right, TIP_SHARE * w_left, ROOT_SHARE * w_left])
        return _PanelEnd(s, s, (s + (w_right + w_left) * np.array([0.0, 1.0, 1.0, 0.0]), y))

    def _pieces(
        self,
        layer: Development,
        ends: tuple[_PanelEnd, _PanelEnd],
        under: Sequence[_CrossingEdge],
        room: list[tuple[float, float]],
    ) -> list[tuple[_PanelEnd, _PanelEnd]]:
        begin, end = min(ends[0].right, ends[0].left), max(ends[1].right, ends[1].left)
        fits, width = strip_fits(layer, room), self.member.mean_width
        stations = np.array([edge.s for edge in under if begin < edge.s < end])
        tabs = 1.2 * width  # each end needs this length for a tab (m)
        cuts = splice_cuts((begin, end), stations, 1.5 * width, lambda a, b: fits(a - tabs, b + tabs)).stations[1:-1]
        spliced_ends = [ends[0], *(self._splice_end(cut) for cut in cuts), ends[1]]
        begins = [ends[0], *(_PanelEnd(cut, cut) for cut in cuts)]
        return list(zip(begins, spliced_ends[1:], strict=True))

    def _part(
        self, layer: Development, name: str, begin: _PanelEnd, end: _PanelEnd, under: Sequence[_CrossingEdge]
    ) -> FlatPart:
        course = self.course
        s, t = layer.stations(begin.right, end.right), layer.stations(begin.left, end.left)[::-1]
        right_edge, left_edge = -np.interp(s, course.s, course.right), np.interp(t, course.s, course.left)
        end_tab = [layer.to_plane(*end.tab)] if len(end.tab[0]) else []
        begin_tab = [layer.to_plane(begin.tab[0][::-1], begin.tab[1][::-1])] if len(begin.tab[0]) else []
        outline = np.concatenate([layer.to_plane(s, right_edge), *end_tab, layer.to_plane(t, left_edge), *begin_tab])
        span = (begin.right + begin.left) / 2, (end.right + end.left) / 2
        axis = layer.middle_line_at(layer.stations(*span))[0]
        stood = [*span, *(x for panel_end in (begin, end) if begin.foot or end.foot for x in panel_end.tab[0])]
        position, angle = layer.middle_line_at(np.array([(min(stood) + max(stood)) / 2]))
        high = letter_height(self.member.mean_width, self.letters)
        high *= min(1.0, NAME_SHARE * (max(stood) - min(stood)) / text_length(name, high))
        marks = [*label(name, position[0], float(angle[0]), high), *self._ticks(layer, span, under)]
        strain = bending_strain(course, span, self.thickness)
        return FlatPart(name, self.member.id, span, outline, (), (), tuple(marks), 0.0, strain, axis).along_x()

    def _ticks(self, layer: Development, span: tuple[float, float], under: Sequence[_CrossingEdge]) -> list[Floats]:
        ticks, share = list[Floats](), 0.25  # share: length of a tick divided by the width
        for edge in under:
            right_width, left_width = self._sides(edge.s)
            right = np.array([-right_width, -right_width + 2 * share * right_width])
            left = np.array([left_width - 2 * share * left_width, left_width])
            for y, side in product((right, left), (1, -1)):
                s = edge.stations(side, edge.half, y)
                if span[0] < s.min() and s.max() < span[1]:
                    ticks.append(layer.to_plane(s, y))
        return ticks
