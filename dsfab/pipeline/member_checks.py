"""What the members of a design are checked by: the standard of its material, the duration of its loads, its factors."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from dsfab.preset import Preset
from dsfab.surface import OF_LOADS

if TYPE_CHECKING:
    from dsfab.eurocode import Duration, Rules, Utilisation
    from dsfab.frame import MemberForces
    from dsfab.members import MemberGraph

LASTS: dict[str, "Duration"] = {"permanent": "permanent", "imposed E": "long", "imposed H": "short", "wind": "short"}
"""How long loads act, by what they are [EN 1995-1-1, table 2.2]; all others for a medium time, snow too."""


def member_utilisation(preset: Preset, graph: "MemberGraph", forces: Mapping[str, "MemberForces"]) -> "Utilisation":
    """What members bear over what they can bear, in the cases and combinations that stress is judged in.

    Raises StaticsError where neither the material nor a strength is known.
    """
    from dsfab.eurocode import MemberBays, utilisation

    bays = MemberBays.of(graph, forces, preset.statics.thickness)
    return utilisation(bays.some(preset.judged_in("ULS", bays.forces)), rules_of(preset, tuple(bays.forces)))


def rules_of(preset: Preset, cases: tuple[str, ...]) -> "Rules":
    """The rules of a preset for cases and combinations, by their names."""
    from dsfab.eurocode import Rules, SteelFactors, TimberFactors

    given, ask = preset.statics, preset.eurocode
    layer = (preset.workshop.thickness or given.thickness / preset.workshop.layers) if ask.bent_in else 0.0
    return Rules(
        given.material or "",
        given.young,
        given.young / (2 * (1 + given.poisson)),
        given.strength,
        {case: _duration(preset, case) for case in cases},
        SteelFactors(ask.curve, ask.gamma_m0, ask.gamma_m1, ask.buckling_length),
        TimberFactors(ask.service_class, ask.gamma_m, ask.buckling_length, layer),
        _loads(preset, cases),
        bool(preset.surface.sums),
    )


def _loads(preset: Preset, cases: tuple[str, ...]) -> str:
    """A sentence on what is judged, with which factors."""
    judged = preset.judged_in("ULS", cases)
    if preset.surface.sums:
        return f"Judged in {len(judged)} cases and combinations, with the factors that the preset gives them."
    return "Loads are those of the preset without partial factors: it has no combinations (surface.combinations)."


def _duration(preset: Preset, name: str) -> "Duration":
    """Of a case, or the shortest of those that a combination adds."""
    from dsfab.eurocode import shortest

    sums = {one.name: one.factors for one in preset.surface.sums}
    cases = [case for case, factor in sums.get(name, {name: 1.0}).items() if factor]
    return shortest(_of_case(preset, case) for case in cases) if cases else "medium"


def _of_case(preset: Preset, case: str) -> "Duration":
    from dsfab.eurocode import shortest

    if case in preset.eurocode.duration:
        return preset.eurocode.duration[case]
    action = preset.surface.actions.get(case)
    kinds = {load.kind for load in preset.surface.load if load.case == case}
    acts = {action} if action else {OF_LOADS.get(kind, "") for kind in kinds}
    return shortest(LASTS.get(act, "medium") for act in acts or {""})
