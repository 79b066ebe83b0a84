"""`propose`: a mesh to a commented preset that `dsfab build` takes."""

import json
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from dsfab.materials import material_named
from dsfab.preset import Preset
from dsfab.preset_file import preset_from
from dsfab.proposal.feet import Foot, feet
from dsfab.proposal.reading import Decision, GivenMesh, mesh_in_file, mesh_in_memory, require_vertical_axis
from dsfab.proposal.sizes import Sizes, is_figure, sizes
from dsfab.proposal.vertical import is_nearly_closed
from dsfab.surface import Boundary, Surface, Up
from dsfab.wording import length

OWN = "roof"
"""The shipped preset that stands for any surface of one's own: with `--mesh` it is proposed anew for that mesh."""
SNOW = 750.0
"""Pa on the plan: a placeholder for the local code."""
ROOF = 0.4
"""A surface is a roof if a plan shows it that share of its area at least."""
ONCE = 1.2
"""The surface over a plan's area may be no more than this many times as large, or parts of it lie over others."""
SHARE = 0.45
"""Of the surface that stays material."""


@dataclass(frozen=True, eq=False)
class Proposal:
    """A preset for a mesh, as text with comments, and what was decided."""

    given: GivenMesh
    size: Sizes
    stands: tuple[Foot, ...]

    def text(self, file: Path | None = None) -> str:
        """The preset as TOML; of a mesh that Python holds it names none.

        file : the mesh as the preset's folder sees it; the path that was given where left out.
        """
        keys = self.given.keys | ({"file": str(file)} if file else {})
        return "\n".join(_text(replace(self.given, keys=keys), self.size, self.stands, self.decisions)) + "\n"

    @cached_property
    def decisions(self) -> tuple[Decision, ...]:
        """All of them, in the order of the preset."""
        return (*self.given.decisions, *_decisions(self.given.surface, self.size, self.stands))

    @cached_property
    def preset(self) -> Preset:
        """The preset itself."""
        values = tomllib.loads(self.text())
        if "mesh" in self.given.keys:
            values["surface"]["mesh"] = self.given.keys["mesh"]
        else:
            values["surface"]["file"] = Path(self.given.keys["file"]).absolute()
        return preset_from(values, f"proposal for {self.given.name}")

    @property
    def lines(self) -> tuple[str, ...]:
        """A line for each decision: topic, what was decided, how to change it."""
        width = max(len(each.topic) for each in self.decisions)
        return tuple(
            f"{each.topic:<{width}}  {each.choice}" + (f"; change {each.change}" if each.change else "")
            for each in self.decisions
        )


def preset_for(mesh: Any, unit: str | None = None, up: Up | None = None, material: str | None = None) -> Preset:
    """A preset for a surface of one's own, as `dsfab new` writes it.

    mesh     : the path of a mesh file, or a mesh that `Surface.of` takes, or (V, F).
    unit     : of its numbers: mm, cm, m ...; guessed for files that do not say, else metres.
    up       : its axis that points to the sky; guessed where left out.
    material : a name that `dsfab materials` lists; GL24h, or PLA for what is smaller than 3 m, where left out.

    Raises SurfaceError for what is no mesh, PresetError for a material that is not known.
    """
    return propose(mesh, unit, up, material).preset


def propose(mesh: Any, unit: str | None = None, up: Up | None = None, material: str | None = None) -> Proposal:
    """The same with its text and its decisions; see `preset_for`."""
    require_vertical_axis(up)
    name = material_named(material).name if material else None
    given = mesh_in_file(Path(mesh), unit, up) if isinstance(mesh, str | Path) else mesh_in_memory(mesh, unit, up)
    size = sizes(given.surface, name)
    return Proposal(given, size, feet(given.surface, size.span))


def _takes_snow(surface: Surface) -> bool:
    """Whether it is a roof: open, large, seen from above, and nowhere twice."""
    if is_figure(surface):
        return False
    up = surface.normals[:, 2] * surface.areas
    seen = float(np.abs(up).sum())
    return seen > ROOF * surface.area and seen < ONCE * abs(float(up.sum()))


