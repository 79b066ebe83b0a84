"""Flat parts of strips, and limits of bending and stretching."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.arrays import Floats, Ints, area_vectors
from dsfab.core.messages import length
from dsfab.members import Member, MemberGraph, spherical_normals
from dsfab.surface import Surface
from dsfab.workshop.development import Development, StripCourse, member_course, turns_within_its_width, uncurled_span
from dsfab.workshop.ground import BasePlane, StripFoot, outline_with_feet
from dsfab.workshop.layers import END_DISTANCE, Layering, courses_without_curls, shortened_courses, vanished_courses
from dsfab.workshop.parts import NAME_SHARE, FlatPart, Hole, label, text_length
from dsfab.workshop.splices import SCARF_SLOPE, Cuts, lap_marks, lapped_span, splice_cuts, strip_fits

STRIP_KINDS = ("strip", "stub", "rim", "band", "ring")  # kinds of members that are built as strips
HOLE_EDGE_DISTANCE = 1.0  # least distance from a hole's middle to the edges of its part, in bolt diameters
LEGIBLE_HEIGHT, TALL_LETTER_SHARE = 0.002, 0.6  # letters on narrow parts: height (m), and largest share of the width


@dataclass(frozen=True)
class StripBolt:
    """Bolt of a member: surface point (3,), unit normal (3,), and arc length s on the member's axis."""

    name: str
    point: Floats
    normal: Floats
    s: float


@dataclass
class StripParts:
    """Flat parts of all strips, and cover plates of splices.
    missing_holes : nodes without a hole in a part, "N003 in A07".    splices_near_nodes : number of splices near nodes.
    shortened     : members that stop early, because of a collision in their layer, or a sharp turn at an end.
    vanished      : members that are not built, because they would be shorter than wide.
    missed_nodes  : (node, member) names of nodes that a shortened member does not reach.
    feet          : pairs of a part's name and the foot on the base plate."""

    pieces: list[FlatPart] = field(default_factory=list)
    covers: list[FlatPart] = field(default_factory=list)
    missing_holes: list[str] = field(default_factory=list)
    splices_near_nodes: int = 0
    splice_count: int = 0
    shortened: list[str] = field(default_factory=list)
    vanished: list[str] = field(default_factory=list)
    missed_nodes: set[tuple[str, str]] = field(default_factory=set)
    feet: list[tuple[str, StripFoot]] = field(default_factory=list)


def is_strip(member: Member) -> bool:
    """Return True if a member can be built as a strip: no sharp turn within the surface except at its ends."""
    if member.axis is None or member.kind not in STRIP_KINDS:
        return False
    begin, end = uncurled_span(member)
    s = member.axis.s
    return not turns_within_its_width(member)[(s >= begin) & (s <= end)].any()


def strip_parts(
    graph: MemberGraph,
    layering: Layering,
    room: list[tuple[float, float]],
    splice: str,
    ground: BasePlane | None = None,
) -> StripParts:
    """Return the parts of all members that are strips.
    room   : lengths and widths that parts may have on the stock, metres.
    splice : "cover" plates, a "scarf", or "none".    ground : base plate for feet with tabs, or None."""
    parts = StripParts()
    members = [member for member in graph.members if is_strip(member)]
    overhang, cover_length = END_DISTANCE * layering.bolt, 2 * layering.half_cover_length
    courses = {member.id: member_course(graph, member, overhang, cover_length) for member in members}
    courses |= _shortened_courses(graph, members, courses, layering, parts)
    for member in members:
        if member.id in parts.vanished:
            continue
        course = courses[member.id]
        bolts = node_bolts(graph, member, course)
        for number in layering.family_layers(member.family):
            grounded, feet = ground.cut_course(course, layering.layer_height(number)) if ground else (course, ())
            _StripLayer(graph, member, grounded, number, layering, splice, feet).add_parts(parts, bolts, room)
    return parts


def _shortened_courses(
    graph: MemberGraph, members: list[Member], courses: dict[str, StripCourse], layering: Layering, parts: StripParts
) -> dict[str, StripCourse]:
    joined = {frozenset(node.members) for node in graph.nodes if node.kind != "grazing"}
    shortened = courses_without_curls(courses, members)
    for family in dict.fromkeys(member.family for member in members):
        family_courses = {member.id: courses[member.id] for member in members if member.family == family}
        nodes = {name: [b.s for b in node_bolts(graph, graph.by_id[name], c)] for name, c in family_courses.items()}
        shortened |= shortened_courses(family_courses, nodes, joined, END_DISTANCE * layering.bolt)
    gone = vanished_courses(shortened, {member.id: member.mean_width for member in members})
    for name, course in shortened.items():
        bolts = node_bolts(graph, graph.by_id[name], course)
        parts.missed_nodes |= {(b.name, name) for b in bolts if name in gone or not course.begin <= b.s <= course.end}
    parts.shortened += sorted(set(shortened) - gone)
    parts.vanished += sorted(gone)
    return shortened


