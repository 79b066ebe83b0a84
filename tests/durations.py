"""How long files of tests take: recorded by `pytest --record-durations`, read to begin with those that take longest."""

import json
from collections import defaultdict
from pathlib import Path

import pytest

FILE = Path(__file__).with_suffix(".json")
"""Seconds by file, of its quick tests and of its slow ones."""


def place(path: Path) -> str:
    """Return a file of tests as a path in this folder."""
    return path.relative_to(FILE.parent).as_posix()


def kind(keywords: object) -> str:
    """Whether keywords are those of a slow test."""
    return "slow" if "slow" in keywords else "quick"  # type: ignore[operator]


def recorded() -> dict[str, dict[str, float]]:
    """Seconds by file, by kind of tests."""
    return json.loads(FILE.read_text(encoding="utf-8")) if FILE.exists() else {}


def longest_first(items: list[pytest.Item]) -> None:
    """Sort tests by the seconds of their files. A file without a record counts as the average of the others."""
    known, kinds = recorded(), defaultdict(set)
    for item in items:
        kinds[place(item.path)].add(kind(item.keywords))
    usual = {one: sum(files.values()) / len(files) for one, files in known.items() if files}
    seconds = {
        name: sum(known.get(one, {}).get(name, usual.get(one, 0.0)) for one in own) for name, own in kinds.items()
    }
    items.sort(key=lambda item: -seconds[place(item.path)])


class Recorder:
    """Adds up the seconds of a run, and writes them at its end. Files that it did not run keep their record."""

    def __init__(self) -> None:
        self._seconds: dict[str, dict[str, float]] = {"quick": defaultdict(float), "slow": defaultdict(float)}

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self._seconds[kind(report.keywords)][Path(report.location[0]).relative_to("tests").as_posix()] += (
            report.duration
        )

    def pytest_sessionfinish(self) -> None:
        known = recorded()
        found = {
            one: {
                name: round(seconds, 1)
                for name, seconds in sorted({**known.get(one, {}), **new}.items())
                if (FILE.parent / name).exists()
            }
            for one, new in self._seconds.items()
        }
        FILE.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
