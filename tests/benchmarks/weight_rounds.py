"""How far directions turn if the uncut sheet weighs, face by face, what stripes leave of it, and what that gains.

    python -m tests.benchmarks.weight_rounds [PRESET ...]

By preset and number of rounds: joules of the cut structure under its own weight and all else, and what `build` tells.
"""

import sys

from dsfab import load_preset
from dsfab.design.design import Design
from dsfab.preset.model import Preset
from dsfab.study.comparison import comparison

PRESETS = ("barrel_vault", "gridshell", "tower")
"""Shipped presets that carry their own weight beside other loads."""


def plain(name: str, rounds: int = 0, **changes: object) -> Preset:
    """A shipped preset without what its directions do not need."""
    keys = {"statics.frequencies": 0, "statics.buckling": 0, "pattern.weight_rounds": rounds}
    return load_preset(name, {**keys, **changes})


def compliance(design: Design) -> float:
    """Joules of the cut structure under its own weight and all else, as `compare` has it."""
    return comparison(design, []).design.compliance


def measure(name: str) -> None:
    """Tell of one preset."""
    for rounds in range(3):
        design = Design.from_preset(plain(name, rounds))
        joules = compliance(design)
        told = [note.text for note in design.notes if note.text.startswith("directions of stripes follow")]
        print(f"{name}, {rounds} rounds: {joules:.5g} J; {'; '.join(told)}", flush=True)


if __name__ == "__main__":
    for each in sys.argv[1:] or PRESETS:
        measure(each)