def node_bolts(graph: MemberGraph, member: Member, course: StripCourse) -> list[StripBolt]:
    """Return the bolts at the nodes of a member, sorted by arc length."""
    bolts = []
    for node in graph.nodes_along[member.id]:
        s = course.wrapped_station(node.at[node.members.index(member.id)])
        bolts.append(StripBolt(node.id, node.point, node.normal, s))
    return sorted(bolts, key=lambda bolt: bolt.s)


@dataclass(frozen=True)
class _StripLayer:
    graph: MemberGraph
    member: Member
    course: StripCourse
    number: int
    layering: Layering
    splice: str
    feet: tuple[StripFoot, ...] = ()

    @property
    def name(self) -> str:
        """Name of the strip: "A07", or "A07-2" for layer 2 (from 0) of a member."""
        several = len(self.layering.family_layers(self.member.family)) > 1
        return f"{self.member.id}-{self.number}" if several else self.member.id

    @property
    def lap(self) -> float:
        return SCARF_SLOPE * self.layering.thickness if self.splice == "scarf" else 0.0

    def lapped_span(self, span: tuple[float, float]) -> tuple[float, float]:
        return lapped_span(span, (self.course.begin, self.course.end), self.lap / 2, self.course.closed)

    def _fits(self, layer: Development, room: list[tuple[float, float]]) -> Callable[[float, float], bool]:
        fits = strip_fits(layer, room)
        return lambda begin, end: fits(*self.lapped_span((begin, end)))

    def add_parts(self, parts: StripParts, bolts: list[StripBolt], room: list[tuple[float, float]]) -> None:
        course, layering = self.course, self.layering
        layer = Development(course, layering.layer_height(self.number))
        clear = (self.lap / 2 if self.lap else layering.half_cover_length) + self.member.mean_width / 2
        stations = course.repeated_stations(np.array([bolt.s for bolt in bolts]))
        cuts = splice_cuts((course.begin, course.end), stations, clear, self._fits(layer, room), self.name)
        joints = list(cuts.stations[:-1] if course.closed else cuts.stations[1:-1])
        parts.splices_near_nodes += cuts.near_nodes
        parts.splice_count += len(joints)
        spliced = [list(self._splice_bolts(joint, k)) for k, joint in enumerate(joints, 1)]
        spliced = spliced if self.splice == "cover" else []
        every = [bolt for joint_bolts in spliced for bolt in joint_bolts]
        if course.closed:
            every += [StripBolt(b.name, b.point, b.normal, b.s + course.end - course.begin) for b in every]
        pieces = self._pieces(layer, cuts, bolts + every, parts.missing_holes)
        parts.pieces += pieces
        parts.feet += [(pieces[-1 if foot.at_end else 0].id, foot) for foot in self.feet]
        cover = Development(course, layering.cover_height(self.member.family, self.number))
        for k, (joint, joint_bolts) in enumerate(zip(joints, spliced, strict=False), 1):
            span = joint - layering.half_cover_length, joint + layering.half_cover_length
            parts.covers.append(self._part(cover, f"{self.name}.c{k}", span, joint_bolts, parts.missing_holes))

    def _splice_bolts(self, joint: float, number: int) -> Iterator[StripBolt]:
        course, height = self.course, self.layering.cover_height(self.member.family, self.number)
        kg, kn = (float(np.interp(joint, course.s, values)) for values in (course.kg, course.kn))
        for x, y in self.layering.splice_bolts(float(course.width(np.array([joint]))[0])):
            if self.layering.alike:  # rows of bolts are straight on the flat cover plate
                x, y = x / (1 - height * kn), y - kg * x**2 / 2
            P, T, N = (row[0] for row in course.frame_at(np.array([joint + x])))
            yield StripBolt(f"{self.name}.c{number}", P + y * np.cross(N, T), N, joint + x)

    def _pieces(self, layer: Development, cuts: Cuts, bolts: list[StripBolt], missing: list[str]) -> list[FlatPart]:
        spans = list(zip(cuts.stations, cuts.stations[1:], strict=False))
        names = [self.name] if len(spans) == 1 else [f"{self.name}.{k}" for k in range(1, len(spans) + 1)]
        pieces = []
        for name, (begin, end) in zip(names, spans, strict=True):
            inside = [bolt for bolt in bolts if begin <= bolt.s < end or (end == spans[-1][1] and bolt.s == end)]
            pieces.append(self._part(layer, name, (begin, end), inside, missing))
        return pieces

    def _part(
        self, layer: Development, name: str, span: tuple[float, float], bolts: list[StripBolt], missing: list[str]
    ) -> FlatPart:
        course, margin = self.course, HOLE_EDGE_DISTANCE * self.layering.bolt
        holes, stations = list[Hole](), list[float]()
        full_span = self.lapped_span(span)
        for bolt in bolts:
            s, y = layer.piercing_point(bolt.point, bolt.normal, bolt.s)
            left_width, right_width = (float(np.interp(s, course.s, side)) for side in (course.left, course.right))
            if span[0] + margin <= s <= span[1] - margin and margin - right_width <= y <= left_width - margin:
                holes.append(Hole(layer.to_plane(np.array([s]), np.array([y]))[0], self.layering.bolt, bolt.name))
                stations.append(s)
            else:
                missing.append(f"{bolt.name} in {name}")
        axis = layer.middle_line_at(layer.stations(*full_span))[0]
        marks = self._marks(layer, name, span, list(zip(stations, holes, strict=True)))
        marks += lap_marks(layer, span, full_span, self.lap / 2, self.layering.letters[1])
        strain = bending_strain(course, span, self.layering.thickness)
        outline = outline_with_feet(layer, full_span, self.feet)
        part = FlatPart(name, self.member.id, full_span, outline, tuple(holes), (), marks, layer.height, strain, axis)
        return part.along_x()

    def _marks(
        self, layer: Development, name: str, span: tuple[float, float], holes: list[tuple[float, Hole]]
    ) -> tuple[Floats, ...]:
        width, bolt = float(self.course.width(np.array([sum(span) / 2]))[0]), self.layering.bolt
        stops = np.array([span[0], *sorted({s for s, _ in holes}), span[1]])
        longest = int(np.diff(stops).argmax())
        middle = (stops[longest] + stops[longest + 1]) / 2
        position, angle = layer.middle_line_at(np.array([middle]))
        high, height = (letter_height(width, limit) for limit in self.layering.letters)
        room = float(np.diff(stops).max()) if self.layering.skips_crowded_names else span[1] - span[0]
        high *= min(1.0, room / text_length(name, high) * NAME_SHARE)
        marks = list(label(name, position[0], float(angle[0]), high))
        taken = [(middle, text_length(name, high))]
        for s, hole in holes:
            if "." not in hole.bolt:  # a name with "." belongs to a splice bolt, and is not engraved
                ahead = 1 if s + 4 * bolt < span[1] else -1
                long = text_length(hole.bolt, height)
                places = [s + side * (bolt / 2 + 3.5 * height) for side in (ahead, -ahead)]
                clear = [place for place in places if _is_clear(place, long, taken, stops, bolt)]
                if clear or not self.layering.skips_crowded_names:
                    place = clear[0] if self.layering.skips_crowded_names else places[0]
                    position, angle = layer.middle_line_at(np.array([place]))
                    marks += label(hole.bolt, position[0], float(angle[0]), height)
                    taken.append((place, long))
        return tuple(marks)


