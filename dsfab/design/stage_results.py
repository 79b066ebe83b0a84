"""The stored results of a design, their lifetime, and the results that a revision or a pickled design receives."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

T = TypeVar("T")

RESULT_NAMES = {"slicing": ("slicing", "sheet"), "thickening": ("solid",)}
"""Names of the results of a stage, where they differ from the name of the stage."""


@dataclass
class StageResults:
    """The results of one design by name, each computed once.

    results : results of the stages. A revision shares those of the stages before its first changed section.
    derived : values that follow from a stage, each with the stage's name. A revision shares them like results. A
              pickled design omits them, because another process can compute them again.
    inputs  : large intermediate results, each with the name of the one later stage that needs it. They exist until
              this stage has its result; revisions and pickled designs omit them."""

    results: dict[str, Any] = field(default_factory=dict)
    derived: dict[str, tuple[str, Any]] = field(default_factory=dict)
    inputs: dict[str, tuple[str, Any]] = field(default_factory=dict)

    def has(self, stage: str) -> bool:
        """Return True if a result of the stage exists."""
        return any(name in self.results for name in RESULT_NAMES.get(stage, (stage,)))

    def result(self, name: str, compute: Callable[[], T]) -> T:
        """Return the result `name`, computed on first access; its stage then drops its inputs."""
        if name not in self.results:
            self.results[name] = compute()
            for key in [key for key, (stage, _) in self.inputs.items() if stage == name]:
                del self.inputs[key]
        result: T = self.results[name]
        return result

    def replace(self, name: str, value: Any) -> None:
        """Replace a result, for example by one without the parts that later stages do not need."""
        self.results[name] = value

    def derived_value(self, stage: str, name: str, compute: Callable[[], T]) -> T:
        """Return a value that follows from the results up to `stage`, computed on first access."""
        return _computed_once(self.derived, stage, name, compute)

    def input_of(self, stage: str, name: str, compute: Callable[[], T]) -> T:
        """Return an input of `stage`, computed on first access and held until that stage has its result."""
        return _computed_once(self.inputs, stage, name, compute)

    def existing_value(self, name: str) -> Any:
        """Return a derived value if it exists, else None."""
        return self.derived.get(name, ("", None))[1]

    def existing_input(self, name: str) -> Any:
        """Return an input if it exists, else None."""
        return self.inputs.get(name, ("", None))[1]

    def of_stages(self, stages: Sequence[str]) -> "StageResults":
        """Return the results and derived values of these stages, for a revision."""
        names = [name for stage in stages for name in RESULT_NAMES.get(stage, (stage,)) if name in self.results]
        derived = {name: held for name, held in self.derived.items() if held[0] in stages}
        return StageResults({name: self.results[name] for name in names}, derived)

    def __getstate__(self) -> dict[str, Any]:
        return {"results": self.results, "derived": {}, "inputs": {}}


def _computed_once(held: dict[str, tuple[str, Any]], stage: str, name: str, compute: Callable[[], T]) -> T:
    if name not in held:
        held[name] = stage, compute()
    value: T = held[name][1]
    return value
