"""Text of a STEP file with step = 'members', made from regions of the sheet."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from weakref import WeakSet

import numpy as np

from dsfab.core.arrays import Floats, Ints
from dsfab.core.errors import ExportError
from dsfab.core.sparse import one_blas_thread
from dsfab.core.units import MM_PER_M
from dsfab.export.cad.step.by_members.borders import (
    TOUCHING_SHARE,
    crossing_chains,
    straight_net,
    with_steep_ends,
    without_crossings,
)
from dsfab.export.cad.step.by_members.curves import SampledChain, fewest_poles, sampled_chains
from dsfab.export.cad.step.by_members.fillet_edges import LongSeam, with_long_seams, with_ordered_walls
from dsfab.export.cad.step.by_members.fillets import without_fillets, without_short_walls
from dsfab.export.cad.step.by_members.lines import NetLines
from dsfab.export.cad.step.by_members.model import NetModel, NetPatch, net_model
from dsfab.export.cad.step.by_members.patch_sides import REACH_SHARE, LineFits, Quad, quad_of
from dsfab.export.cad.step.by_members.patches import FaceLimits, PatchBuilder
from dsfab.export.cad.step.by_members.region_division import level, with_cut_ends
from dsfab.export.cad.step.by_members.regions import (
    VOID,
    ChainLoop,
    ChainNet,
    RegionInterior,
    joined_outlines,
    net_of,
    without_lenses,
)
from dsfab.export.cad.step.by_members.sharp_corners import flush_at_corners
from dsfab.export.cad.step.by_members.trimmed import SPLIT, TrimmedFace, trimmed_face
from dsfab.export.cad.step.by_members.trimmed_corrections import with_sampled_peaks, without_strays
from dsfab.export.cad.step.by_members.trimmed_division import divided_faces
from dsfab.export.cad.step.entities import StepEntities, bezier_knots, references
from dsfab.export.cad.step.shared.lifting import Lifting
from dsfab.export.cad.step.shared.plan import SolidPlan
from dsfab.export.cad.step.shared.skins import OUTLINE_SHARE, decimals
from dsfab.export.part import Part, StripedSheet
from dsfab.surface import edge_table, link_components

EDGE_DIGITS = 7
"""Decimal places of edge coordinates (mm). OCCT accepts gaps below 1e-7 mm between an edge and its patch."""


class NetWriter:
    """Writer of a boundary model: adds the STEP entities to the list `new`."""

    def __init__(self, entity_list: StepEntities, model: NetModel, thickness: float) -> None:
        self.new, self.model = entity_list, model
        self._points = partial(entity_list.points, digits=EDGE_DIGITS)
        self.digits = decimals(thickness)
        self.vertices = [
            [entity_list.vertex(p, model.seam) for p in self._points(pair.reshape(2, 3))] for pair in model.vertices
        ]
        self.edges = list[list[int]]()

    def faces(self, trimmed: list[TrimmedFace], seams: Mapping[int, LongSeam]) -> list[int]:
        """Add the patches of the model and the `trimmed` faces; return the numbers of the STEP faces."""
        numbers, posts = list[int](), dict[tuple[int, int], int]()
        skins: list[NetPatch | TrimmedFace] = [*self.model.patches, *trimmed]
        surfaces = {i: self._surfaces(skins[i]) for i in sorted({i for seam in seams.values() for i in seam.on})}
        self._add_edges(seams, surfaces)
        for i, skin in enumerate(skins):
            loops = skin.loops if isinstance(skin, TrimmedFace) else [skin.loop]
            surface_pair = surfaces[i] if i in surfaces else self._surfaces(skin)
            numbers += [self._skin(loops, surface_pair[s], s) for s in (0, 1)]
        for wall in self.model.walls:
            (first_edge, forwards), (last_edge, ahead) = wall.steps[0], wall.steps[-1]
            start, end = self.model.edges[first_edge], self.model.edges[last_edge]
            start_post, end_post = (
                self._post(posts, v) for v in (start.start if forwards else start.end, end.end if ahead else end.start)
            )
            poles = fewest_poles(wall.poles, 0)
            outer, inner = (list(self._points(poles[:, s : s + 3])) for s in (0, 3))
            surface = self._surface([list(row) for row in zip(inner, outer, strict=True)])
            below = [(self.edges[e][1], forwards) for e, forwards in wall.steps]
            above = [(self.edges[e][0], not forwards) for e, forwards in wall.steps[::-1]]
            wire = self.new.wire([*below, end_post, *above, (start_post[0], not start_post[1])], "FACE_BOUND")
            numbers.append(self.new.face([wire], surface))
        return numbers

    def _surfaces(self, skin: NetPatch | TrimmedFace) -> list[int]:
        if isinstance(skin, TrimmedFace):
            digits = EDGE_DIGITS + 1 if skin.exact else EDGE_DIGITS - 1
            return [self._surface(self._grid(poles, digits)) for poles in (skin.outer, skin.inner)]
        pole_pair = np.split(fewest_poles(fewest_poles(skin.poles, 0), 1), 2, axis=2)
        return [
            self._surface(self._grid(poles, EDGE_DIGITS + 1) if skin.within else self._rows(poles))
            for poles in pole_pair
        ]

    def _add_edges(self, seams: Mapping[int, LongSeam], surfaces: Mapping[int, list[int]]) -> None:
        pole_list = [seams[e].poles if e in seams else edge.poles for e, edge in enumerate(self.model.edges)]
        self.poles = self._pole_numbers([fewest_poles(poles, 0) for poles in pole_list])
        for e, (edge, two) in enumerate(zip(self.model.edges, self.poles, strict=True)):
            places = seams[e].on if e in seams else {}
            curves = [self.new.bezier(poles, self.model.seam) for poles in two]
            for s in (0, 1) if places else ():
                lines = references([self._on_surface(uv[s], surfaces[i][s]) for i, uv in places.items()])
                curves[s] = self.new.add(f"SURFACE_CURVE('',#{curves[s]},{lines},.PCURVE_S1.)")
            edge_ends = zip(self.vertices[edge.start], self.vertices[edge.end], curves, strict=True)
            self.edges.append([self.new.edge(*ends, self.model.seam) for ends in edge_ends])

    def _on_surface(self, uv: Floats, surface: int) -> int:
        digits = 12  # decimals of parameters on surfaces, which run from 0 to 1
        return self.new.parameter_curve(surface, self.new.bezier(list(self.new.points(uv, digits))))

    def _skin(self, loops: list[ChainLoop], surface: int, s: int) -> int:
        wires = []
        for i, loop in enumerate(loops):
            steps = [(self.edges[e][s], ahead != bool(s)) for e, ahead in (loop[::-1] if s else loop)]
            wires.append(self.new.wire(steps, "FACE_OUTER_BOUND" if len(loops) > 1 and not i else "FACE_BOUND"))
        return self.new.face(wires, surface, same_sense=not s)

    def _rows(self, poles: Floats) -> list[list[int]]:
        poles = poles.copy()
        poles[1:-1, 1:-1] = np.round(poles[1:-1, 1:-1], self.digits)
        return self._grid(poles, EDGE_DIGITS)

    def _pole_numbers(self, lines: list[Floats]) -> list[list[list[int]]]:
        numbers = self._points(np.concatenate([line[:, s : s + 3] for line in lines for s in (0, 3)]))
        return [[list(islice(numbers, len(line))) for _ in range(2)] for line in lines]

    def _grid(self, poles: Floats, digits: int) -> list[list[int]]:
        numbers = list(self.new.points(poles.reshape(-1, 3), digits))
        return [numbers[i : i + poles.shape[1]] for i in range(0, len(numbers), poles.shape[1])]

    def _post(self, posts: dict[tuple[int, int], int], vertex: int) -> tuple[int, bool]:
        outer, inner = self.vertices[vertex]
        if (outer, inner) in posts:
            return posts[outer, inner], False  # the edge was added beyond the seam, where the skins are swapped
        if (inner, outer) not in posts:
            ends = [next(self._points(self.model.vertices[vertex][None, i : i + 3])) for i in (3, 0)]
            posts[inner, outer] = self.new.edge(inner, outer, self.new.bezier(ends))
        return posts[inner, outer], True

    def _surface(self, rows: list[list[int]]) -> int:
        j, k = len(rows), len(rows[0])
        return self.new.spline_surface((j - 1, k - 1), rows, bezier_knots(j), bezier_knots(k))


GAP_SHARE = 1 / 4000  # wanted gap between a trimmed face and its edges, as a fraction of the thickness
PASSES = 3  # number of attempts to remove crossings of outlines; a change may cause new crossings
UNASKED = 7000  # largest number of faces if the user does not ask for step = 'members'; more take over half a minute


class ManyFacesError(ExportError):
    """Error for a file with so many faces that dsfab writes it only on request."""


@dataclass(frozen=True, eq=False)
class MemberDraft:
    """STEP text before its checks, with the numbers of solids, faces and trimmed faces.
    gap : widest gap between a trimmed face and its edges, mm."""

    text: str
    solids: int
    faces: int
    trimmed: int
    gap: float


def member_draft(part: Part, plan: SolidPlan, fine: bool = False) -> MemberDraft:
    """Return the STEP file of a part before its checks. fine : True for a more exact file, which takes longer.
    Raises ExportError if a step fails, or if the file has too many faces."""
    with one_blas_thread():  # several threads would slow down thousands of small systems
        return _draft(part, plan, fine)


def _draft(part: Part, plan: SolidPlan, fine: bool) -> MemberDraft:
    least_walls = 3 / 4  # for an early estimate of the number of faces: at least 3/4 of the outline chains become walls
    if plan.curved.striped is None:
        raise ExportError("step = 'members' needs the stripes of the sheet, but this sheet has no data of its stripes")
    lifting = Lifting.from_sheet(plan.surface, plan.curved)
    entity_list, pieces, trimmed = StepEntities(), list[list[int]](), list[TrimmedFace]()
    for sheet in _sheets(plan.curved.striped()):
        net = _net(sheet, lifting, plan)
        walls = sum(chain.right == VOID for chain in net.chains.values())
        require_few_faces(part, 2 * len(net.loops) + int(least_walls * walls))
        model, surfaces = _solid(part, net, RegionInterior(sheet, lifting, plan.limits.thickness, fine), plan)
        model, surfaces, seams = with_long_seams(model, surfaces)
        pieces.append(NetWriter(entity_list, model, plan.limits.thickness).faces(surfaces, seams))
        trimmed += surfaces
    require_few_faces(part, faces := sum(map(len, pieces)))
    text = "".join(entity_list.file(pieces, part.name, "curved solid of four-sided patches along members"))
    return MemberDraft(text, len(pieces), faces, 2 * len(trimmed), max((face.gap for face in trimmed), default=0.0))


_TOO_MANY = WeakSet[Part]()


def has_too_many(part: Part) -> bool:
    """Return True if a trial showed that the STEP file of `part` by members has too many faces."""
    return part in _TOO_MANY


def require_few_faces(part: Part, faces: int) -> None:
    """Raise ManyFacesError if `faces`, the number of faces of a part's file, exceeds the limit."""
    limit = part.hurry * UNASKED
    if part.hurry and faces > limit:
        _TOO_MANY.add(part)
        raise ManyFacesError(
            f"the curved solid along members would have at least {faces} faces; dsfab writes more than {limit} faces "
            f"only on request"
        )


