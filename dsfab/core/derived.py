"""Results that are computed from an immutable object and stored in this object."""

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

V = TypeVar("V")
R = TypeVar("R")


class DerivedResults(dict[Any, Any]):
    """Results that belong to an object, by key. A pickled object has none of these results."""

    def __reduce__(self) -> tuple[type["DerivedResults"], tuple[()]]:
        return DerivedResults, ()


def derived_results(value: object) -> DerivedResults:
    """Return the stored results of an object. The object must have a `__dict__`."""
    results: DerivedResults = vars(value).setdefault("_derived_results", DerivedResults())
    return results


def derived(function: Callable[[V], R]) -> Callable[[V], R]:
    """Decorate a function of an immutable object, so that the object stores the result."""

    @wraps(function)
    def held(value: V) -> R:
        results = derived_results(value)
        if function not in results:
            results[function] = function(value)
        result: R = results[function]
        return result

    return held
