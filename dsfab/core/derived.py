"""Results that are computed from a single immutable object, and stored in this object.

Methods of the object's class use `cached_property`; functions of other modules use `derived`."""

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

V = TypeVar("V")
R = TypeVar("R")


class DerivedResults(dict[Any, Any]):
    """Results derived from a value, by key. Pickle omits the results, because another process can compute them."""

    def __reduce__(self) -> tuple[type["DerivedResults"], tuple[()]]:
        return DerivedResults, ()


def derived_results(value: object) -> DerivedResults:
    """Return the results that `derived` functions have stored in an object. The object must have a `__dict__`."""
    results: DerivedResults = vars(value).setdefault("_derived_results", DerivedResults())
    return results


def derived(function: Callable[[V], R]) -> Callable[[V], R]:
    """Decorate a function of one immutable object, so that the object stores the result for later calls."""

    @wraps(function)
    def held(value: V) -> R:
        results = derived_results(value)
        if function not in results:
            results[function] = function(value)
        result: R = results[function]
        return result

    return held
