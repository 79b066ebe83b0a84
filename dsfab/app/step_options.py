"""The options about STEP that `build` and `export` share, and the table of `--estimate`."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from dsfab.app.terminal import Reporter, out
from dsfab.wording import size, table

if TYPE_CHECKING:
    from dsfab.export import Estimate
    from dsfab.pipeline.design import Design
    from dsfab.preset import Preset


@Parameter(name="*")
@dataclass(frozen=True)
class StepFlags:
    """How STEP is made, how large it may get, and whether only that is asked."""

    step: Annotated[
        str | None,
        Parameter(
            help="How STEP is made: auto, quick, planar (flat, folded), members, smooth or compact (curved), faceted, "
            "tessellated."
        ),
    ] = None
    max_faces: Annotated[int | None, Parameter(help="Largest number of faces of a STEP file [export.step_faces].")] = (
        None
    )
    max_mb: Annotated[
        float | None, Parameter(help="Largest size of a STEP file in MB; 0 is no limit [export.step_mb].")
    ] = None
    estimate: Annotated[
        bool,
        Parameter(name="--estimate", negative=(), help="Say what each way to write STEP would cost; write nothing."),
    ] = False

    def overrides(self) -> tuple[str, ...]:
        """The options as KEY=VALUE of the preset, which checks them."""
        given = {"step": self.step, "step_faces": self.max_faces, "step_mb": self.max_mb}
        return tuple(f"export.{key}={json.dumps(value)}" for key, value in given.items() if value is not None)


NO_FLAGS = StepFlags()
"""STEP as the preset says."""


def estimate_step(given: "Preset", reporter: Reporter, built: "Design | None" = None) -> int:
    """Make the design, unless it was built, and say what its STEP file would cost; nothing is written."""
    from dsfab.pipeline import run

    try:
        design = built or run(given, reporter)
        reporter("export", "estimating STEP")
        lines = list(estimate_lines(design))
        reporter.done()
    finally:
        reporter.stop()
    for line in lines:
        out(line)
    return 0


def estimate_lines(design: "Design") -> Iterator[str]:
    """A row for each way, the way that would be taken, and why not otherwise."""
    from dsfab.delivery.files import deliverable
    from dsfab.export import step_estimates

    thing, how = deliverable(design, ".step")
    how.pop("details", None)  # what the file says beside its shape weighs nothing
    found = step_estimates(thing, name=design.preset.name, **how)
    head = ("STEP", "faces", "size", "write s", "open s", "memory to open", "")
    yield table(head, [_row(one) for one in found])
    for one in found:
        if one.refused or one.note:
            yield f"  {one.way}: {one.refused or one.note}"
    if not any(one.chosen for one in found):
        yield "none of these would be written; raise --max-faces or --max-mb, or write stl or 3mf"


def _row(one: "Estimate") -> tuple[str, ...]:
    mark = "<- chosen" if one.chosen else ("refused" if one.refused else "")
    if not one.faces:
        return (one.way, *["-"] * 5, mark)
    times = (f"{one.write_seconds:.3g}", f"{one.open_seconds:.2g}")
    return (one.way, f"{one.faces:,}", size(one.size), *times, size(one.memory), mark)
