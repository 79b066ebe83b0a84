"""Choices of dsfab for a proposed preset, with reasons, and `Proposal`, which contains the preset for `dsfab build`."""

import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from dsfab.core.materials import material_named
from dsfab.core.messages import length
from dsfab.preset.file import preset_from
from dsfab.preset.model import Preset
from dsfab.preset.proposal.judgement import DOUBT
from dsfab.preset.proposal.loads import NO_WISHES, MeshWishes, load_words, takes_snow, wind_roof
from dsfab.preset.proposal.marks import drawn_feet, drawn_marks, mark_decisions
from dsfab.preset.proposal.reading import Decision, UserMesh, mesh_in_file, mesh_in_memory, vertical_axis
from dsfab.preset.proposal.readings import SupportPlace
from dsfab.preset.proposal.shape import is_figure
from dsfab.preset.proposal.sizes import MODEL, Sizes, shorter_side, sizes
from dsfab.preset.proposal.text import SHARE, ProposedValues, place_words, proposal_text
from dsfab.surface import RawMesh, Surface

OWN = "roof"  # Name of the shipped preset without a surface; with `--mesh`, dsfab proposes a preset instead.
LISTED = 4  # Largest number of supports that are listed by name in the decision about supports.


@dataclass(frozen=True, eq=False)
class Proposal:
    """A preset for the user's mesh, as text with comments, and the decisions of dsfab that explain the preset.
    given : the mesh.    plan : values of the preset.    wishes : supports and loads that the user wants."""

    given: UserMesh
    plan: ProposedValues
    wishes: MeshWishes = NO_WISHES

    @cached_property
    def decisions(self) -> tuple[Decision, ...]:
        """Decisions of dsfab about this preset, in the order of the preset's tables."""
        return (*self.given.decisions, *_decisions(self))

    @cached_property
    def questions(self) -> tuple[str, ...]:
        """Questions that only the user can answer, the most urgent first. Each question names an option for it."""
        return tuple(_questions(self))

    @property
    def lines(self) -> tuple[str, ...]:
        """A line for each decision: topic, choice, and the preset key that changes the choice."""
        return _decision_lines(self.decisions)

    @property
    def main_lines(self) -> tuple[str, ...]:
        """Lines of the decisions that a user should check: all except mesh, pattern, widths and files."""
        routine = ("mesh", "pattern", "widths", "files")
        return _decision_lines([decision for decision in self.decisions if decision.topic not in routine])

    def text(self, file: Path | None = None) -> str:
        """Return the preset as TOML. It contains no file name for a mesh from Python.
        file : path of the mesh relative to the preset's folder; default: the user's path."""
        keys = self.given.keys | ({"file": str(file)} if file else {})
        notes = {decision.topic: decision.choice for decision in self.decisions}
        return proposal_text(self.given, self.plan, keys, notes)

    @cached_property
    def preset(self) -> Preset:
        values = tomllib.loads(self.text())
        if "mesh" in self.given.keys:
            values["surface"]["mesh"] = self.given.surface
        else:
            values["surface"]["file"] = Path(self.given.keys["file"]).absolute()
        return preset_from(values, f"proposal for {self.given.name}")


def _decision_lines(decisions: Sequence[Decision]) -> tuple[str, ...]:
    width = max(len(decision.topic) for decision in decisions)
    return tuple(
        f"{decision.topic:<{width}}  {decision.choice}" + (f"; change {decision.change}" if decision.change else "")
        for decision in decisions
    )


