"""Text of a proposed preset with comments, and its lines for snow and wind."""

import json
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.messages import length
from dsfab.preset.proposal.feet import Foot, stems
from dsfab.preset.proposal.marks import TABLES, mark_tables
from dsfab.preset.proposal.reading import GivenMesh, is_nearly_closed
from dsfab.preset.proposal.sizes import MODEL, Sizes, is_figure
from dsfab.surface import Boundary, Marks, Surface, one_sided_pieces

SLIDES = 60
"""Degrees of slope from which snow slides off [EN 1991-1-3, table 5.2]."""
ENCLOSES = 16.0
"""A surface whose boundary, squared, is longer than this many times its area encloses nothing: it has no outside."""
TOP = 0.15
"""Share of a surface on which snow would lie, at least, to be worth a load."""
WIND = 500.0
"""Pa of velocity pressure: a placeholder for the local code."""


def snow_on_top(surface: Surface) -> str | None:
    """The picker of the faces that snow lies on of what is built, open and no roof: the top of a ball to go into, its
    normals outwards or inwards. None of models and of what has no top, as a wall or a tower, or no outside.
    """
    edge = float(surface.edge_lengths[surface.edges.boundary].sum())
    if surface.size < MODEL or edge**2 > ENCLOSES * surface.area or is_nearly_closed(surface) or _one_sided(surface):
        return None
    outwards = np.einsum("mi,mi,m->", surface.normals, surface.centroids - surface.V.mean(axis=0), surface.areas)
    up = 1.0 if outwards > 0 else -1.0
    lies = up * surface.normals[:, 2] > np.cos(np.radians(SLIDES))
    if float(surface.areas[lies].sum()) < TOP * surface.area:
        return None
    return f'pick = "facing", direction = [0.0, 0.0, {up}], angle = {SLIDES}'


def wind_lines(surface: Surface) -> list[str]:
    """Lines of a preset for wind on the broadest side of what is built and is no roof; none of a model."""
    if surface.size < MODEL or _one_sided(surface):
        return []
    seen: Floats = surface.areas @ np.abs(surface.normals)
    direction = [0.0, 1.0, 0.0] if seen[1] > seen[0] else [1.0, 0.0, 0.0]
    told = "# Wind, which decides for much that stands upright; take these lines with your local code's numbers:"
    load = ('kind = "wind"', f"pressure = {WIND}", f"direction = {direction}")
    return [told, "# [[surface.load]]", *(f"# {line}" for line in load)]


def _one_sided(surface: Surface) -> bool:
    """Whether some of it has no outside, as a Moebius strip: wind and a picker of faces that look up refuse it."""
    return bool(one_sided_pieces(surface.F, surface.edges).any())


SNOW = 750.0
"""Pa on the plan: a placeholder for the local code."""
SHARE = 0.45
"""Of the surface that stays material."""
SNAP = 0.01
"""A fifth of the usual one: a mesh of somebody's own has no mirrored halves, and twentieth parts of its edges show."""
STEP_FACES = 12_000
"""Planar faces of a STEP file: 15 s to write and check, 10 MB."""
THINNEST = 0.05
"""Share of its thickness that is left to a figure where it bends sharply: the least that the solid is made with."""


def proposal_text(
    given: GivenMesh,
    keys: Mapping[str, Any],
    notes: Mapping[str, str],
    size: Sizes,
    stands: tuple[Foot, ...],
    snow: bool,
    marks: Mapping[str, Marks],
) -> str:
    """The TOML text.

    keys : of [surface], which make the mesh what it is.  notes : topic -> what was decided.  marks : what is drawn
    beside it, which takes the place of feet that were found.
    """
    surface, stand = given.surface, () if "support" in marks else stands
    file = "" if "origin" in keys else str(keys.get("file"))  # a drawing in a file is about that file's origin
    drawn = mark_tables(marks, file, str(keys.get("unit")), size, size.edge or surface.mean_edge)
    tables = list(drawn)
    head = [
        f"# {given.name}: made by `dsfab new`; every value is a proposal. Units: metres, newtons, pascals.",
        _entry("name", given.name),
        _entry("description", _description(surface, size, stands, snow)),
    ]
    parts = (
        head,
        _surface(keys, notes, size),
        *_supports(surface, size, stand),
        *(table for table in tables if table[0] == TABLES["support"]),
        *_loads(surface, snow),
        *(table for table in tables if table[0] == TABLES["load"]),
        _statics(size),
        _pattern(surface, size),
        *(table for table in tables if table[0] not in TABLES.values()),
        *_families(size),
        _widths(),
        [
            "[slicing]",
            _entry("snap", SNAP, "of an edge, that cuts move by to a vertex: mirrored halves are alike on any mesh"),
            _entry("min_member", size.thickness, "m; narrower members are widened there"),
        ],
        *_thickening(surface),
        [
            "[export]",
            _entry("step", "quick", "STEP that is soon made, or none; auto tries more ways, for minutes"),
            _entry("step_faces", STEP_FACES, "a STEP of more planar faces is slow in CAD; 30000 is usual"),
        ],
    )
    return "\n\n".join("\n".join(part) for part in parts) + "\n"


