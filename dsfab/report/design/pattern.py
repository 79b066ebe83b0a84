"""How good a pattern is: numbers for `design.json`, and from these numbers lines for people."""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from dsfab.wording import length

if TYPE_CHECKING:
    from dsfab.slicing.pattern_quality import FamilyQuality, PatternQuality

QUANTILES = ("5%", "50%", "95%")


def quality_facts(found: "PatternQuality") -> dict[str, Any]:
    """`pattern` of `design.json`: see `PatternQuality` for what each number is; metres, degrees, shares."""
    families = {name: _family(one) for name, one in found.families}
    both = {"crossing_angle_deg": found.crossing_angle, "symmetry_error": found.symmetry_error}
    return {"summary": found.summary, **families, **both}


def _family(found: "FamilyQuality") -> dict[str, Any]:
    return {
        "drawn": found.drawn,
        "spacing_m": dict(zip(QUANTILES, found.spacing, strict=True)),
        "clear_opening_m": dict(zip(QUANTILES, found.opening, strict=True)),
        "deviation_deg": found.deviation,
        "share_off_by_over_30_deg": found.off,
        "loose_ends_at_m": found.dead_ends.loose.tolist(),
        "turns_at_m": found.dead_ends.turns.tolist(),
        "slits": found.slits,
        "slit_share": found.slit_share,
    }


def quality_lines(facts: Mapping[str, Any]) -> Iterator[str]:
    """What is told of a pattern: dead ends, slits and directions; then the openings of each family and their spread."""
    yield f"pattern: {facts['summary']}"
    for name in ("major", "minor"):
        if not facts[name].get("drawn", True):
            continue
        opening, spacing = ([facts[name][key][at] for at in QUANTILES] for key in ("clear_opening_m", "spacing_m"))
        if not opening[2] > 0:
            yield f"{name} members: no opening between them"
            continue
        sizes = f"{length(opening[1])} clear between them, {length(opening[0])} to {length(opening[2])} on nine tenths"
        ratio = f"; spacing P95/P5 {spacing[2] / spacing[0]:.2f}" if spacing[0] > 0 else ""
        yield f"{name} members: {sizes}{ratio}"