def preset_for(
    mesh: Any,
    unit: str | None = None,
    up: str | None = None,
    material: str | None = None,
    wishes: MeshWishes = NO_WISHES,
) -> Preset:
    """Return the preset of `dsfab new` for the user's own surface, with a first guess of the thickness.
    mesh     : the path of a mesh file, a mesh that `Surface.of` takes, or (V, F): vertices (n, 3) and faces (m, 3).
    unit     : unit of the mesh: mm, cm, m ... Default: unit of the file, or a guess; metres for a mesh from Python.
    up       : axis of the mesh that points upwards: x, y, z, -x, -y, -z. Default: a guess.
    material : a name that `dsfab materials` lists. Default: GL24h, or PLA for surfaces smaller than 3 m.
    wishes   : supports and loads that the user wants.
    Raises SurfaceError for an invalid mesh or axis. Raises PresetError for an unknown material, for a surface without a
    plausible support, and for wishes that cannot be fulfilled."""
    proposal = propose(mesh, unit, up, material, wishes=wishes)
    return proposal.preset.with_thickness(proposal.plan.size.thickness)


def propose(
    mesh: Any,
    unit: str | None = None,
    up: str | None = None,
    material: str | None = None,
    max_triangles: int | None = None,
    raw: RawMesh | None = None,
    wishes: MeshWishes = NO_WISHES,
) -> Proposal:
    """Return the proposed preset with its text and decisions (choices with reasons); see `preset_for`.
    max_triangles : largest number in a mesh file.    raw : content of the file, if the caller has read it."""
    axis = vertical_axis(up)
    name = material_named(material).name if material else None
    if isinstance(mesh, str | Path):
        user_mesh = mesh_in_file(Path(mesh), unit, axis, max_triangles, raw, wishes)
    else:
        user_mesh = mesh_in_memory(mesh, unit, axis, wishes.stand)
    marks = drawn_marks(user_mesh)
    marked = drawn_feet(marks)
    if not marked and not wishes.stand:
        user_mesh.choice.require_plausible()
    stands, surface, winner = marked or user_mesh.places, user_mesh.surface, user_mesh.choice.best
    kind = winner.reading.kind
    if kind == "roof" and (is_figure(surface) or not takes_snow(surface)):
        kind = "object"
    size = sizes(surface, name)
    is_model = surface.size < MODEL or size.material == "PLA"
    loads = wishes.pressures(kind, is_model)
    size = size.with_feet(surface, [place.points for place in stands], roof=kind == "roof")
    built_in = wishes.built_in or (winner.built_in and not marked)
    roof = wind_roof(surface, stands) if "wind" in loads else ""
    return Proposal(user_mesh, ProposedValues(size, stands, built_in, loads, roof, marks), wishes)


def _decisions(proposal: Proposal) -> Iterator[Decision]:
    surface, plan, size = proposal.given.surface, proposal.plan, proposal.plan.size
    yield _mesh(surface, size)
    yield _stands(proposal)
    yield from mark_decisions(plan.marks)
    yield from _unsupported_pieces(surface, plan.stands)
    figure = is_figure(surface)
    model = (
        "; no snow, because the surface is as small as a printed model"
        if not plan.loads and surface.size < MODEL and not figure
        else ""
    )
    loads = load_words(surface, plan.loads, plan.roof) + model
    yield Decision("carries", loads, "surface.load, or --load snow, wind, people, none")
    over = "" if figure else f", 1/{size.ratio} of the span of {length(size.bridged or size.span)}"
    material = (
        f"{size.material}; `build` chooses the thickness of the sheet; first guess: {length(size.thickness)}{over}"
    )
    yield Decision("made of", material, "statics.material, statics.thickness")
    across = f", about {round(size.span / size.spacing)} across" if not figure and _fills(surface, size) else ""
    members = f"members every {length(size.spacing)}{across}, along the stress"
    yield Decision("pattern", members, "pattern.major.spacing, pattern.minor.spacing")
    rim = f", a rim of {length(size.rim)} along free edges" if surface.loops else ""
    widths = f"all members equally wide; {SHARE:.0%} of the surface is material{rim}"
    yield Decision("widths", widths, "pattern.width.solid_fraction, pattern.rim")
    yield Decision("files", "STL, 3MF, and STEP if it takes little time", "export.formats, export.step")