def _decisions(surface: Surface, size: Sizes, stands: tuple[Foot, ...]) -> Iterator[Decision]:
    edge, mean = size.edge, surface.mean_edge
    if edge:
        smooth = ", on the smooth surface through its vertices" if size.coarse else ""
        words = f"made anew with edges of {length(edge)} (they are {length(mean)}){smooth}; creases stay"
        yield Decision("mesh", words, "surface.edge, surface.smooth")
    else:
        yield Decision("mesh", f"kept as it is, with edges of {length(mean)}", "surface.edge")
    where = ", ".join(foot.name + (f" ({length(foot.length)})" if foot.length else "") for foot in stands)
    free = "; other edges and openings are free" if any(foot.length for foot in stands) else ", its lowest part"
    yield Decision("stands on", where + free, "surface.support")
    snow = (
        f" and snow of {SNOW / 1000:g} kPa on the plan, a placeholder for your local code"
        if _takes_snow(surface)
        else ""
    )
    yield Decision("carries", "its own weight" + snow, "surface.load")
    figure = is_figure(surface)
    over = "" if figure else f", 1/{size.ratio} of the span of {length(size.span)}"
    yield Decision(
        "made of", f"{size.material}, {length(size.thickness)} thick{over}", "statics.material, statics.thickness"
    )
    across = "" if figure else f", about {round(size.span / size.spacing)} across the span"
    yield Decision(
        "pattern",
        f"members every {length(size.spacing)}{across}, along the stress",
        "pattern.major.spacing, pattern.minor.spacing",
    )
    rim = f", a rim of {length(size.rim)} along free edges" if surface.loops else ""
    yield Decision(
        "widths", f"even, {SHARE:.0%} of the surface is material{rim}", "pattern.width.solid_fraction, pattern.rim"
    )


def _text(given: GivenMesh, size: Sizes, stands: tuple[Foot, ...], decisions: tuple[Decision, ...]) -> Iterator[str]:
    """The lines of the preset."""
    surface = given.surface
    yield f"# {given.name}: made by `dsfab new`; every value is a proposal. Units: metres, newtons, pascals."
    yield f"name = {json.dumps(given.name)}"
    yield f"description = {json.dumps(_description(surface, size, stands))}"
    yield "\n[surface]"
    told = {each.topic: each.choice for each in decisions}
    for key, value in given.keys.items():
        if key != "mesh":
            note = {"unit": told["unit"], "up": told["up"], "mend": told.get("mended", "")}.get(key, "")
            yield _entry(key, value, note)
    if size.edge:
        yield _entry("edge", size.edge, f"m; the mesh is made anew, its edges are {length(surface.mean_edge)}")
    if size.edge and size.coarse:
        yield _entry("smooth", True, "on the smooth surface through the mesh; creases and edges stay")
    digits = max(0, 4 - int(np.floor(np.log10(surface.size))))
    for foot in stands:
        at = foot.picker(0.25 * (size.edge or surface.mean_edge), digits)
        corners = (
            ""
            if isinstance(at, Boundary)
            else f", min = {list(at.min)}, max = {list(at.max)}" + (", boundary = true" if at.boundary else "")
        )
        pick = f'pick = "boundary", loop = {at.loop}' if isinstance(at, Boundary) else f'pick = "box"{corners}'
        yield "\n[[surface.support]]"
        yield _entry("name", foot.name, f"{length(foot.length)} of free edge" if foot.length else "")
        yield f"at = {{ {pick} }}"
        yield _entry("hold", "xyz")
    yield "\n[[surface.load]]"
    yield _entry("kind", "self_weight")
    if _takes_snow(surface):
        yield "\n[[surface.load]]"
        yield _entry("kind", "snow")
        yield _entry("pressure", SNOW, "Pa on the plan: a placeholder for your local code")
    yield "\n[statics]"
    yield _entry("material", size.material, "dsfab materials lists them")
    yield _entry("thickness", size.thickness, "m")
    yield "\n[pattern]"
    yield _entry("method", "stripes", "evenly spaced along the stress")
    yield _entry("keep", size.keep, "m around supports that stay whole")
    if surface.loops and not is_nearly_closed(surface):
        yield _entry("rim", size.rim, "m along edges and openings that stay whole")
    yield _entry("fillet", size.fillet, "m, radius of the corners of openings")
    for family, words in (("major", "m from one member to the next"), ("minor", "and across")):
        yield f"\n[pattern.{family}]"
        yield _entry("spacing", size.spacing, words)
    yield "\n[pattern.width]"
    yield _entry("rule", "constant", "members are as wide everywhere; graded, stressed: as they work")
    yield _entry("solid_fraction", SHARE, "share of the surface that is material")


def _entry(key: str, value: Any, note: str = "") -> str:
    """A line of TOML with its comment."""
    line = f"{key} = {json.dumps(value, ensure_ascii=False)}"
    return f"{line:<26}  # {note}" if note else line


def _description(surface: Surface, size: Sizes, stands: tuple[Foot, ...]) -> str:
    names = [foot.name for foot in stands]
    on = (
        names[0]
        if len(names) == 1
        else f"{len(names)} feet and edges"
        if len(set(n.split()[0] for n in names)) > 1
        else f"{len(names)} {names[0].rsplit(' ', 1)[0]}s"
    )
    on = on.replace("foots", "feet")
    x, y, z = (length(float(side)) for side in np.ptp(surface.V, axis=0))
    loads = "its own weight and snow" if _takes_snow(surface) else "its own weight"
    return f"{x} x {y}, {z} high, {size.material} of {length(size.thickness)}, on {on}, under {loads}."