def _sheets(striped: StripedSheet) -> Iterator[StripedSheet]:
    faces_left, faces_right = np.concatenate([edge_table(striped.F).pairs, striped.seam]).T // 3
    count, piece = link_components(len(striped.F), faces_left, faces_right)
    cell, corner = striped.seam // 3, striped.seam % 3
    for i in range(count):
        in_piece = piece == i
        seam = 3 * (np.cumsum(in_piece) - 1)[cell] + corner
        seam = seam[in_piece[cell[:, 0]]]
        yield StripedSheet(striped.F[in_piece], striped.weights, striped.label[in_piece], striped.loose[in_piece], seam)


def _net(sheet: StripedSheet, lifting: Lifting, plan: SolidPlan) -> ChainNet:
    lens_share = 1 / 3  # a region between two chains of edges must be wider than this fraction of the thickness
    wall_share = 1 / 20  # smallest length of a wall between two borders / thickness
    t, skins = plan.limits.thickness, lifting.skins
    creased = lifting.sides.lines_on_creases if len(lifting.sides.creases) else None
    net = net_of(sheet, plan.surface.V, skins.normals, t / MM_PER_M, creased)
    net = without_fillets(net, lifting)
    P, N = (np.asarray(net.weights @ x) for x in (skins.points, skins.normals))
    net = joined_outlines(without_lenses(net, P, lens_share * t), P, N)
    net = with_steep_ends(without_short_walls(net, lifting, wall_share * t), lifting, t)
    return straight_net(level(net, sheet, lifting, plan.limits), lifting, t)


