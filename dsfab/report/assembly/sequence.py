"""In which order members are put up: lower layers first, and within a layer from the supports upwards."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import groupby

import numpy as np

from dsfab.arrays import Floats
from dsfab.members import Member, MemberGraph
from dsfab.workshop import Layering, WorkshopPlan, is_strip, layer_numbers

MOST = 12
"""Pictures of steps, about."""
LEVEL = 0.02
"""Members that begin as high, within this share of the structure's height, follow each other by name."""

RULE = (
    "The lower layer goes up before the one above it: at every node the upper member is bolted on the lower one. "
    "Within a layer members go up from the supports upwards: by the height of their lowest point, those of one height "
    "in the order of their names. Members that nothing holds yet need props until the next layer is bolted on."
)
"""What `assembly_steps` does, for those who build by it."""


@dataclass(frozen=True)
class AssemblyStep:
    """Members that are put up together: names, and how many layers lie above them."""

    layer: int
    members: tuple[str, ...]


def assembly_steps(graph: MemberGraph, layering: Layering, up: Floats) -> tuple[AssemblyStep, ...]:
    """Every member that is built, once for each layer that it is in; `RULE` says in which order.

    up : (3,) unit vector.
    """
    return _ordered_steps(graph, up, partial(layer_numbers, layering))


PLANK_RULE = (
    "Planks with slots from above stand first, propped: {first}. Then those that are put on them: {then}, each piece "
    "along the middle of the normals at its slots. Within a family members go up by the height of their lowest point, "
    "those of one height in the order of their names. Splices are closed when both pieces sit."
)
"""What `plank_steps` does, for those who build by it."""
FAMILIES = {"major": "family A", "minor": "family B", "rim": "edges", "keep": "those around supports and loads"}


def plank_rule(plan: WorkshopPlan) -> str:
    """`PLANK_RULE` with the families of a plan."""
    assert plan.graph is not None
    assert plan.planks is not None
    there = {member.family for member in plan.graph.members if is_strip(member)}
    first, *then = [FAMILIES[family] for family in plan.planks.found.order if family in there]
    return PLANK_RULE.format(first=first, then=", then ".join(then))


def plank_steps(plan: WorkshopPlan, up: Floats) -> tuple[AssemblyStep, ...]:
    """Every member of a plan of planks, families in the order in which they are put on each other, plates last."""
    assert plan.graph is not None
    assert plan.planks is not None
    built, order = {part.member for part in plan.parts}, plan.planks.found.order

    def numbers(member: Member) -> tuple[int, ...]:
        if member.id not in built:
            return ()
        return (len(order) - 1 - order.index(member.family) if is_strip(member) else -1,)

    return _ordered_steps(plan.graph, up, numbers)


def _ordered_steps(
    graph: MemberGraph, up: Floats, numbers: Callable[[Member], tuple[int, ...]]
) -> tuple[AssemblyStep, ...]:
    """Steps by numbers of layers from the top: the largest goes up first."""
    heights = _heights(graph, up)
    span = max(max(heights.values()) - min(heights.values()), 1e-9)
    every = [
        (number, round(heights[member.id] / span / LEVEL), k, member.id)
        for k, member in enumerate(graph.members)
        for number in numbers(member)
    ]
    every.sort(key=lambda one: (-one[0], *one[1:]))
    together = max(int(np.ceil(len(every) / MOST)), 1)
    steps = []
    for number, some in groupby(every, key=lambda one: one[0]):
        names = [name for *_, name in some]
        steps += [AssemblyStep(number, tuple(names[k : k + together])) for k in range(0, len(names), together)]
    return tuple(steps)


def _heights(graph: MemberGraph, up: Floats) -> dict[str, float]:
    """The lowest point of each member, metres along `up`."""
    surface = graph.sheet.surface
    z = surface.V @ up
    return {member.id: float(z[surface.F[member.cells]].min()) for member in graph.members}
