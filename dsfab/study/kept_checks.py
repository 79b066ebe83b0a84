"""Stores finished checks of a comparison on disk, so that an interrupted comparison does not repeat them."""

import hashlib
import json
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from dsfab.core.errors import ExportError
from dsfab.export import atomic_file
from dsfab.preset.file import preset_toml
from dsfab.study.baselines import ComparisonTask, Structure
from dsfab.study.judges import CaseResponse, Judge, Judgement, quick, solved_loads
from dsfab.study.verdict import Verdict


@dataclass(frozen=True)
class KeptChecks:
    """A folder with a file for each checked structure. The file contains the computed results (a `Judgement`).
    options : text with all options that change the results.
    reused  : function that is called each time when results are read from a file."""

    folder: Path
    options: str
    reused: Callable[[], None]

    def keeping(self, judge: Judge, every: bool | None = None) -> Judge:
        """Return a function that computes results as `judge` does, and stores them in a file, except for `quick`.
        The file contains no displacements and stresses, because one solve gives them again.
        every : True to solve all load cases again, False to solve the pattern's load cases again, None for no solve."""
        if judge is quick:
            return judge

        def lookup(task: ComparisonTask, structure: Structure) -> Judgement:
            file = self.folder / f"{self._key(task, structure, every)}.json"
            judgement = _read(file)
            if judgement is None:
                judgement = judge(task, structure)
                with suppress(
                    OSError, ExportError
                ):  # without space on the disk, the comparison goes on without this file
                    _write(file, judgement)
                return judgement
            self.reused()
            if every is None or structure.cells is structure.sheet:
                return judgement
            return replace(judgement, solved=solved_loads(task, structure, every))

        return lookup

    def _key(self, task: ComparisonTask, structure: Structure, every: bool | None) -> str:
        """Return a hash of all data on which a structure's results depend; it is the name of the file."""
        digest = hashlib.sha256()
        texts = version("dsfab"), preset_toml(task.preset), self.options, repr(every), repr(structure.thickness)
        for text in texts:
            digest.update(text.encode() + b"\0")
        for surface in (task.surface, structure.sheet.surface):
            digest.update(surface.V.tobytes() + surface.F.tobytes())
        return digest.hexdigest()[:32]


def _write(file: Path, judgement: Judgement) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    with atomic_file(file) as partial:
        partial.write_text(json.dumps(asdict(replace(judgement, solved={}))), encoding="utf-8")


@cache
def _readers() -> tuple[TypeAdapter[dict[str, CaseResponse]], TypeAdapter[Verdict | None]]:
    return TypeAdapter(dict[str, CaseResponse]), TypeAdapter(Verdict | None)


def _read(file: Path) -> Judgement | None:
    """Return the results in a file, or None if the file is missing or not readable."""
    try:
        values: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
        cases, check = _readers()
        read = {"cases": cases.validate_python(values["cases"]), "check": check.validate_python(values["check"])}
        return Judgement(**{**values, **read})
    except (OSError, ValueError, TypeError, KeyError, ValidationError):
        return None