def _solid(part: Part, net: ChainNet, interior: RegionInterior, plan: SolidPlan) -> tuple[NetModel, list[TrimmedFace]]:
    least_share = 0.95  # at least this fraction of the faces must remain after regions are joined
    fits = _Fits(interior, plan)
    lines, model = fits.model(net)
    require_few_faces(part, int(least_share * model.faces))
    previous = dict[int, bytes]()
    for _ in range(PASSES):
        outlines = outline_poles(net, lines, model)
        changed = changed_regions(previous, outlines)
        sound = without_crossings(net, lines.curves(changed), changed, TOUCHING_SHARE * plan.limits.thickness)
        if sound is net:
            break
        net, previous = sound, outlines
        lines, model = fits.model(net)
    net, model = _with_cut_ends(net, lines, model, fits, plan)
    faces = _trimmed_faces(net, model, interior, fits)
    far = OUTLINE_SHARE * plan.limits.distance
    accurate = {region for region, face in faces.items() if face.gap <= SPLIT and face.off <= far}
    bad = set(model.compact) - accurate
    if bad:
        fits.patched |= bad
        _, model = fits.model(net)
        faces = _trimmed_faces(net, model, interior, fits)
    inside = partial(interior.points, net)
    flush = flush_at_corners(model, divided_faces(model, faces, inside, fits.lifting.vectors_to_skins, fits.wanted))
    model, surfaces = with_ordered_walls(*flush)
    return model, with_sampled_peaks(model, surfaces)