def _surface(keys: Mapping[str, Any], notes: Mapping[str, str], size: Sizes) -> Iterator[str]:
    yield "[surface]"
    comments = {"unit": notes["unit"], "up": notes["up"], "mend": notes.get("mended", "")}
    comments["repair"] = comments["mend"]
    comments["origin"] = "m; files that are written are about this point of the mesh's"
    for key, value in keys.items():
        if key != "mesh":
            yield _entry(key, value, comments.get(key, ""))
    if size.edge:
        yield _entry("edge", size.edge, "m; the mesh is made anew: even triangles, boundaries and creases stay")
    if size.edge and size.coarse:
        yield _entry("smooth", True, "on the smooth surface through the mesh's vertices")


def _supports(surface: Surface, size: Sizes, stands: tuple[Foot, ...]) -> Iterator[list[str]]:
    for foot in stands:
        yield _support(surface, size, foot)
    for stem in stems(surface, stands, size.span):  # with which it need not hang
        yield [
            f"# {line}" for line in ("To stand on a stem, take these lines instead:", *_support(surface, size, stem))
        ]


def _support(surface: Surface, size: Sizes, foot: Foot) -> list[str]:
    digits = max(0, 4 - int(np.floor(np.log10(surface.size))))
    at = foot.picker(0.25 * (size.edge or surface.mean_edge), digits)
    if isinstance(at, Boundary):
        pick = f'pick = "boundary", loop = {at.loop}'
    else:
        pick = f'pick = "box", min = {list(at.min)}, max = {list(at.max)}'
        pick += ", boundary = true" if at.boundary else ""
    metres = f"{length(foot.length)} of free edge" if foot.length else ""
    return ["[[surface.support]]", _entry("name", foot.name, metres), f"at = {{ {pick} }}", _entry("hold", "xyz")]


def _loads(surface: Surface, snow: bool) -> Iterator[list[str]]:
    yield ["[[surface.load]]", _entry("kind", "self_weight")]
    pressure = _entry("pressure", SNOW, "Pa on the plan: a placeholder for your local code")
    if snow:
        yield ["[[surface.load]]", _entry("kind", "snow"), pressure]
    elif wind := wind_lines(surface):
        if top := snow_on_top(surface):
            yield ["[[surface.load]]", _entry("kind", "snow"), pressure, f"at = {{ {top} }}"]
        yield wind


def _statics(size: Sizes) -> Iterator[str]:
    yield "[statics]"
    yield _entry("material", size.material, "dsfab materials lists them")
    yield _entry("thickness", size.thickness, "m")


def _pattern(surface: Surface, size: Sizes) -> Iterator[str]:
    yield "[pattern]"
    yield _entry("method", "stripes", "evenly spaced along the stress")
    yield _entry("keep", size.keep, "m around supports that stay whole")
    if surface.loops:
        yield _entry("rim", size.rim, "m along edges and openings that stay whole")
    yield _entry("fillet", size.fillet, "m, radius of the corners of openings")


def _families(size: Sizes) -> Iterator[list[str]]:
    for family, words in (("major", "m from one member to the next"), ("minor", "m, of those that cross them")):
        yield [f"[pattern.{family}]", _entry("spacing", size.spacing, words)]


def _widths() -> Iterator[str]:
    yield "[pattern.width]"
    yield _entry("rule", "constant", "members are as wide everywhere; graded, stressed: as they work")
    yield _entry("solid_fraction", SHARE, "share of the surface that is material")


def _thickening(surface: Surface) -> Iterator[list[str]]:
    if is_figure(surface):  # ears and fingers bend more sharply than a roof
        yield ["[thickening]", _entry("thinnest", THINNEST, "share of the thickness that sharp bends must leave")]


def _entry(key: str, value: Any, note: str = "") -> str:
    """A line of TOML with its comment."""
    line = f"{key} = {json.dumps(value, ensure_ascii=False)}"
    return f"{line:<26}  # {note}" if note else line


def _description(surface: Surface, size: Sizes, stands: tuple[Foot, ...], snow: bool) -> str:
    x, y, z = (length(float(side)) for side in np.ptp(surface.V, axis=0))
    loads = "its own weight and snow" if snow or snow_on_top(surface) else "its own weight"
    return f"{x} x {y}, {z} high, {size.material} of {length(size.thickness)}, on {_on(stands)}, under {loads}."


def _on(stands: tuple[Foot, ...]) -> str:
    """What it stands on, in words: 'its base ring', '4 feet', '2 springing lines'."""
    kinds = {foot.name.rstrip("0123456789 ") for foot in stands}
    if len(stands) == 1:
        return f"its {stands[0].name}"
    if len(kinds) > 1:
        return f"{len(stands)} parts of its edge"
    return f"{len(stands)} {'feet' if 'foot' in kinds else kinds.pop() + 's'}"
