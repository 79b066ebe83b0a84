"""What supports and loads are called: by the names that a preset gives them, else by what they are."""

from collections import Counter
from collections.abc import Sequence
from itertools import count
from typing import Annotated, Protocol

from pydantic import AfterValidator

LONGEST = 40
"""Characters of a name: it stands in a column of a table."""

SIGNS = " _-.,/+"
"""What a name may have besides letters and digits, of any language."""


def _plain(name: str) -> str:
    """The name itself; raises ValueError for one that would break a line or a table."""
    allowed = len(name) <= LONGEST and name == name.strip() and all(c.isalnum() or c in SIGNS for c in name)
    if not allowed:
        raise ValueError(
            f"{name[: LONGEST + 10]!r} must be up to {LONGEST} letters, digits, inner spaces and "
            f"{' '.join(SIGNS.strip())}"
        )
    return name


Name = Annotated[str, AfterValidator(_plain)]
"""What people call a support or a load; empty for no name. It changes no result."""


class _Support(Protocol):
    @property
    def name(self) -> str: ...


class _Load(_Support, Protocol):
    @property
    def kind(self) -> str: ...


def support_names(supports: Sequence[_Support]) -> list[str]:
    """Their names; 'support 2' for the second one without its own."""
    return [support.name or f"support {number}" for number, support in enumerate(supports, 1)]


def load_names(loads: Sequence[_Load]) -> list[str]:
    """Their names; their kinds for those without: 'snow', or 'snow 1' and 'snow 2' where there are several."""
    kinds = [load.kind.replace("_", " ") for load in loads]
    several = Counter(kind for kind, load in zip(kinds, loads, strict=True) if not load.name)
    numbers = {kind: count(1) for kind in several}
    return [
        load.name or (f"{kind} {next(numbers[kind])}" if several[kind] > 1 else kind)
        for kind, load in zip(kinds, loads, strict=True)
    ]
