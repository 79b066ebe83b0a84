"""Text of a proposed preset with comments, with the proposed lines for snow and wind."""

import json
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.messages import length
from dsfab.preset.proposal.feet import Foot, stems
from dsfab.preset.proposal.marks import TABLES, mark_tables
from dsfab.preset.proposal.reading import UserMesh, is_nearly_closed
from dsfab.preset.proposal.sizes import MODEL, Sizes, is_figure
from dsfab.surface import Boundary, Marks, Surface, one_sided_pieces


def snow_on_top(surface: Surface) -> str | None:
    """Return the picker of faces with snow on an open surface that is not a roof, such as the upper part of a ball.
    Normals may point in or out. None for models, and for surfaces without a top (wall, tower) or without an outside."""
    edge = float(surface.edge_lengths[surface.edges.boundary].sum())
    if surface.size < MODEL or edge**2 > 16 * surface.area or is_nearly_closed(surface) or _one_sided(surface):
        return None
    outwards = np.einsum("mi,mi,m->", surface.normals, surface.centroids - surface.V.mean(axis=0), surface.areas)
    up = 1.0 if outwards > 0 else -1.0
    slides = 60  # degrees; snow slides off steeper faces [EN 1991-1-3, table 5.2]
    lies = up * surface.normals[:, 2] > np.cos(np.radians(slides))
    if float(surface.areas[lies].sum()) < 0.15 * surface.area:
        return None
    return f'pick = "facing", direction = [0.0, 0.0, {up}], angle = {slides}'


def wind_lines(surface: Surface) -> list[str]:
    """Return lines of a preset for wind on the broadest side of a surface that is not a roof; empty for a model."""
    if surface.size < MODEL or _one_sided(surface):
        return []
    seen: Floats = surface.areas @ np.abs(surface.normals)
    direction = [0.0, 1.0, 0.0] if seen[1] > seen[0] else [1.0, 0.0, 0.0]
    comment = "# Wind governs many upright surfaces; use these lines with the numbers of your local code:"
    load = ('kind = "wind"', "pressure = 500.0", f"direction = {direction}")
    return [comment, "# [[surface.load]]", *(f"# {line}" for line in load)]


def _one_sided(surface: Surface) -> bool:
    return bool(one_sided_pieces(surface.F, surface.edges).any())


SNOW = 750.0
"""Placeholder for the snow on the plan (Pa); the user must replace this value by that of the local code."""
SHARE = 0.45
"""Share of the surface that stays material."""


def proposal_text(
    user_mesh: UserMesh,
    keys: Mapping[str, Any],
    notes: Mapping[str, str],
    size: Sizes,
    stands: tuple[Foot, ...],
    snow: bool,
    marks: Mapping[str, Marks],
) -> str:
    """Return the preset as TOML with comments.
    keys  : keys of [surface], which define the mesh.    notes : the choice of each decision, by topic.
    marks : marks of the file, which replace proposed feet."""
    surface, stand = user_mesh.surface, () if "support" in marks else stands
    file = "" if "origin" in keys else str(keys.get("file"))  # curves in the file have the old origin
    tables = list(mark_tables(marks, file, str(keys.get("unit")), size, size.edge or surface.mean_edge))
    head = [
        f"# {user_mesh.name}: made by `dsfab new`; every value is a proposal. Units: metres, newtons, pascals.",
        _entry("name", user_mesh.name),
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
            _entry("snap", 0.01, "share of an edge by which cuts move to a vertex; a small one keeps halves alike"),
            _entry("min_member", size.thickness, "m; narrower members are widened"),
        ],
        *_thickening(surface),
        [
            "[export]",
            _entry("step", "quick", "STEP only if it takes little time; auto tries more ways, for minutes"),
            _entry("step_faces", 12_000, "STEP files with more planar faces are slow in CAD; the default is 30000"),
        ],
    )
    return "\n\n".join("\n".join(part) for part in parts) + "\n"


