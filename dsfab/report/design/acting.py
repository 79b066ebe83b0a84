"""What holds a design and what acts on it, entry by entry: numbers for `design.json`, from these tables for people."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from dsfab.wording import force, length, table, towards

if TYPE_CHECKING:
    from dsfab.arrays import Floats
    from dsfab.pipeline import Design
    from dsfab.surface import Load

BALANCED = 1e-3
"""A load whose resultant is a smaller share of its sum of magnitudes cancels out, as pressure all around does."""

ROUNDING = 1e-9
"""A support with a smaller share of the reactions carries nothing."""


def acting_facts(design: "Design", solved: bool = True) -> dict[str, Any]:
    """`supports` and `loads` of `design.json`; reactions and shares by case and combination, of the uncut sheet.

    Of each load the sum on the uncut surface (`force_N`), and on the cut sheet where that is there (`cut_force_N`).

    solved : whether reactions are told, which takes the statics; without them it is known what is held and loaded.
    Raises DsfabError for supports and loads that pick nothing, and of the statics.
    """
    from dsfab.pipeline import acting_on
    from dsfab.statics import load_entries, support_entries

    surface, weight = design.surface, design.preset.statics.weight
    on = acting_on(design.preset, surface)
    answers = {name: case.equilibrium for name, case in design.statics.cases.items()} if solved else {}
    return {
        "supports": [
            {
                "name": entry.name,
                "vertices": entry.vertices,
                "at_m": entry.place.tolist(),
                "along_m": entry.length,
                "area_m2": entry.area,
                "holds": entry.holds,
                "reaction_N": {case: part.tolist() for case, part in entry.reaction.items()},
                "share": dict(entry.share),
            }
            for entry in support_entries(surface, on.support, answers)
        ],
        "loads": [
            {
                "name": entry.name,
                "kind": entry.kind,
                "case": entry.case,
                "force_N": entry.force.tolist(),  # on the uncut surface
                **({"cut_force_N": _on_cut(design, load).tolist()} if design.has("slicing") else {}),
                "sum_of_magnitudes_N": entry.total,
                "area_m2": entry.area,
                "along_m": entry.length,
                "vertices": entry.vertices,
            }
            for entry, load in zip(load_entries(surface, on.load, weight), on.load, strict=True)
        ],
    }


def _on_cut(design: "Design", load: "Load") -> "Floats":
    """(3,) newtons of a load on the cut sheet: what acts on material alone is less there."""
    from dsfab.surface import load_parts

    surface, sheet = design.surface, design.sheet
    parts = load_parts(surface, [load], design.preset.statics.weight)
    own = (parts.weight + parts.bare)[sheet.parent]
    total: Floats = sheet.surface.areas @ own + surface.areas @ parts.covered + parts.point.sum(axis=0)
    return total


def acting_lines(facts: Mapping[str, Any]) -> Iterator[str]:
    """A table of the supports, each where it carries most, and one of the loads; nothing of older files."""
    supports, loads = facts.get("supports", ()), facts.get("loads", ())
    if supports:
        several = len(supports[0]["share"]) > 1
        head = ["support", "vertices", "along", "holds", *(["carries uncut", "share"] if supports[0]["share"] else [])]
        rows = [_support(entry, several) for entry in supports]
        yield from table([*head, *(["under"] if several else [])], rows).split("\n")
    if loads:
        several = len({entry["case"] for entry in loads}) > 1
        sheets = ["uncut sheet", *(["cut sheet"] if "cut_force_N" in loads[0] else [])]
        head = ["load", *(["case"] if several else []), *sheets, "towards", "on"]
        yield from table(head, [_load(entry, several) for entry in loads]).split("\n")


def _support(entry: Mapping[str, Any], several: bool) -> Sequence[str]:
    cells = [entry["name"], f"{entry['vertices']:,}", _extent(entry), entry["holds"]]
    if not entry["share"]:
        return cells
    size = {case: _size(reaction) for case, reaction in entry["reaction_N"].items()}
    most = max(size, key=lambda case: size[case])
    carried = force(size[most]) if entry["share"][most] > ROUNDING else "0 N"
    return [*cells, carried, f"{entry['share'][most]:.0%}", *([most] if several else [])]


def _load(entry: Mapping[str, Any], several: bool) -> Sequence[str]:
    sizes = [_size(entry[key]) for key in ("force_N", "cut_force_N") if key in entry]
    balanced = sizes[0] < BALANCED * entry["sum_of_magnitudes_N"]
    sums = ["0 N" if balanced else force(size) for size in sizes]
    way = "cancels out" if balanced else towards(entry["force_N"])
    return entry["name"], *([entry["case"]] if several else []), *sums, way, _extent(entry)


def _extent(entry: Mapping[str, Any]) -> str:
    """'4.2 m' of a line, '18 m2' of faces, else 'points'."""
    if entry["along_m"]:
        return length(entry["along_m"])
    if entry["area_m2"]:
        return f"{entry['area_m2']:.3g} m2"
    return "a point" if entry["vertices"] == 1 else f"{entry['vertices']} points"


def _size(vector: Sequence[float]) -> float:
    return float(sum(x * x for x in vector) ** 0.5)
