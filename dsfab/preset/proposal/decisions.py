"""Decisions about a mesh: the `Proposal`, which contains a preset for `dsfab build`."""

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.materials import material_named
from dsfab.core.messages import length
from dsfab.preset.file import preset_from
from dsfab.preset.model import Preset
from dsfab.preset.proposal.feet import Foot, feet, stems, tips, turns
from dsfab.preset.proposal.marks import drawn_feet, drawn_marks, mark_decisions
from dsfab.preset.proposal.reading import Decision, UserMesh, mesh_in_file, mesh_in_memory, vertical_axis
from dsfab.preset.proposal.sizes import Sizes, is_figure, shorter_side, sizes
from dsfab.preset.proposal.text import SHARE, SNOW, proposal_text, snow_on_top, wind_lines
from dsfab.surface import Marks, RawMesh, Surface

OWN = "roof"
"""Shipped preset for the user's own surface; with `--mesh`, a proposal for that mesh replaces it."""


@dataclass(frozen=True, eq=False)
class Proposal:
    """A preset for a mesh, as text with comments, and the decisions behind it."""

    given: UserMesh
    size: Sizes
    stands: tuple[Foot, ...]
    snow: bool
    """True if the surface carries snow, see `takes_snow`."""
    marks: Mapping[str, Marks] = field(default_factory=dict)
    """Marks in the user's file beside the surface, by layer; see `drawn_marks`."""

    @cached_property
    def decisions(self) -> tuple[Decision, ...]:
        """Decisions in the order of the preset."""
        return (*self.given.decisions, *_decisions(self))

    @property
    def lines(self) -> tuple[str, ...]:
        """One line for each decision: topic, choice, and the key that changes it."""
        width = max(len(decision.topic) for decision in self.decisions)
        return tuple(
            f"{decision.topic:<{width}}  {decision.choice}" + (f"; change {decision.change}" if decision.change else "")
            for decision in self.decisions
        )

    def text(self, file: Path | None = None) -> str:
        """Return the preset as TOML; the text names no file for a mesh from Python.
        file : path of the mesh relative to the preset's folder; default: the user's path."""
        keys = self.given.keys | ({"file": str(file)} if file else {})
        notes = {decision.topic: decision.choice for decision in self.decisions}
        return proposal_text(self.given, keys, notes, self.size, self.stands, self.snow, self.marks)

    @cached_property
    def preset(self) -> Preset:
        values = tomllib.loads(self.text())
        if "mesh" in self.given.keys:
            values["surface"]["mesh"] = self.given.surface
        else:
            values["surface"]["file"] = Path(self.given.keys["file"]).absolute()
        return preset_from(values, f"proposal for {self.given.name}")


def preset_for(mesh: Any, unit: str | None = None, up: str | None = None, material: str | None = None) -> Preset:
    """Return a preset for the user's own surface: that of `dsfab new`, with a first guess of the thickness.
    mesh     : the path of a mesh file, a mesh that `Surface.of` takes, or (V, F): vertices (n, 3) and faces (m, 3).
    unit     : unit of the mesh: mm, cm, m ...; by default guessed for files without a unit, else metres.
    up       : axis of the mesh that points to the sky: x, y, z, -x, -y, -z; by default dsfab guesses this axis.
    material : a name that `dsfab materials` lists; default: GL24h, or PLA for surfaces smaller than 3 m.
    Raises SurfaceError for an invalid mesh or axis, PresetError for an unknown material."""
    proposal = propose(mesh, unit, up, material)
    return proposal.preset.with_thickness(proposal.size.thickness)


def propose(
    mesh: Any,
    unit: str | None = None,
    up: str | None = None,
    material: str | None = None,
    max_triangles: int | None = None,
    raw: RawMesh | None = None,
) -> Proposal:
    """Return the proposal with its text and decisions; see `preset_for`.
    max_triangles : limit for a mesh file, which also limits the time of reading it.
    raw           : content of the file, if the caller has read it."""
    axis = vertical_axis(up)
    name = material_named(material).name if material else None
    if isinstance(mesh, str | Path):
        user_mesh = mesh_in_file(Path(mesh), unit, axis, max_triangles, raw)
    else:
        user_mesh = mesh_in_memory(mesh, unit, axis)
    size = sizes(user_mesh.surface, name)
    marks = drawn_marks(user_mesh)
    stands = drawn_feet(marks) or feet(user_mesh.surface, size.span)
    snow = takes_snow(user_mesh.surface)
    size = size.with_feet(user_mesh.surface, [foot.points for foot in stands], roof=snow)
    return Proposal(user_mesh, size, stands, snow, marks)


