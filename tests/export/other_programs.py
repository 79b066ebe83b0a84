"""Programs that others wrote, where they are installed."""

import importlib.util
from collections.abc import Callable

import pytest


def module(name: str) -> Callable:
    return pytest.mark.skipif(importlib.util.find_spec(name) is None, reason=f"the module {name} is not installed")
