"""In which order members are put up: lower layers first, and within a layer from the supports upwards."""

from dataclasses import dataclass
from itertools import groupby

import numpy as np

from dsfab.arrays import Floats
from dsfab.members import MemberGraph
from dsfab.workshop import Layering, layer_numbers

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
    heights = _heights(graph, up)
    span = max(max(heights.values()) - min(heights.values()), 1e-9)
    every = [
        (number, round(heights[member.id] / span / LEVEL), k, member.id)
        for k, member in enumerate(graph.members)
        for number in layer_numbers(layering, member)
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