def takes_snow(surface: Surface) -> bool:
    """Return True for a roof: an open surface that does not overlap itself much in plan."""
    if is_figure(surface):
        return False
    up = surface.normals[:, 2] * surface.areas
    seen = float(np.abs(up).sum())
    shown, once = 0.4, 1.2  # ratios of the area in plan to the area, and to the area in plan without overlaps
    return seen > shown * surface.area and seen < once * abs(float(up.sum()))


def _decisions(proposal: Proposal) -> Iterator[Decision]:
    surface, size, stands = proposal.given.surface, proposal.size, proposal.stands
    yield _mesh(surface, size)
    where = ", ".join(foot.name + (f" ({length(foot.length)})" if foot.length else "") for foot in stands)
    free = "; other edges and openings are free" if any(foot.length for foot in stands) else ", its lowest part"
    if "support" in proposal.marks:
        yield Decision("stands on", where, "surface.support")
    elif stems(surface, stands, size.span):
        stem = "; dsfab new writes the lines for a stem, too"
        yield Decision("hangs from", where + free + stem, "surface.support")
    else:
        yield Decision("stands on", where + free + _unsteady(surface, stands), "surface.support")
    yield from mark_decisions(proposal.marks)
    yield from _unsupported_pieces(surface, stands)
    yield Decision("carries", _load_words(surface, proposal.snow), "surface.load")
    figure = is_figure(surface)
    over = "" if figure else f", 1/{size.ratio} of the span of {length(size.bridged or size.span)}"
    material = f"{size.material}, of a thickness that sizing chooses; first guess {length(size.thickness)}{over}"
    yield Decision("made of", material, "statics.material, statics.thickness")
    across = f", about {round(size.span / size.spacing)} across" if not figure and _fills(surface, size) else ""
    members = f"members every {length(size.spacing)}{across}, along the stress"
    yield Decision("pattern", members, "pattern.major.spacing, pattern.minor.spacing")
    rim = f", a rim of {length(size.rim)} along free edges" if surface.loops else ""
    widths = f"even, {SHARE:.0%} of the surface is material{rim}"
    yield Decision("widths", widths, "pattern.width.solid_fraction, pattern.rim")
    yield Decision("files", "STL, 3MF, and STEP if it takes little time", "export.formats, export.step")


def _load_words(surface: Surface, roof: bool) -> str:
    top = None if roof else snow_on_top(surface)
    snow = (
        f" and snow of {SNOW / 1000:g} kPa on the plan{' of its top' if top else ''}, a placeholder for your local code"
    )
    wind = "; dsfab new also writes lines for wind, as comments"
    words = "its own weight" + (snow if roof or top else "")
    return words + (wind if not roof and wind_lines(surface) else "")


def _unsteady(surface: Surface, stands: tuple[Foot, ...]) -> str:
    points = [foot.points for foot in stands]
    if tips(surface, points):
        return "; it is also held down there, because its middle lies outside of them"
    line = "; it would turn about the line through them: add a support beside that line"
    return line if turns(surface, points) else ""


def _fills(surface: Surface, size: Sizes) -> bool:
    side = shorter_side(surface)
    x, y = np.sort(np.ptp(surface.V, axis=0)[:2])
    plan = float(np.abs(surface.normals[:, 2]) @ surface.areas)
    return size.span != side or side > x or plan > 0.5 * x * y


def _unsupported_pieces(surface: Surface, stands: tuple[Foot, ...]) -> Iterator[Decision]:
    count, piece = surface.pieces
    if count == 1 or not stands:
        return
    piece_of_vertex = np.empty(surface.n, dtype=np.int64)
    piece_of_vertex[surface.F] = piece[:, None]
    _, vertex = cKDTree(surface.V).query(np.concatenate([foot.points for foot in stands]))
    free = np.setdiff1d(np.arange(count), piece_of_vertex[vertex])
    if not len(free):
        return
    first_piece = piece == free[0]
    areas = surface.areas[first_piece]
    x, y, z = (np.round(areas @ surface.centroids[first_piece] / areas.sum(), 2) + 0.0).tolist()
    stand = f"{len(free)} of {count} pieces {'stand' if len(free) > 1 else 'stands'} on nothing"
    which = f"{'the first' if len(free) > 1 else 'it'} is around ({x:g}, {y:g}, {z:g}) m"
    yield Decision("pieces", f"{stand}, which cannot be built: join them in the file, or support each; {which}")


def _mesh(surface: Surface, size: Sizes) -> Decision:
    mean = length(surface.mean_edge)
    if not size.edge:
        return Decision("mesh", f"unchanged, with edges of {mean}", "surface.edge")
    smooth = ", on the smooth surface through its vertices" if size.coarse else ""
    words = f"new, with edges of {length(size.edge)} (in the file {mean}){smooth}; creases stay"
    return Decision("mesh", words, "surface.edge, surface.smooth")
