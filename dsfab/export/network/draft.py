"""The text of a part by members, which nobody has checked."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from weakref import WeakSet

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.errors import ExportError
from dsfab.export.network.bends import level
from dsfab.export.network.beyond import with_long_seams
from dsfab.export.network.covering import Covering
from dsfab.export.network.crossings import TOUCHING, crossing_chains, without_crossings
from dsfab.export.network.curves import SampledChain, sampled_chains
from dsfab.export.network.dividing import divided
from dsfab.export.network.ends import without_short_walls
from dsfab.export.network.fillets import without_fillets
from dsfab.export.network.flush import flush_at_corners
from dsfab.export.network.graph import VOID, ChainNet, Loop, net_of
from dsfab.export.network.interior import Interior
from dsfab.export.network.joining import joined_outlines, without_lenses
from dsfab.export.network.lifting import Lifting
from dsfab.export.network.line_fits import LineFits
from dsfab.export.network.lines import NetLines
from dsfab.export.network.model import NetModel, net_model
from dsfab.export.network.ordering import in_order
from dsfab.export.network.parting import parted
from dsfab.export.network.quads import REACH, Quad, quads_of
from dsfab.export.network.sampling import with_sampled_peaks
from dsfab.export.network.seams import with_steep_ends
from dsfab.export.network.straightening import straightened
from dsfab.export.network.straying import FaceLimits
from dsfab.export.network.strays import without_strays
from dsfab.export.network.text import NetText
from dsfab.export.network.trimmed import SPLIT, TrimmedFace, trimmed_face
from dsfab.export.part import Part
from dsfab.export.plate_text import Entities
from dsfab.export.smooth.edges import FLAT
from dsfab.export.smooth.plan import SmoothPlan
from dsfab.export.smooth.source import StripedSheet
from dsfab.export.step_pieces import closing
from dsfab.export.step_text import header
from dsfab.sparse import one_blas_thread
from dsfab.surface import connected, edge_table
from dsfab.units import MM_PER_M

KIND = "curved solid of four-sided patches by members"
"""What the file says about itself."""

NARROW = 1 / 4000
"""Gap that is wanted between a trimmed face and its edges, as a share of the thickness."""

NARROW_MM, OF_THIN = 0.01, 1 / 1500
"""Millimetres of one that is narrow enough, if that is no larger a share of the thickness: of a sheet of 16 mm most
trimmed faces had degrees of 4 to 7, to close it to .004 mm, and a third more poles."""

SHORT = 1 / 20
"""Length of a wall between two borders that is none, as a share of the thickness."""

LENS = 1 / 3
"""Width of a region between two chains that is no region, as a share of the thickness."""

PASSES = 3
"""Looks at outlines that cross themselves; what one pass joins or leaves whole may cross anew."""

UNASKED = 7000
"""Faces of a file that nobody asked for by name, where a part is in a hurry of 1: more take half a minute."""

FEWER_WALLS = 3 / 4
"""Walls for each chain of an outline, at least: a fifteenth of those of `hypar.obj` and of a cylinder are one with
others."""


FEWER_FACES = 0.95
"""Of a first model that are left, at least, once regions whose outlines cross themselves have joined others."""

BEYOND = 1 / 300
"""Share of a surface's size that poles of curves are beyond its box at most: along the rim of a vault of 12 m they were
170 mm above it, and OCCT's box with them."""


class ManyFacesError(ExportError):
    """A file with more faces than are made unasked; asked for by name, it is made."""


@dataclass(frozen=True, eq=False)
class MemberDraft:
    """What nobody has checked: the text, its solids, faces, trimmed ones among them, and the widest gap, mm."""

    text: str
    solids: int
    faces: int
    trimmed: int
    gap: float


def member_plan(part: Part) -> SmoothPlan:
    """What is known of a part's sheet, whatever the number of its walls."""
    return SmoothPlan(replace(part, hurry=0))


def member_draft(part: Part, plan: SmoothPlan, fine: bool = False) -> MemberDraft:
    """The file of a part before it is checked; raises ExportError where it cannot be made, and ManyFacesError
    where nobody asked for so large a one.

    fine : whether faces are asked how far they are off the mesh, borders follow the skins closely, and trimmed ones
    are near to many points of long triangles, see `interior`.
    """
    with one_blas_thread():  # thousands of small systems
        return _draft(part, plan, fine)


