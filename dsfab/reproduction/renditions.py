"""Three versions (renditions) of a figure by Madan et al., with measures."""

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
"""Settings of Madan et al. that presets may change, besides modes, frequencies and phases (Table 1 of the paper)."""

DEPARTURES: Mapping[str, tuple[Any, str]] = {
    "diffusion.labelling": (
        "magnitude",
        "families of stripes are assigned by the sign of the stress (signed), not by its magnitude",
    ),
    "statics.law": ("stvk", "material law of thin sheets (plane_stress), not St. Venant-Kirchhoff with a rigid normal"),
    "pattern.keep": (0.0, "material kept around loads and supports"),
    "pattern.rim": (0.0, "a rim of solid material along the boundary"),
}
"""Preset keys with values that may differ from Madan et al.: the value in their paper, and a text on other values."""

SHARES = (0.3, 0.5)  # least and largest share of material in the design with evenly spaced stripes


@dataclass(frozen=True, eq=False)
class Rendition:
    """A version (rendition) of a figure, with measures. After a failure, `refused` is the reason, and measures are nan.
    name         : letter (as in the paper), preset or stripes.    departures : differences from the paper.
    settings     : changes of the preset by key.
    share        : share of the surface that is kept.    pieces : number of pieces.    loose : pieces without a support.
    carried      : share of the loads on pieces with a support; nan without loads.
    over_uncut   : compliance / compliance of the uncut sheet; infinite if the design does not carry the loads.
    over_thinner : compliance / compliance of a thinner sheet of the same mass.
    deviation    : angle between members and principal directions, degrees.
    evenness     : widest / narrowest spacing of stripes (percentiles 95 and 5).
    crossing     : smallest angle between crossing members, degrees.
    uncarried    : reason why the design does not carry the loads."""

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
        """Options of `dsfab build` that make this version of the figure."""
        return "".join(f" --set {quote(f'{key}={_toml_value(value)}')}" for key, value in self.settings.items())


def renditions(design: Design) -> tuple[Rendition, ...]:
    """Return three versions of a figure: the paper's settings, the preset, and evenly spaced stripes.
    design : computed up to the pattern."""
    uncut: dict[str, float] = {}
    letter = measured_rendition("letter", design, LETTER, uncut)
    shipped = measured_rendition("preset", design, {}, uncut)
    share = float(np.clip(np.nan_to_num(shipped.share, nan=0.5), *SHARES))
    # frequency 0 means a spacing of sqrt(surface area) / 12
    stripes = {
        "pattern.method": "stripes",
        "pattern.width": {"rule": "graded", "solid_fraction": round(share, 3)},
        "pattern.major": {"frequency": 0.0},
        "pattern.minor": {"frequency": 0.0},
    }
    return letter, shipped, measured_rendition("stripes", design, stripes, uncut)


def departures(preset: Preset) -> tuple[str, ...]:
    """Return a text for each setting of a preset that differs from Madan et al."""
    texts = []
    for key, (paper, words) in DEPARTURES.items():
        section, name = key.split(".")
        if (value := getattr(getattr(preset, section), name)) != paper:
            texts.append(f"{words} ({value:g} m)" if isinstance(value, float) else words)
    if preset.pattern.method == "stripes":
        texts.append("evenly spaced stripes along the stress in place of modes, with widths that grow with the stress")
    return tuple(texts)


def measured_rendition(
    name: str, base_design: Design, settings: Mapping[str, Any], uncut_compliance: dict[str, float] | None = None
) -> Rendition:
    """Make a version (rendition) of a figure, with measures. settings : changes of the preset.
    uncut_compliance : compliance (J) of the uncut sheet by material law; new values are added to this dict."""
    try:
        preset = with_overrides(base_design.preset, dict(settings)) if settings else base_design.preset
        design = draft(preset, earlier=base_design)
        with_loose = draft(with_overrides(preset, {"slicing.loose": "keep"}), earlier=design)
        listed, quality = with_loose.slicing.pieces, design.quality(symmetry=False)
    except DsfabError as error:
        return Rendition(name, settings, refused=str(error))
    share = with_loose.sheet.surface.area / base_design.surface.area
    uncut, thinner, uncarried = _compliances(design, share, {} if uncut_compliance is None else uncut_compliance)
    counts = len(listed), sum(not piece.held for piece in listed), _carried_share(with_loose)
    measures = uncut, thinner, quality.deviation, quality.evenness, quality.crossing_angle
    return Rendition(name, settings, departures(preset), design, share, *counts, *measures, uncarried)


def _carried_share(design: Design) -> float:
    if not any(load.force.any() for load in design.statics.loads(design.preset.followed_weights).values()):
        return np.nan
    try:
        loads = design.cut_loads.values()
    except DsfabError:  # no material is left at the load or at supports
        return 0.0
    sheet = design.sheet.surface
    _, label = pieces(sheet.F, sheet.edges)
    supported = np.zeros(sheet.n, dtype=bool)
    supported[sheet.F[np.array([piece.held for piece in design.slicing.pieces])[label]]] = True
    size = sum(np.linalg.norm(load.force, axis=1) for load in loads)
    return min(float(np.sum(size[supported]) / np.sum(size)), 1.0)


def _compliances(design: Design, share: float, uncut_compliance: dict[str, float]) -> tuple[float, float, str]:
    """Return the compliance divided by that of the uncut sheet, and by that of a thinner sheet.
    The third value is the reason for infinite ratios, or ''. share : thickness ratio of the thinner sheet."""
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