def _trimmed_faces(net: ChainNet, model: NetModel, interior: RegionInterior, fits: "_Fits") -> dict[int, TrimmedFace]:
    faces, parts = dict[int, TrimmedFace](), {*net.parent, *net.parent.values()}
    outlines = {region: model.outline(loops) for region, loops in model.trimmed.items()}
    for region, loops in model.trimmed.items():
        if len(loops) == 1 and (cached := fits.faces.get((region, outlines[region]))):
            faces[region] = replace(cached, loops=loops)
    points = interior.points(net, [region for region in model.trimmed if region not in faces])
    fitted = dict[int, TrimmedFace]()
    for region, inside in points.items():
        try:
            fitted[region] = trimmed_face(model, model.trimmed[region], inside, fits.wanted, region in parts)
        except ExportError:
            if region not in model.compact:
                raise
    fitted = without_strays(model, fitted, points, fits.lifting.vectors_to_skins, fits.wanted)
    fits.faces |= {(region, outlines[region]): face for region, face in fitted.items()}
    return faces | fitted


def _with_cut_ends(
    net: ChainNet, lines: NetLines, model: NetModel, fits: "_Fits", plan: SolidPlan
) -> tuple[ChainNet, NetModel]:
    regions, previous = set(model.trimmed), outline_poles(net, lines, model)
    for _ in range(PASSES):
        divided_net = with_cut_ends(net, sorted(regions), fits.lifting, GAP_SHARE * plan.limits.thickness)
        if divided_net is net:
            break
        lines, divided_model = fits.model(divided_net)
        changed = changed_regions(previous, outline_poles(divided_net, lines, divided_model))
        curves = lines.curves(changed)
        crossed = [region for region in changed if crossing_chains(divided_net, curves, region)]
        wrong = {divided_net.parent.get(region, region) for region in crossed} & regions
        if not wrong:
            return divided_net, divided_model
        regions -= wrong
    return net, model


