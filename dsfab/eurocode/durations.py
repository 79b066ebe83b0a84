"""How long loads act, and what timber bears of them: EN 1995-1-1, 2.3.1.2 and 3.1.3."""

from collections.abc import Iterable
from typing import Literal, get_args

Duration = Literal["permanent", "long", "medium", "short", "instantaneous"]
DURATIONS: tuple[Duration, ...] = get_args(Duration)
"""From over ten years to moments, as EN 1995-1-1, table 2.1."""

ServiceClass = Literal[1, 2, 3]

K_MOD: dict[ServiceClass, tuple[float, ...]] = {
    1: (0.6, 0.7, 0.8, 0.9, 1.1),
    2: (0.6, 0.7, 0.8, 0.9, 1.1),
    3: (0.5, 0.55, 0.65, 0.7, 0.9),
}
"""Of solid timber, glulam and LVL [EN 1995-1-1, table 3.1], by `DURATIONS`."""


def k_mod(duration: Duration, service_class: ServiceClass) -> float:
    """Factor on strengths for the duration of the load and the moisture [EN 1995-1-1, table 3.1]."""
    return K_MOD[service_class][DURATIONS.index(duration)]


def shortest(durations: Iterable[Duration]) -> Duration:
    """Of loads that act together the shortest counts [EN 1995-1-1, 3.1.3 (2)]."""
    return max(durations, key=DURATIONS.index)
