"""[eurocode]: what the members of a design are checked by."""

from collections.abc import Iterator, Sequence
from typing import Annotated, Literal

from annotated_types import Gt, Le
from pydantic import Field

from dsfab.preset_surface import Section
from dsfab.surface import Load

Duration = Literal["permanent", "long", "medium", "short", "instantaneous"]


class Eurocode(Section):
    """[eurocode]: how members are checked, by EN 1993-1-1 those of steel, by EN 1995-1-1 those of timber. The design
    itself is not changed by it."""

    service_class: Literal[1, 2, 3] = 2
    """Timber: 1 heated rooms, 2 under a roof, 3 in the open."""
    duration: dict[str, Duration] = Field(default_factory=dict)
    """Timber, by case: how long its loads act; left out: weight permanent, stores long, wind and maintenance short, all
    others medium."""
    gamma_m: Annotated[float, Gt(0)] | None = None
    """Timber: partial factor; left out: 1.3 for solid timber, 1.25 for glulam, 1.2 for LVL."""
    gamma_m0: Annotated[float, Gt(0)] = 1.0
    """Steel: partial factor of sections."""
    gamma_m1: Annotated[float, Gt(0)] = 1.0
    """Steel: partial factor of members that may buckle."""
    curve: Literal["a0", "a", "b", "c", "d"] = "c"
    """Steel: the buckling curve; c for solid sections."""
    buckling_length: Annotated[float, Gt(0), Le(10)] = 1.0
    """Times the distance of nodes along the member."""
    bent_in: bool = False
    """Timber: whether members are layers that are bent into shape from straight ones (`workshop.thickness`, or that of
    [statics] over `workshop.layers`): the stress of that is added."""

    def case_mistakes(self, loads: Sequence[Load]) -> Iterator[str]:
        """Cases that no load has, as 'key = value: what is allowed'."""
        cases = list(dict.fromkeys(load.case for load in loads)) or ["load"]
        for case in self.duration:
            if case not in cases:
                yield f"eurocode.duration.{case}: no load has this case (there are: {', '.join(cases)})"