def letter_height(width: float, limit: float) -> float:
    """Return the height of letters (m), at most `limit`, on a part `width` (m) wide."""
    return min(limit, max(0.3 * width, min(LEGIBLE_HEIGHT, TALL_LETTER_SHARE * width)))


def _is_clear(place: float, text_size: float, taken: list[tuple[float, float]], stops: Floats, bolt: float) -> bool:
    apart = all(abs(place - other_place) > (text_size + other_size) / 2 + bolt for other_place, other_size in taken)
    return apart and stops[0] < place < stops[-1] and bool((np.abs(stops - place) > text_size / 2 + bolt / 2).all())


def bending_strain(course: StripCourse, span: tuple[float, float], thickness: float) -> float:
    """Return the largest bending strain of a layer between the arc lengths of `span`."""
    inside = (course.s >= span[0]) & (course.s <= span[1])
    bend = np.abs(course.kn[inside]).max() if inside.any() else np.abs(np.interp(sum(span) / 2, course.s, course.kn))
    return float(thickness * bend / 2)


UNCERTAIN_WIDTHS = 1.5  # curvature is uncertain up to this distance from a member's end, in member widths
HOLE_FIT = 5e-4
"""Largest error (m) of a length between holes. A hole may be a millimetre larger than its bolt [EN 1995-1-1, 10.4.3].
Each of the two parts at a bolt may use half of this millimetre."""
LEAST_STRAIN = 5e-6  # smallest strain that messages mention


