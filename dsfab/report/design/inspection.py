"""Loads, supports, pattern quality and fabrication of a design, as numbers and tables."""

from collections.abc import Iterator, Mapping, Sequence
from math import hypot
from typing import TYPE_CHECKING, Any

from dsfab.core.messages import direction_phrase, force, length, point_words, table

if TYPE_CHECKING:
    from dsfab.core.arrays import Floats
    from dsfab.design import Design
    from dsfab.slicing.measures.pattern_quality import FamilyQuality, PatternQuality
    from dsfab.slicing.measures.widths import Feature, Features
    from dsfab.study.fabrication import Check, FabricationMeasures
    from dsfab.surface import Load


def load_facts(design: "Design") -> dict[str, Any]:
    """Return `supports` and `loads` of `design.json`. Raises DsfabError if an entry does not act on the surface."""
    from dsfab.design import acting_on
    from dsfab.statics import load_entries, support_entries

    surface, weight = design.surface, design.preset.statics.area_weight
    acting = acting_on(design.preset, surface)
    return {
        "supports": [
            {
                "name": entry.name,
                "vertices": entry.vertices,
                "at_m": entry.place.tolist(),
                "along_m": entry.length,
                "area_m2": entry.area,
                "holds": entry.holds,
            }
            for entry in support_entries(surface, acting.support)
        ],
        "loads": [
            {
                "name": entry.name,
                "kind": entry.kind,
                "case": entry.case,
                "force_N": entry.force.tolist(),
                **({"cut_force_N": _force_on_cut_sheet(design, load).tolist()} if design.has("slicing") else {}),
                "sum_of_magnitudes_N": entry.total,
                "area_m2": entry.area,
                "along_m": entry.length,
                "vertices": entry.vertices,
            }
            for entry, load in zip(load_entries(surface, acting.load, weight), acting.load, strict=True)
        ],
    }


def _force_on_cut_sheet(design: "Design", load: "Load") -> "Floats":
    from dsfab.surface import load_parts

    surface, sheet = design.surface, design.sheet
    parts = load_parts(surface, [load], design.preset.statics.area_weight)
    uncovered = (parts.weight + parts.bare)[sheet.parent]
    total: Floats = sheet.surface.areas @ uncovered + surface.areas @ parts.covered + parts.point.sum(axis=0)
    return total


def load_lines(facts: Mapping[str, Any]) -> Iterator[str]:
    """Yield a table of supports and a table of loads. facts : content of `design.json`."""
    supports, loads = facts.get("supports", ()), facts.get("loads", ())
    if supports:
        yield from table(("support", "vertices", "along", "holds"), map(_support_row, supports)).split("\n")
    if loads:
        several = len({entry["case"] for entry in loads}) > 1
        sheets = ["uncut sheet", *(["cut sheet"] if "cut_force_N" in loads[0] else [])]
        head = ["load", *(["case"] if several else []), *sheets, "towards", "on"]
        yield from table(head, [_load_row(entry, several) for entry in loads]).split("\n")


def _support_row(entry: Mapping[str, Any]) -> Sequence[str]:
    return entry["name"], f"{entry['vertices']:,}", _extent_words(entry), entry["holds"]


def _load_row(entry: Mapping[str, Any], several: bool) -> Sequence[str]:
    sizes = [hypot(*entry[key]) for key in ("force_N", "cut_force_N") if key in entry]
    balanced = sizes[0] < 1e-3 * entry["sum_of_magnitudes_N"]  # pressure from all sides cancels out
    sums = ["0 N" if balanced else force(size) for size in sizes]
    direction = "cancels out" if balanced else direction_phrase(entry["force_N"])
    return entry["name"], *([entry["case"]] if several else []), *sums, direction, _extent_words(entry)


def _extent_words(entry: Mapping[str, Any]) -> str:
    if entry["along_m"]:
        return length(entry["along_m"])
    if entry["area_m2"]:
        return f"{entry['area_m2']:.3g} m2"
    return "a point" if entry["vertices"] == 1 else f"{entry['vertices']} points"


QUANTILES = ("5%", "50%", "95%")


def quality_facts(quality: "PatternQuality") -> dict[str, Any]:
    """Return the measures of a pattern's quality for `design.json`."""
    titled = zip(quality.titles, quality.families, strict=True)
    families = {name: {"title": title, **_family_facts(family)} for title, (name, family) in titled}
    shared = {"crossing_angle_deg": quality.crossing_angle, "symmetry_error": quality.symmetry_error}
    return {"summary": quality.summary, **families, **shared}


def _family_facts(quality: "FamilyQuality") -> dict[str, Any]:
    return {
        "drawn": quality.drawn,
        "spacing_m": dict(zip(QUANTILES, quality.spacing, strict=True)),
        "clear_opening_m": dict(zip(QUANTILES, quality.opening, strict=True)),
        "deviation_deg": quality.deviation,
        "share_off_by_over_30_deg": quality.off,
        "loose_ends_at_m": quality.dead_ends.loose.tolist(),
        "turns_at_m": quality.dead_ends.turns.tolist(),
        "slits": quality.slits,
        "slit_share": quality.slit_share,
    }


def quality_lines(facts: Mapping[str, Any]) -> Iterator[str]:
    """Yield lines of text on the quality of a pattern. facts : `pattern` of `design.json`."""
    yield f"pattern: {facts['summary']}"
    for name in ("major", "minor"):
        if not facts[name].get("drawn", True):
            continue
        opening, spacing = ([facts[name][key][q] for q in QUANTILES] for key in ("clear_opening_m", "spacing_m"))
        title = facts[name].get("title", f"{name} members")
        if not opening[2] > 0:
            yield f"{title}: no opening between them"
            continue
        sizes = f"{length(opening[1])} clear between them, {length(opening[0])} to {length(opening[2])} on 90 %"
        ratio = f"; spacing P95/P5 {spacing[2] / spacing[0]:.2f}" if spacing[0] > 0 else ""
        yield f"{title}: {sizes}{ratio}"