def _surface(keys: Mapping[str, Any], notes: Mapping[str, str], size: Sizes) -> Iterator[str]:
    yield "[surface]"
    comments = {"unit": notes["unit"], "up": notes["up"], "mend": notes.get("mended", "")}
    comments["repair"] = comments["mend"]
    comments["origin"] = "m; output files have their origin at this point of the mesh"
    for key, value in keys.items():
        if key != "mesh":
            yield _entry(key, value, comments.get(key, ""))
    if size.edge:
        yield _entry("edge", size.edge, "m; a new mesh of even triangles, with the same boundaries and creases")
    if size.edge and size.coarse:
        yield _entry("smooth", True, "the new vertices lie on the smooth surface through the old vertices")


def _supports(surface: Surface, size: Sizes, stands: tuple[Foot, ...]) -> Iterator[list[str]]:
    for foot in stands:
        yield _support(surface, size, foot)
    for stem in stems(surface, stands, size.span):  # a surface that stands on a stem needs no supports at its rim
        yield [
            f"# {line}"
            for line in (
                "For a surface that stands on a stem, use these lines instead:",
                *_support(surface, size, stem),
            )
        ]


def _support(surface: Surface, size: Sizes, foot: Foot) -> list[str]:
    digits = max(0, 4 - int(np.floor(np.log10(surface.size))))
    picker = foot.picker(0.25 * (size.edge or surface.mean_edge), digits)
    if isinstance(picker, Boundary):
        pick = f'pick = "boundary", loop = {picker.loop}'
    else:
        pick = f'pick = "box", min = {list(picker.min)}, max = {list(picker.max)}'
        pick += ", boundary = true" if picker.boundary else ""
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
    yield _entry("material", size.material, "`dsfab materials` lists all materials")
    yield _entry("thickness", size.thickness, "m")


def _pattern(surface: Surface, size: Sizes) -> Iterator[str]:
    yield "[pattern]"
    yield _entry("method", "stripes", "evenly spaced along the stress")
    yield _entry("keep", size.keep, "m of material around supports")
    if surface.loops:
        yield _entry("rim", size.rim, "m of material along edges and openings")
    yield _entry("fillet", size.fillet, "m, radius of the corners of openings")
    yield _entry("crowding", "avoid", "try other patterns where openings would be filled side by side; or note")


def _families(size: Sizes) -> Iterator[list[str]]:
    for family, words in (("major", "m, distance between members"), ("minor", "m, distance between crossing members")):
        yield [f"[pattern.{family}]", _entry("spacing", size.spacing, words)]


def _widths() -> Iterator[str]:
    yield "[pattern.width]"
    yield _entry("rule", "constant", "equally wide members; graded, stressed: wider where the stress is larger")
    yield _entry("solid_fraction", SHARE, "share of the surface that stays material")


def _thickening(surface: Surface) -> Iterator[list[str]]:
    if is_figure(surface):  # a sculpture has sharper bends than a roof
        yield ["[thickening]", _entry("thinnest", 0.05, "least share of the thickness at sharp bends")]


def _entry(key: str, value: Any, note: str = "") -> str:
    line = f"{key} = {json.dumps(value, ensure_ascii=False)}"
    return f"{line:<26}  # {note}" if note else line


def _description(surface: Surface, size: Sizes, stands: tuple[Foot, ...], snow: bool) -> str:
    x, y, z = (length(float(side)) for side in np.ptp(surface.V, axis=0))
    loads = "its own weight and snow" if snow or snow_on_top(surface) else "its own weight"
    return (
        f"{x} x {y}, {z} high, {size.material} of {length(size.thickness)}, on {_support_words(stands)}, under {loads}."
    )


def _support_words(stands: tuple[Foot, ...]) -> str:
    kinds = {foot.name.rstrip("0123456789 ") for foot in stands}
    if len(stands) == 1:
        return f"its {stands[0].name}"
    if len(kinds) > 1:
        return f"{len(stands)} parts of its edge"
    return f"{len(stands)} {'feet' if 'foot' in kinds else kinds.pop() + 's'}"
