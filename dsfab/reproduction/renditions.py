"""Three renditions of a figure of the paper, with their measures: the paper to the letter, the preset, dsfab's stripes.
All three have the same surface, supports and loads."""

from collections.abc import Mapping
from dataclasses import dataclass
from shlex import quote
from typing import Any

import numpy as np

from dsfab.core.errors import DsfabError
from dsfab.design import Design, draft
from dsfab.preset.file import with_overrides
from dsfab.preset.model import Preset
from dsfab.statics import solve_for
from dsfab.surface import pieces

LETTER: Mapping[str, Any] = {
    "diffusion.labelling": "magnitude",
    "statics.law": "stvk",
    "pattern.keep": 0.0,
    "pattern.rim": 0.0,
    "pattern.width": {"rule": "plain"},
}
"""The paper's settings for keys in which presets may differ from it; modes, frequencies and phases are those of
Table 1."""

DEPARTURES: Mapping[str, tuple[Any, str]] = {
    "diffusion.labelling": (
        "magnitude",
        "families labelled by the sign of their stress (signed), not by its magnitude",
    ),
    "statics.law": ("stvk", "the law of a thin sheet (plane_stress), not St. Venant-Kirchhoff with a rigid normal"),
    "pattern.keep": (0.0, "material kept around loads and supports"),
    "pattern.rim": (0.0, "a rim kept along the boundary"),
}
"""Keys in which a preset may differ from the paper: the paper's value, and a text for any other value."""

SHARES = (0.3, 0.5)
"""Range of the share of material of stripes. A preset on modes may leave less, or almost no openings; above half,
stripes no longer form a lattice."""


@dataclass(frozen=True, eq=False)
class Rendition:
    """A rendition of a figure and its measures; after a failure `refused` is the reason, and the measures are nan.

    name : letter, preset or stripes.           departures : differences from the paper, in words.
    settings     : changes to the preset, by key: `dsfab build` reproduces the rendition with them.
    share        : kept share of the surface, loose pieces included.     pieces : number of pieces.
    loose        : number of pieces without a support.
    carried      : share of the loads on pieces with a support; nan without loads.
    over_uncut   : compliance over that of the uncut sheet, by one solve each with the elements that rank (the cut sheet
                   up to 15 % off); infinite if the loads are not carried.
    over_thinner : compliance over that of a thinner sheet of the same mass.
    deviation    : degrees off the principal directions, of the worse family.
    evenness     : P95 over P5 of the spacing, of the worse family.
    crossing     : degrees, the smallest angle between crossing members.
    uncarried    : reason why the loads are not carried, if `over_uncut` is infinite."""

    name: str
    settings: Mapping[str, Any]
    departures: tuple[str, ...] = ()
    design: Design | None = None
    share: float = np.nan
    pieces: int = 0
    loose: int = 0
    carried: float = np.nan
    over_uncut: float = np.nan
    over_thinner: float = np.nan
    deviation: float = np.nan
    evenness: float = np.nan
    crossing: float = np.nan
    uncarried: str = ""
    refused: str = ""

    @property
    def command(self) -> str:
        """Options that make this structure from the shipped preset."""
        return "".join(f" --set {quote(f'{key}={_toml_value(value)}')}" for key, value in self.settings.items())


def renditions(design: Design) -> tuple[Rendition, ...]:
    """Return the paper to the letter, the preset unchanged, and evenly spaced stripes. Stripes have as much material as
    the preset, within `SHARES`.

    design : a design of a preset of the paper, made up to its pattern."""
    uncut: dict[str, float] = {}
    letter = measured_rendition("letter", design, LETTER, uncut)
    shipped = measured_rendition("preset", design, {}, uncut)
    share = float(np.clip(np.nan_to_num(shipped.share, nan=0.5), *SHARES))
    # frequency 0 spaces stripes by a twelfth of the surface's side, because presets on modes have no spacing
    stripes = {
        "pattern.method": "stripes",
        "pattern.width": {"rule": "graded", "solid_fraction": round(share, 3)},
        "pattern.major": {"frequency": 0.0},
        "pattern.minor": {"frequency": 0.0},
    }
    return letter, shipped, measured_rendition("stripes", design, stripes, uncut)