def outline_poles(net: ChainNet, lines: NetLines, model: NetModel) -> dict[int, bytes]:
    """Return the Bezier poles of the outlines of each trimmed region, as bytes for comparison, by region."""
    curves = lines.curves(model.trimmed)
    return {
        region: b"".join(curves[k].spans.tobytes() for loop in net.loops[region] for k, _ in loop)
        for region in model.trimmed
    }


def changed_regions(previous: dict[int, bytes], outlines: dict[int, bytes]) -> list[int]:
    """Return the regions with a new or changed outline. previous, outlines : results of `outline_poles`."""
    return [region for region, outline in outlines.items() if previous.get(region) != outline]


class _Fits:
    def __init__(self, interior: RegionInterior, plan: SolidPlan) -> None:
        self.lifting, self.limits, self.reach = interior.lifting, plan.limits, REACH_SHARE * plan.limits.thickness
        skins = np.stack([plan.limits.V.min(axis=0), plan.limits.V.max(axis=0)])
        box = _wide_box(skins)
        self.fits = LineFits(plan.limits.distance, box, skins, self.lifting.vectors_to_skins, interior.fine)
        beyond_mesh = plan.gate.excess_distances if interior.fine else None
        self.wanted = FaceLimits(wanted_gap(plan.limits.thickness), plan.limits.distance, box, beyond_mesh)
        self.covering = PatchBuilder(self.lifting.vectors_to_skins, self.wanted)
        self.points, self.chains = dict[int, Ints](), dict[int, SampledChain]()
        self.faces, self.patched = dict[tuple[int, bytes], TrimmedFace](), set[int]()
        self.region_quads = RegionQuads(self.reach)

    def model(self, net: ChainNet) -> tuple[NetLines, NetModel]:
        changed = {k: chain for k, chain in net.chains.items() if self.points.get(k) is not chain.points}
        if changed:
            self.chains |= sampled_chains(replace(net, chains=changed), self.lifting, self.limits)
            self.points |= {k: chain.points for k, chain in changed.items()}
        chains = {k: self.chains[k] for k in net.chains}
        quads, other_regions = self.region_quads.quads(net, chains)
        lines = self.fits.lines(net, chains, quads, self.reach)
        return lines, net_model(lines, chains, quads, other_regions, self.covering, self.patched)


class RegionQuads:
    """Search for four-sided regions. reach : length (mm) over which the directions of sides are measured."""

    def __init__(self, reach: float) -> None:
        self.reach, self.known = reach, dict[int, tuple[list[ChainLoop], list[SampledChain], Quad | None]]()

    def quads(self, net: ChainNet, chains: dict[int, SampledChain]) -> tuple[list[Quad], list[int]]:
        """Return the four-sided regions of a net, and the numbers of all further regions."""
        for region, loops in net.loops.items():
            around = [chains[k] for loop in loops for k, _ in loop]
            cached = self.known.get(region)
            if cached is None or cached[0] != loops or any(a is not b for a, b in zip(cached[1], around, strict=True)):
                self.known[region] = loops, around, quad_of(region, loops, chains, self.reach)
        quads = {region: self.known[region][2] for region in net.loops}
        return [quad for quad in quads.values() if quad], [region for region, quad in quads.items() if not quad]


def wanted_gap(thickness: float) -> float:
    """Return the largest gap (mm) to aim for between trimmed faces and their edges. thickness : of the sheet, mm."""
    narrow_mm, thin_share = 0.01, 1 / 1500  # a gap is narrow enough if it is below both limits
    return max(GAP_SHARE * thickness, min(narrow_mm, thin_share * thickness))


def _wide_box(skins: Floats) -> Floats:
    # OCCT's bounding box contains all poles, so poles must not lie far outside the skins.
    share = 1 / 300  # poles may lie outside the box of the skins by this fraction of the box's diagonal
    return np.asarray(skins + share * float(np.linalg.norm(skins[1] - skins[0])) * np.array([[-1.0], [1.0]]))
