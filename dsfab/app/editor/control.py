"""`Control`: one key of a preset that the page lets a person change."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Control:
    """One key of a preset.

    kind            : number, whole (a whole number), choice, switch, length (a number of metres), words (a list of
                      them), size (three lengths) or material (a choice that other keys follow).
    low, high, step : of the slider; the number beside it takes what the preset takes.
    log             : whether the slider runs in decades.
    live            : whether the picture follows in the same frame; others are solved for on the server.
    word            : what may stand there instead of a number ("auto", "off").
    worth           : the number that the word stands for; without one it is the value itself.
    method          : the one pattern.method that takes it; others do not show it.
    instead         : the number that 0 stands for where stripes are evenly spaced.
    """

    group: str
    key: str
    label: str
    kind: str = "number"
    unit: str = ""
    low: float = 0.0
    high: float = 1.0
    step: float = 0.01
    log: bool = False
    live: bool = True
    word: str = ""
    choices: tuple[str, ...] = ()
    hint: str = ""
    method: str = ""
    instead: float = 0.0
    worth: float | None = None


def one_digit(value: float) -> float:
    """The nearest number with one digit."""
    digit = 10.0 ** np.floor(np.log10(value))
    return float(digit * max(round(value / digit), 1))