SHARES = (0.05, 0.5, 0.95)  # Quantiles of members' widths for `design.json`, measured at all edges of members.
MEASURED_KEY = {"min_member": "smallest_member", "min_gap": "smallest_gap", "min_wall": "thinnest_wall"}
"""Measure in `design.json` for each limit in the section [fabrication] of a preset."""


def fabrication_facts(measures: "FabricationMeasures") -> dict[str, Any]:
    """Return measures and limits of fabrication (metres) for `design.json`. A missing measure is None."""
    features, wall = measures.features, measures.wall
    wall_facts = wall and {"m": wall.thickness, "at_m": wall.place.tolist(), "what": "a wall of the solid"}
    return {
        "thickness_m": measures.thickness,
        "smallest_member": _feature_facts(features.member),
        "smallest_gap": _feature_facts(features.gap),
        "smallest_edge": _feature_facts(features.edge),
        "thinnest_wall": wall_facts,
        "member_widths": _width_facts(features),
        "size_m": measures.box.tolist(),
        "pieces": [
            {
                "area_m2": piece.area,
                "supports": list(piece.supports),
                "loads": list(piece.loads),
                "touches": list(piece.names),
            }
            for piece in measures.pieces
        ],
        "triangles": {
            "worst_angle_deg": measures.quality.worst_angle,
            "worst_at_m": measures.quality.place.tolist(),
            "share_under_1_deg": measures.quality.needles,
            "median_quality": measures.quality.median,
        },
        "checks": [_check_facts(check) for check in measures.checks],
    }


def _feature_facts(feature: "Feature | None") -> dict[str, Any] | None:
    if feature is None:
        return None
    return {"m": feature.size, "at_m": feature.place.tolist(), "what": feature.what, "mesh_m": feature.mesh}


def _width_facts(features: "Features") -> dict[str, Any]:
    limits, share = features.histogram()
    quantiles = zip(SHARES, features.quantiles(SHARES).tolist(), strict=False)
    return {
        "at_share_of_walls": {f"{quantile_share:.0%}": width for quantile_share, width in quantiles},
        "histogram_limits_m": limits.tolist(),
        "histogram_shares": share.tolist(),
    }


def _check_facts(check: "Check") -> dict[str, Any]:
    return {
        "limit": check.name,
        "limit_m": list(check.limit),
        "measured_m": list(check.value),
        "at_m": list(check.place),
        "what": check.what,
        "verdict": check.verdict,
        "asked": check.asked,
    }


def fabrication_lines(facts: Mapping[str, Any]) -> Iterator[str]:
    """Yield lines of text on the smallest features and the preset's limits. facts : `fabrication` of `design.json`."""
    sizes = {name: facts[name] for name in ("smallest_member", "smallest_gap", "thinnest_wall") if facts[name]}
    words = [f"{name.replace('_', ' ')} {length(value['m'])}" for name, value in sizes.items()]
    usual_width = facts["member_widths"]["at_share_of_walls"].get("50%")
    words += [f"members mostly {length(usual_width)}"] if usual_width else []
    yield ", ".join(words) if words else "the design has no members, gaps or walls to measure"
    yield from _narrow_line(facts)
    if len(facts["pieces"]) > 1:
        for number, piece in enumerate(facts["pieces"], 1):
            yield f"piece {number}: {piece['area_m2']:.3g} m2, touches {_touched_words(piece)}"
    if checks := [check for check in facts["checks"] if _is_limit_of_preset(check) or check["verdict"] == "fail"]:
        rows = table(("limit", "asked", "measured", "verdict"), [_check_row(check) for check in checks]).split("\n")
        yield from (f"{row}  {where}" for row, where in zip(rows, ["where", *map(_place_words, checks)], strict=True))


def _is_limit_of_preset(check: Mapping[str, Any]) -> bool:
    return bool(check.get("asked", True))


def _narrow_line(facts: Mapping[str, Any]) -> Iterator[str]:
    thickness, limits = facts.get("thickness_m", 0.0), {c["limit"] for c in facts["checks"] if _is_limit_of_preset(c)}
    measured = {key: facts[MEASURED_KEY[key]] for key in ("min_gap", "min_member") if key not in limits}
    narrow = {key: v for key, v in measured.items() if v and v["m"] < thickness}
    if narrow:
        places = (f"{v['what']} of {length(v['m'])} at {point_words(v['at_m'])}" for v in narrow.values())
        missing_limits = " and ".join(f"fabrication.{key}" for key in narrow)
        words = f"features narrower than the sheet's thickness ({length(thickness)}): {', '.join(places)}"
        yield f"{words}; if your workshop cannot make this, set {missing_limits} and build with --fix"


def _touched_words(piece: Mapping[str, Any]) -> str:
    numbered = (f"{word[:-1]} {number}" for word in ("supports", "loads") for number in piece[word])
    return ", ".join(piece.get("touches") or numbered) or "no support and no load"


def _check_row(check: Mapping[str, Any]) -> Sequence[str]:
    sizes = [" x ".join(length(x) for x in check[key]) or "none" for key in ("limit_m", "measured_m")]
    return (check["limit"], *sizes, check["verdict"])


def _place_words(check: Mapping[str, Any]) -> str:
    return f"{check['what']} at {point_words(check['at_m'])}" if check["at_m"] else str(check["what"])