def departures(preset: Preset) -> tuple[str, ...]:
    """Return texts about the settings in which a preset is not the paper to the letter."""
    texts = []
    for key, (paper, words) in DEPARTURES.items():
        section, name = key.split(".")
        if (value := getattr(getattr(preset, section), name)) != paper:
            texts.append(f"{words} ({value:g} m)" if isinstance(value, float) else words)
    if preset.pattern.method == "stripes":
        texts.append("evenly spaced stripes along the stress, as wide as it is large, in place of modes")
    return tuple(texts)


def measured_rendition(
    name: str, base_design: Design, settings: Mapping[str, Any], uncut_compliance: dict[str, float] | None = None
) -> Rendition:
    """Return a measured rendition; it shares the stages of `base_design` before the first changed section.

    uncut_compliance : compliance of the uncut sheet by law, which this function fills for renditions of the same
                       surface."""
    try:
        preset = with_overrides(base_design.preset, dict(settings)) if settings else base_design.preset
        design = draft(preset, earlier=base_design)
        # loose pieces are a result here: count them before they are dropped
        with_loose = draft(with_overrides(preset, {"slicing.loose": "keep"}), earlier=design)
        listed, quality = with_loose.slicing.pieces, design.quality(symmetry=False)
    except DsfabError as error:
        return Rendition(name, settings, refused=str(error))
    share = with_loose.sheet.surface.area / base_design.surface.area
    uncut, thinner, uncarried = _compliances(design, share, {} if uncut_compliance is None else uncut_compliance)
    return Rendition(
        name,
        settings,
        departures(preset),
        design,
        share,
        len(listed),
        sum(not piece.held for piece in listed),
        _carried_share(with_loose),
        uncut,
        thinner,
        quality.deviation,
        quality.evenness,
        quality.crossing_angle,
        uncarried,
    )


def _carried_share(design: Design) -> float:
    """Return the share of the loads on pieces with a support; nan without loads.
    design : with its loose pieces. A load without material of its own stands on the nearest material."""
    if not any(load.force.any() for load in design.statics.loads(design.preset.followed_weights).values()):
        return np.nan
    try:
        loads = design.cut_loads.values()
    except DsfabError:  # no material near the load, or no support is left
        return 0.0
    sheet = design.sheet.surface
    _, label = pieces(sheet.F, sheet.edges)
    supported = np.zeros(sheet.n, dtype=bool)
    supported[sheet.F[np.array([piece.held for piece in design.slicing.pieces])[label]]] = True
    size = sum(np.linalg.norm(load.force, axis=1) for load in loads)
    return min(float(np.sum(size[supported]) / np.sum(size)), 1.0)


def _compliances(design: Design, share: float, uncut_compliance: dict[str, float]) -> tuple[float, float, str]:
    """Return the cut sheet's compliance over the uncut sheet's and over a thinner sheet's, and the reason of a failure.
    nan without loads; infinite if the loads are not carried."""
    statics, weights = design.preset.statics, design.preset.followed_weights
    uncut_loads = design.statics.loads(weights)
    if not any(load.force.any() for load in uncut_loads.values()):
        return np.nan, np.nan, ""

    def compliance(surface: Any, thickness: float, loads: Mapping[str, Any]) -> float:
        answers = solve_for(statics.sheet(thickness).model_for(surface), loads, "ranking")
        return sum(weight * answers[name].compliance for name, weight in weights.items())

    try:
        cut_compliance = compliance(design.sheet.surface, statics.thickness, design.cut_loads)
    except DsfabError as error:
        return np.inf, np.inf, str(error)
    if statics.law not in uncut_compliance:
        uncut_compliance[statics.law] = compliance(design.surface, statics.thickness, uncut_loads)
    return (
        cut_compliance / uncut_compliance[statics.law],
        cut_compliance / compliance(design.surface, share * statics.thickness, uncut_loads),
        "",
    )


def _toml_value(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{" + ",".join(f"{key}={_toml_value(entry)}" for key, entry in value.items()) + "}"
    return f'"{value}"' if isinstance(value, str) else f"{value:g}"