def _draft(part: Part, plan: SmoothPlan, fine: bool) -> MemberDraft:
    if plan.curved.striped is None:
        raise ExportError("STEP by members needs the stripes of the sheet, and these are not known")
    lifting = Lifting.of(plan.surface, plan.curved)
    new, shells, faces, trimmed = Entities(), list[int](), list[int](), list[TrimmedFace]()
    count = 0
    for sheet in _sheets(plan.curved.striped()):
        net = _net(sheet, lifting, plan)
        walls = sum(chain.right == VOID for chain in net.chains.values())
        _require_few(part, 2 * len(net.loops) + int(FEWER_WALLS * walls))
        model, surfaces = _solid(part, net, Interior(sheet, lifting, plan.limits.thickness, fine), plan)
        model, surfaces, seams = with_long_seams(model, surfaces)
        added = NetText(new, model, plan.limits.thickness).faces(surfaces, seams)
        faces += added
        shells += [count] * len(added)
        trimmed += surfaces
        count += 1
    _require_few(part, len(faces))
    end = closing(np.array(shells), [[i] for i in range(count)], np.array(faces), new.free, part.name)
    text = "".join([header(part.name, KIND, count), *new.text, *end])
    return MemberDraft(text, count, len(faces), 2 * len(trimmed), max((one.gap for one in trimmed), default=0.0))


_MANY = WeakSet[Part]()


def has_too_many(part: Part) -> bool:
    """Whether a part was refused for its number of faces alone."""
    return part in _MANY


def _require_few(part: Part, faces: int) -> None:
    """Raise ExportError where nobody asked for so many faces, or more."""
    most = part.hurry * UNASKED
    if part.hurry and faces > most:
        _MANY.add(part)
        raise ManyFacesError(
            f"by members it would have at least {faces} faces, more than {most}, which take too long to be tried "
            "unasked"
        )


def _sheets(striped: StripedSheet) -> Iterator[StripedSheet]:
    """The connected pieces of a sheet, over its seam too."""
    one, two = np.concatenate([edge_table(striped.F).pairs, striped.seam]).T // 3
    count, piece = connected(len(striped.F), one, two)
    cell, corner = striped.seam // 3, striped.seam % 3
    for i in range(count):
        mine = piece == i
        seam = 3 * (np.cumsum(mine) - 1)[cell] + corner
        seam = seam[mine[cell[:, 0]]]
        yield StripedSheet(striped.F[mine], striped.weights, striped.label[mine], striped.loose[mine], seam)


def _net(sheet: StripedSheet, lifting: Lifting, plan: SmoothPlan) -> ChainNet:
    """The net of a piece; it has about a wall for each chain of its outline, and at least two faces for each region."""
    t, skins = plan.limits.thickness, lifting.skins
    creased = lifting.sides.along if len(lifting.sides.creases) else None
    net = net_of(sheet, plan.surface.V, skins.normals, t / MM_PER_M, creased)
    net = without_fillets(net, lifting)
    P, N = (np.asarray(net.weights @ x) for x in (skins.points, skins.normals))
    net = joined_outlines(without_lenses(net, P, LENS * t), P, N)
    net = with_steep_ends(without_short_walls(net, lifting, SHORT * t), lifting, t)
    return straightened(level(net, sheet, lifting, plan.limits), lifting, t)


def _solid(part: Part, net: ChainNet, interior: Interior, plan: SmoothPlan) -> tuple[NetModel, list[TrimmedFace]]:
    """The model of a piece, and its faces without four sides."""
    fits = _Fits(interior, plan)
    lines, model = fits.model(net)
    _require_few(part, int(FEWER_FACES * model.faces))
    known = dict[int, bytes]()
    for _ in range(PASSES):
        outlines = _outlines(net, lines, model)
        new = _changed(known, outlines)
        sound = without_crossings(net, lines.curves(new), new, TOUCHING * plan.limits.thickness)
        if sound is net:
            break
        net, known = sound, outlines
        lines, model = fits.model(net)
    net, model = _divided(net, lines, model, fits, plan)
    faces = _trimmed_faces(net, model, interior, fits)
    bad = {region for region in model.compact if not _close(faces.get(region), plan)}
    if bad:
        fits.patched |= bad
        _, model = fits.model(net)
        faces = _trimmed_faces(net, model, interior, fits)
    inside = partial(interior.points, net)
    flush = flush_at_corners(model, parted(model, faces, inside, fits.lifting.away, fits.wanted))
    model, surfaces = in_order(*flush)
    return model, with_sampled_peaks(model, surfaces)


def _trimmed_faces(net: ChainNet, model: NetModel, interior: Interior, fits: "_Fits") -> dict[int, TrimmedFace]:
    """By region; none of one that no surface is near to, but has four sides."""
    found, parts = dict[int, TrimmedFace](), {*net.parent, *net.parent.values()}
    outlines = {region: model.outline(loops) for region, loops in model.trimmed.items()}
    for region, loops in model.trimmed.items():
        if len(loops) == 1 and (known := fits.faces.get((region, outlines[region]))):
            found[region] = replace(known, loops=loops)
    points = interior.points(net, [region for region in model.trimmed if region not in found])
    new = dict[int, TrimmedFace]()
    for region, inside in points.items():
        try:
            new[region] = trimmed_face(model, model.trimmed[region], inside, fits.wanted, region in parts)
        except ExportError:
            if region not in model.compact:
                raise
    new = without_strays(model, new, points, fits.lifting.away, fits.wanted)
    fits.faces |= {(region, outlines[region]): face for region, face in new.items()}
    return found | new


