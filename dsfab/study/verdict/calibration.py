"""Is a verdict's bound true? Random designs on six surfaces, judged, and compared with two levels more."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from dsfab.design import Design
from dsfab.errors import DsfabError
from dsfab.pipeline import run
from dsfab.preset_file import load_preset

SEEDS = 8
"""Designs of each kind."""

RULES = ("plain", "constant", "graded")


@dataclass(frozen=True)
class Kind:
    """Designs of one surface: a shipped preset, changes to it, and the range that frequencies are drawn from."""

    preset: str
    changes: dict[str, Any]
    frequency: tuple[float, float]


_EDGES = {"at": {"pick": "boundary"}, "hold": "xyz"}
_MIDDLE = {"kind": "force", "at": {"pick": "ball", "center": [0.3, 0.1, 0.0], "radius": 0.2}, "force": [0, 0, -1e3]}
KINDS: dict[str, Kind] = {
    "cantilever": Kind("cantilever", {"surface.edge": 0.065}, (2.5, 5.0)),
    "plate": Kind(
        "cantilever",
        {"surface.edge": 0.065, "surface.support": [_EDGES], "surface.load": [_MIDDLE], "pattern.rim": 0.05},
        (2.5, 4.5),
    ),
    "dome": Kind("dome", {"surface.edge": 0.62, "statics.thickness": 0.12, "pattern.rim": 0.3}, (2.0, 4.0)),
    "vault": Kind("barrel_vault", {"surface.edge": 0.45, "statics.thickness": 0.15}, (2.5, 5.0)),
    "sphere": Kind("globe", {"surface.edge": 0.16, "statics.thickness": 0.05, "pattern.keep": 0.2}, (2.0, 4.0)),
    "ring": Kind("bob", {"surface.edge": 0.1, "statics.thickness": 0.03, "pattern.keep": 0.08}, (3.0, 6.0)),
}
"""Each is meshed with 500 to 700 vertices; `ring` is the closed duck of genus 1 that stands for Bob."""


def random_design(kind: str, seed: int) -> Design:
    """A design of that kind: frequencies, modes, phases, widths and share of material drawn with the seed.

    Raises DsfabError for a draw that cannot be made.
    """
    rng, given = np.random.default_rng([seed, list(KINDS).index(kind)]), KINDS[kind]
    rule = RULES[int(rng.integers(len(RULES)))]
    changes: dict[str, Any] = dict(given.changes)
    for family in ("major", "minor"):
        changes[f"pattern.{family}.mode"] = int(rng.integers(1, 4))
        changes[f"pattern.{family}.frequency"] = round(float(rng.uniform(*given.frequency)), 2)
        changes[f"pattern.{family}.phase"] = round(float(rng.uniform(0, 1)), 3)
        changes[f"pattern.{family}.threshold"] = round(float(rng.uniform(-0.3, 0.2)), 2)
    width = (
        {"rule": rule} if rule == "plain" else {"rule": rule, "solid_fraction": round(float(rng.uniform(0.45, 0.7)), 2)}
    )
    changes["pattern.width"] = width
    return run(load_preset(given.preset, changes))


def random_designs(kind: str, count: int = SEEDS) -> Iterator[tuple[int, Design]]:
    """The first `count` seeds and designs of a kind that can be made."""
    seed = found = 0
    while found < count:
        try:
            design = random_design(kind, seed)
        except DsfabError:
            seed += 1
            continue
        yield seed, design
        found, seed = found + 1, seed + 1
