"""Fixtures of the tests of the writers."""

import pytest

from dsfab.export.cad.step import file
from dsfab.export.cad.step.worker.shapes import step_facts


@pytest.fixture
def inspected(monkeypatch):
    """Inspect STEP files in this process, because a new one takes seconds to load OCCT; gives the facts of the last."""
    facts: dict = {}
    monkeypatch.setattr(file, "inspection", lambda part, path: facts.update(step_facts(path)) or facts)
    return facts
