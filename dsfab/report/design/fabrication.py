"""What a build tells of fabrication: numbers for `design.json`, and from these numbers a table for people."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from dsfab.wording import length, table

if TYPE_CHECKING:
    from dsfab.slicing.features import Feature, Features
    from dsfab.study.fabrication import Check, FabricationMeasures

SHARES = (0.05, 0.5, 0.95)
"""The widths that these shares of the walls do not exceed are told."""

MEASURED = {"min_member": "smallest_member", "min_gap": "smallest_gap", "min_wall": "thinnest_wall"}
"""What each limit is compared with."""


def fabrication_facts(made: "FabricationMeasures") -> dict[str, Any]:
    """What was measured on a design, metres, and the limits of its preset; null where there is nothing of a kind."""
    found, wall = made.features, made.wall
    return {
        "thickness_m": made.thickness,
        "smallest_member": _feature(found.member),
        "smallest_gap": _feature(found.gap),
        "smallest_edge": _feature(found.edge),
        "thinnest_wall": None
        if wall is None
        else {"m": wall.thickness, "at_m": wall.place.tolist(), "what": "a wall of the solid"},
        "member_widths": _widths(found),
        "size_m": made.box.tolist(),
        "pieces": [
            {
                "area_m2": piece.area,
                "supports": list(piece.supports),
                "loads": list(piece.loads),
                "touches": list(piece.names),
            }
            for piece in made.pieces
        ],
        "triangles": {
            "worst_angle_deg": made.quality.worst_angle,
            "worst_at_m": made.quality.place.tolist(),
            "share_under_1_deg": made.quality.needles,
            "median_quality": made.quality.median,
        },
        "checks": [_check(check) for check in made.checks],
    }


def _feature(found: "Feature | None") -> dict[str, Any] | None:
    if found is None:
        return None
    return {"m": found.size, "at_m": found.place.tolist(), "what": found.what, "mesh_m": found.mesh}


def _widths(found: "Features") -> dict[str, Any]:
    limits, share = found.histogram()
    quantiles = zip(SHARES, found.quantiles(SHARES).tolist(), strict=False)
    return {
        "at_share_of_walls": {f"{at:.0%}": width for at, width in quantiles},
        "histogram_limits_m": limits.tolist(),
        "histogram_shares": share.tolist(),
    }


def _check(check: "Check") -> dict[str, Any]:
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
    """A line of what is smallest, and one of what of it is narrower than the sheet is thick; a table of the limits that
    are asked for or missed; loads and pieces where there are several."""
    found = {name: facts[name] for name in ("smallest_member", "smallest_gap", "thinnest_wall") if facts[name]}
    told = [f"{name.replace('_', ' ')} {length(value['m'])}" for name, value in found.items()]
    usual = facts["member_widths"]["at_share_of_walls"].get("50%")
    told += [f"members mostly {length(usual)}"] if usual else []
    yield ", ".join(told) if told else "no members, gaps or walls to measure"
    yield from _narrow(facts)
    if len(facts["pieces"]) > 1:
        for number, piece in enumerate(facts["pieces"], 1):
            yield f"piece {number}: {piece['area_m2']:.3g} m2, touches {_touched(piece)}"
    if checks := [check for check in facts["checks"] if _asked(check) or check["verdict"] == "fail"]:
        rows = table(("limit", "asked", "measured", "verdict"), [_row(check) for check in checks]).split("\n")
        yield from (f"{row}  {where}" for row, where in zip(rows, ["where", *map(_where, checks)], strict=True))


def _asked(check: Mapping[str, Any]) -> bool:
    """Whether [fabrication] has the limit; designs of before kept to no others."""
    return bool(check.get("asked", True))


def _narrow(facts: Mapping[str, Any]) -> Iterator[str]:
    """What is narrower than the sheet is thick, and no limit is set for: where it is and what cures it."""
    thickness, limits = facts.get("thickness_m", 0.0), {c["limit"] for c in facts["checks"] if _asked(c)}
    few = {key: facts[MEASURED[key]] for key in ("min_gap", "min_member") if facts[MEASURED[key]] and key not in limits}
    narrow = {key: value for key, value in few.items() if value["m"] < thickness}
    if narrow:
        places = (f"{value['what']} of {length(value['m'])} at {_point(value['at_m'])}" for value in narrow.values())
        asked = " and ".join(f"fabrication.{key}" for key in narrow)
        yield (
            f"narrower than the sheet is thick ({length(thickness)}): {', '.join(places)}; set {asked} and build "
            "with --fix where that cannot be made"
        )


def _touched(piece: Mapping[str, Any]) -> str:
    numbered = (f"{word[:-1]} {number}" for word in ("supports", "loads") for number in piece[word])
    return ", ".join(piece.get("touches") or numbered) or "no support and no load"


def _row(check: Mapping[str, Any]) -> Sequence[str]:
    sizes = [" x ".join(length(x) for x in check[key]) or "none" for key in ("limit_m", "measured_m")]
    return (check["limit"], *sizes, check["verdict"])


def _where(check: Mapping[str, Any]) -> str:
    return f"{check['what']} at {_point(check['at_m'])}" if check["at_m"] else str(check["what"])


def _point(place: Sequence[float]) -> str:
    return f"({', '.join(f'{x + 0.0:.3g}' for x in place)}) m"