@dataclass(frozen=True)
class StripLimits:
    """Largest strains of all strips of a design, and limits, for a thickness of the layers (m).
    bending : largest bending strain, in the strip `member`.
    shape   : largest strain from the Gauss curvature of the surface.
    limit   : strain at the material's strength; 0 if the preset has none.
    edge, wanted_edge : mean edge of the mesh, and edge for exact distances between holes, metres."""

    thickness: float
    bending: float
    member: str
    shape: float
    limit: float
    edge: float
    wanted_edge: float

    @property
    def thickest(self) -> float:
        """Thickest layer that can be bent (m); may be infinite."""
        return self.thickness * self.limit / self.bending if self.limit and self.bending else np.inf

    @property
    def lines(self) -> tuple[str, ...]:
        """Sentences about the strips and the limits."""
        lines = []
        layers = f"layers of {length(self.thickness)}"
        bending_text = f"{layers} are bent to a strain of up to {self.bending:.2%} (largest in {self.member})"
        if not self.limit:
            lines.append(f"{bending_text}; name a material or set statics.strength for a limit")
        elif self.bending > self.limit:
            lines.append(
                f"NOT POSSIBLE: {bending_text}, {self.bending / self.limit:.1f} times the allowed strain of "
                f"{self.limit:.2%}; the thickest layer that can be bent is {length(self.thickest)} thick: set "
                f"workshop.thickness to {np.floor(1e4 * self.thickest) / 1e4:g} or less"
            )
        else:
            lines.append(
                f"{bending_text}; the allowed strain is {self.limit:.2%}; layers up to {length(self.thickest)} thick "
                f"can be bent"
            )
        if self.shape >= LEAST_STRAIN:
            lines.append(f"the double curvature of the surface stretches strips by up to {self.shape:.3%}")
        if self.edge > self.wanted_edge * 1.05:
            lines.append(
                f"NOT TO DRILL FROM: the mesh with edges of {length(self.edge)} is too coarse, so holes may be "
                f"{length(HOLE_FIT * (self.edge / self.wanted_edge) ** 2)} from their right places; set surface.edge "
                f"to {self.wanted_edge:.2g} or less"
            )
        return tuple(lines)


def drilling_edge(graph: MemberGraph) -> float:
    """Return the longest mesh edge (m) for which distances between holes are exact to `HOLE_FIT`; may be infinite."""
    strips = [member for member in graph.members if is_strip(member)]
    bends = [np.abs(member.axis.kn[calm_stations(member)]) for member in strips if member.axis is not None]
    bend = float(np.quantile(np.concatenate(bends), 0.95)) if bends else 0.0  # ignores rare peaks
    bays = np.concatenate([graph.bays(member.id) for member in strips]) if strips else np.empty(0)
    return float(np.sqrt(8 * HOLE_FIT / np.median(bays)) / bend) if bend > 0 and len(bays) else np.inf


def strip_limits(graph: MemberGraph, surface: Surface, thickness: float, limit: float, edge: float) -> StripLimits:
    """Return the largest strains of all strips of a graph, and the limits.
    surface : surface before the pattern was cut.    limit : strain at the material's strength; 0 if unknown.
    thickness, edge : thickness of the layers, and mean edge length of the mesh, metres."""
    strips = [member for member in graph.members if is_strip(member)]
    tree, K = cKDTree(surface.centroids), face_curvatures(surface)
    bends, shapes = [0.0], [0.0]
    for member in strips:
        calm = calm_stations(member)
        bends.append(float(np.abs(member.curve.kn[calm]).max(initial=0.0)))
        nearest = np.asarray(tree.query(member.curve.P[calm])[1])
        shapes.append(float(np.median(np.abs(K[nearest]))) * member.mean_width**2 / 12 if len(nearest) else 0.0)
    worst = int(np.argmax(np.array(bends) >= 0.999 * max(bends)))  # the first of several equal bends
    name = strips[worst - 1].id if worst else "none"
    return StripLimits(thickness, thickness * max(bends) / 2, name, max(shapes), limit, edge, drilling_edge(graph))


def calm_stations(member: Member) -> Ints:
    """Return the stations (q,) of a member's axis where the curvature is reliable."""
    axis = member.curve
    past = 0.0 if axis.closed else min(UNCERTAIN_WIDTHS * member.mean_width, axis.length / 3)
    return np.flatnonzero((axis.s >= past) & (axis.s <= axis.length - past))


def face_curvatures(surface: Surface) -> Floats:
    """Return the Gauss curvature (m,) of each face, 1/m2 [Rusinkiewicz 2004]."""
    N, P = spherical_normals(surface)[surface.F], surface.V[surface.F]
    n = area_vectors(surface.V, surface.F)
    n = n / np.linalg.norm(n, axis=1)[:, None]
    edges, turns = P[:, 1:] - P[:, :1], N[:, 1:] - N[:, :1]
    x = edges[:, 0] / np.linalg.norm(edges[:, 0], axis=1)[:, None]
    frame = np.stack([x, np.cross(n, x)], axis=1)
    E, D = np.einsum("mei,mai->mae", edges, frame), np.einsum("mei,mai->mae", turns, frame)
    return np.asarray(np.linalg.det(D) / np.linalg.det(E))