def _stands(proposal: Proposal) -> Decision:
    stands, winner = proposal.plan.stands, proposal.given.choice.best
    names = [place.name + (f" ({length(place.length)})" if place.length else "") for place in stands]
    where = ", ".join(names) if len(names) <= LISTED else place_words(stands)
    if "support" in proposal.plan.marks:
        return Decision("stands on", where, "surface.support")
    topic = "hangs from" if winner.reading.kind == "hung" else "stands on"
    free = (
        "; other edges and openings have no support" if any(place.length for place in stands) else ", its lowest part"
    )
    built_in = "; these supports are clamped, so they allow no rotation" if proposal.plan.built_in else ""
    tips = (
        "; the centre of mass is outside of the supports, so the supports must also resist uplift"
        if winner.tips
        else ""
    )
    alternatives = [candidate.reading.word for candidate in proposal.given.choice.runners_up]
    flag = f", or --stand {', '.join(alternatives)}" if alternatives else ""
    return Decision(topic, where + free + built_in + tips, "surface.support" + flag)


def _questions(proposal: Proposal) -> Iterator[str]:
    mesh, choice, winner = proposal.given, proposal.given.choice, proposal.given.choice.best
    if unit := choice.rival_unit:
        words = next(decision.choice for decision in mesh.decisions if decision.topic == "unit")
        names = [{"in": "inches", "ft": "feet"}.get(name, name) for name in (choice.unit, unit)]
        yield f"is {mesh.name} in {names[0]} or in {names[1]}? dsfab uses {words}; if wrong, add --unit {unit}"
    if "support" in proposal.plan.marks or proposal.wishes.stand:
        return
    for rival in choice.rivals:
        if rival.up != winner.up:
            words = f"does the axis {winner.up} of {mesh.name} point to the sky, or the axis {rival.up}?"
            yield f"{words} dsfab uses the axis {winner.up}; if this axis is wrong, add --up {rival.up}"
        else:
            names = [place_words(candidate.reading.places) for candidate in (winner, rival)]
            yield (
                f"is {mesh.name} supported by {names[0]}, or by {names[1]}? dsfab uses the first answer; for the "
                f"second answer, add --stand {rival.reading.word}"
            )
    if winner.score < DOUBT:
        guess = place_words(proposal.plan.stands)
        yield f"what supports {mesh.name}? dsfab guesses {guess}; if this is wrong, name the supports with --stand"


def _fills(surface: Surface, size: Sizes) -> bool:
    side = shorter_side(surface)
    x, y = np.sort(np.ptp(surface.V, axis=0)[:2])
    plan = float(np.abs(surface.normals[:, 2]) @ surface.areas)
    return size.span != side or side > x or plan > 0.5 * x * y


def _unsupported_pieces(surface: Surface, stands: tuple[SupportPlace, ...]) -> Iterator[Decision]:
    count, piece = surface.pieces
    if count == 1 or not stands:
        return
    _, vertex = cKDTree(surface.V).query(np.concatenate([foot.points for foot in stands]))
    free = np.setdiff1d(np.arange(count), surface.vertex_pieces[vertex])
    if not len(free):
        return
    first_piece = piece == free[0]
    areas = surface.areas[first_piece]
    x, y, z = (np.round(areas @ surface.centroids[first_piece] / areas.sum(), 2) + 0.0).tolist()
    stand = f"{len(free)} of {count} pieces {'stand' if len(free) > 1 else 'stands'} on nothing"
    which = f"{'the first' if len(free) > 1 else 'it'} is around ({x:g}, {y:g}, {z:g}) m"
    yield Decision(
        "pieces",
        f"{stand}, so the structure cannot be built: join the pieces in the file, or support each piece; {which}",
    )


def _mesh(surface: Surface, size: Sizes) -> Decision:
    mean = length(surface.mean_edge)
    if not size.edge:
        return Decision("mesh", f"unchanged, with edges of {mean}", "surface.edge")
    smooth = ", on the smooth surface through the file's vertices" if size.coarse else ""
    words = f"new mesh with edges of {length(size.edge)} ({mean} in the file){smooth}; creases stay"
    return Decision("mesh", words, "surface.edge, surface.smooth")
