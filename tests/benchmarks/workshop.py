"""Seconds of the processor that each part of a workshop takes, once the sheet is cut.

    OMP_NUM_THREADS=1 python -m tests.benchmarks.workshop [PRESET ...]

A part's seconds are without those of others that it asks for.
"""

import sys
import tempfile
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from time import process_time
from typing import Any
from unittest.mock import patch

from dsfab import load_preset
from dsfab.design import Design
from dsfab.render import up_axis
from dsfab.report.assembly import assembly_page, assembly_pdf
from dsfab.workshop import workshop_plan, write_workshop

PRESETS = ("dome", "barrel_vault")
PARTS = {
    "members": ("dsfab.members.member_graph",),
    "limits": ("dsfab.workshop.strips.strip_limits", "dsfab.workshop.plan.construction_route"),
    "develop": ("dsfab.workshop.strips.strip_parts",),
    "splice": ("dsfab.workshop.splices.splice_cuts",),
    "drill and engrave": ("dsfab.workshop.strips._StripLayer._part",),
    "plates": ("dsfab.workshop.plates.plate_parts",),
    "nest": ("dsfab.workshop.plan.nested_by_thickness",),
    "hints": ("dsfab.workshop.stock.sheet_hints",),
    "same parts": ("dsfab.workshop.plan.equal_part_groups",),
}
"""Functions by the part of the work that they are; what none of them is counts as "else"."""


class Clock:
    """Seconds by parts: of those that are begun, only the last one's run on."""

    def __init__(self) -> None:
        self.spent: dict[str, float] = {}
        self.begun: list[str] = []
        self.since = process_time()

    def turn(self) -> None:
        """What went by since the last turn is the running part's."""
        now, name = process_time(), self.begun[-1] if self.begun else "else"
        self.spent[name] = self.spent.get(name, 0.0) + now - self.since
        self.since = now

    def timed(self, name: str, call: Callable[..., Any]) -> Callable[..., Any]:
        """A function whose seconds are those of a part."""

        def run(*given: Any, **named: Any) -> Any:
            self.turn()
            self.begun.append(name)
            try:
                return call(*given, **named)
            finally:
                self.turn()
                self.begun.pop()

        return run


def measured(name: str) -> tuple[dict[str, float], str]:
    """Seconds by parts, "PDF" among them, of a preset as strips, and what was made in a line."""
    design = Design.from_preset(load_preset(name, {"workshop.route": "strips"})).until("slicing")
    up = up_axis(design.surface.V, design.surface, design.load)
    clock = Clock()
    with ExitStack() as stack, tempfile.TemporaryDirectory() as folder:
        for part, paths in PARTS.items():
            for path in paths:
                owner, _, attribute = path.rpartition(".")
                stack.enter_context(patch(path, clock.timed(part, _found(owner, attribute))))
        plan = clock.timed("else", workshop_plan)(design, up)
        clock.timed("files", write_workshop)(plan, Path(folder), name)
        page = clock.timed("page", assembly_page)(plan, design)
        clock.timed("PDF", assembly_pdf)(plan, design)
    made = f"{len(plan.parts)} parts on {len(plan.sheets)} sheets, {plan.used:.1%} used, page {len(page)} bytes"
    return clock.spent, made


def measure(name: str) -> None:
    """Tell of one preset."""
    spent, made = measured(name)
    print(f"{name}: {made}")
    for part, seconds in spent.items():
        print(f"  {part:18} {seconds:6.2f} s")
    print(f"  {'all but the PDF':18} {without_pdf(spent):6.2f} s", flush=True)


def without_pdf(spent: dict[str, float]) -> float:
    """Seconds of all parts but that one."""
    return sum(seconds for part, seconds in spent.items() if part != "PDF")


def _found(owner: str, attribute: str) -> Callable[..., Any]:
    """A function by the path of its module, or of its class in one."""
    module, _, name = owner.rpartition(".")
    home = sys.modules.get(owner) or getattr(sys.modules[module], name)
    found: Callable[..., Any] = getattr(home, attribute)
    return found


if __name__ == "__main__":
    for each in sys.argv[1:] or PRESETS:
        measure(each)