def _close(face: TrimmedFace | None, plan: SmoothPlan) -> bool:
    """Whether a trimmed face can be cut wherever patches can, and is as near to the sheet."""
    near = FLAT * plan.limits.distance
    return face is not None and face.gap <= SPLIT and face.off <= near


def _divided(
    net: ChainNet, lines: NetLines, model: NetModel, fits: "_Fits", plan: SmoothPlan
) -> tuple[ChainNet, NetModel]:
    """A net and its model with members that are cut off from their ends, unless an outline then crosses itself."""
    regions, known = set(model.trimmed), _outlines(net, lines, model)
    for _ in range(PASSES):
        whole = divided(net, sorted(regions), fits.lifting, NARROW * plan.limits.thickness)
        if whole is net:
            break
        lines, found = fits.model(whole)
        new = _changed(known, _outlines(whole, lines, found))
        curves = lines.curves(new)
        crossed = [region for region in new if crossing_chains(whole, curves, region)]
        wrong = {whole.parent.get(region, region) for region in crossed} & regions
        if not wrong:
            return whole, found
        regions -= wrong
    return net, model


def _outlines(net: ChainNet, lines: NetLines, model: NetModel) -> dict[int, bytes]:
    """The poles around each trimmed region of a net. A line takes part in many outlines, and moves all of them."""
    curves = lines.curves(model.trimmed)
    return {
        region: b"".join(curves[k].spans.tobytes() for loop in net.loops[region] for k, _ in loop)
        for region in model.trimmed
    }


def _changed(known: dict[int, bytes], outlines: dict[int, bytes]) -> list[int]:
    """The regions whose outlines are not those that were known before."""
    return [region for region, outline in outlines.items() if known.get(region) != outline]


class _Fits:
    """The lines of nets, and their models; chains with the points that they had are not sampled anew, nor are trimmed
    faces with the outlines that they had (by region and poles)."""

    def __init__(self, interior: Interior, plan: SmoothPlan) -> None:
        self.lifting, self.limits, self.reach = interior.lifting, plan.limits, REACH * plan.limits.thickness
        skins = np.stack([plan.limits.V.min(axis=0), plan.limits.V.max(axis=0)])
        box = _wide_box(skins)
        self.fits = LineFits(plan.limits.distance, box, skins, self.lifting.away, interior.fine)
        beyond_mesh = plan.gate.beyond if interior.fine else None
        self.wanted = FaceLimits(_narrow(plan.limits.thickness), plan.limits.distance, box, beyond_mesh)
        self.covering = Covering(self.lifting.away, self.wanted)
        self.points, self.chains = dict[int, Ints](), dict[int, SampledChain]()
        self.faces = dict[tuple[int, bytes], TrimmedFace]()
        self.quads = dict[int, tuple[list[Loop], list[SampledChain], Quad | None]]()
        self.patched = set[int]()

    def model(self, net: ChainNet) -> tuple[NetLines, NetModel]:
        """Of a net."""
        new = {k: chain for k, chain in net.chains.items() if self.points.get(k) is not chain.points}
        if new:
            self.chains |= sampled_chains(replace(net, chains=new), self.lifting, self.limits)
            self.points |= {k: chain.points for k, chain in new.items()}
        chains = {k: self.chains[k] for k in net.chains}
        quads, others = self._quads(net, chains)
        lines = self.fits.lines(net, chains, quads, self.reach)
        return lines, net_model(lines, chains, quads, others, self.covering, self.patched)

    def _quads(self, net: ChainNet, chains: dict[int, SampledChain]) -> tuple[list[Quad], list[int]]:
        """As `quads_of`; regions with the chains that they had are as they were."""
        for region, loops in net.loops.items():
            around = [chains[k] for loop in loops for k, _ in loop]
            known = self.quads.get(region)
            if known is None or known[0] != loops or any(a is not b for a, b in zip(known[1], around, strict=True)):
                found, _ = quads_of(replace(net, loops={region: loops}), chains, self.reach)
                self.quads[region] = loops, around, found[0] if found else None
        quads = {region: self.quads[region][2] for region in net.loops}
        return [quad for quad in quads.values() if quad], [region for region, quad in quads.items() if not quad]


def _narrow(thickness: float) -> float:
    """The gap that is wanted between a trimmed face and its edges, millimetres."""
    return max(NARROW * thickness, min(NARROW_MM, OF_THIN * thickness))


def _wide_box(skins: Floats) -> Floats:
    """(2, 3) a box, and a little more."""
    return np.asarray(skins + BEYOND * float(np.linalg.norm(skins[1] - skins[0])) * np.array([[-1.0], [1.0]]))
