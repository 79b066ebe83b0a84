"""Which elements answer what: one table of uses, the pair of elements for each, and the error that it may have.

Whoever solves for a number that is told to people takes the pair from here, and `dsfab verify` tests every pair that
has a tolerance here: what is reported is what is verified.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

from dsfab.statics.elements import PAPER, Elements

Quantity = Literal["compliance", "compliance_once", "displacement", "stress", "frequency", "buckling", "six_nodes"]
"""What is reported."""

Aid = Literal["needles", "spread", "ranking", "directions"]
"""What is not reported itself, but leads to what is."""


@dataclass(frozen=True)
class Use:
    """What a pair of elements is for.

    pair      : the elements (without bending for a sheet that is solved in its plane).
    tolerance : largest relative error on the finest mesh of a verification test; None for what is not reported, and
                not tested therefore.
    about     : what it is for, in words.
    """

    pair: Elements
    tolerance: float | None
    about: str


_HYBRID, _SIX_NODES = Elements("hybrid", "hhj"), Elements("quadratic", "hhj")

USES: Mapping[Quantity | Aid, Use] = MappingProxyType(
    {
        "compliance": Use(_SIX_NODES, 0.02, "compliance with its bound, from finer and finer meshes"),
        "compliance_once": Use(_HYBRID, 0.02, "compliance by one solve"),
        "displacement": Use(_HYBRID, 0.02, "displacements and reactions"),
        "stress": Use(_HYBRID, 0.02, "stress and utilisation"),
        "frequency": Use(_HYBRID, 0.02, "natural frequencies"),
        "buckling": Use(_HYBRID, 0.02, "factors of linear buckling"),
        "six_nodes": Use(_SIX_NODES, 0.02, "what a program with six-node triangles should find"),
        "needles": Use(Elements("quadratic", "midedge"), None, "one solve of sheets with needles of faces"),
        "spread": Use(Elements("quadratic", "midedge"), None, "beside the compliance, for its bound alone"),
        "ranking": Use(Elements("constant", "midedge"), None, "which of many candidates is stiffer"),
        "directions": Use(PAPER, None, "directions of the stress, as in the paper"),
    }
)
"""The bounds of compliances are calibrated for their pairs (`dsfab.study.verdict.rules`): they change together."""

REPORTED: tuple[Elements, ...] = tuple(dict.fromkeys(use.pair for use in USES.values() if use.tolerance is not None))
"""Every pair that something is reported from."""


def elements_of(use: Quantity | Aid) -> Elements:
    """The pair of elements for a use. Raises KeyError for a use that is not in the table."""
    return USES[use].pair


def tolerance_of(quantity: Quantity) -> float:
    """The relative error that a reported quantity may have on the finest mesh of a verification test."""
    tolerance = USES[quantity].tolerance
    assert tolerance is not None  # what is reported has one
    return tolerance
