"""`dsfab explore` and `dsfab preview`: many designs, or one, seen before anything is cut."""

import shlex
import time
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from dsfab.app.build import Mesh, Quiet, Set, Unit, read_preset
from dsfab.app.fields import asking
from dsfab.app.folder import whole_or_nothing
from dsfab.app.report import Reporter, out, size
from dsfab.app.variations import (
    Values,
    best_order,
    combinations,
    count,
    expected_seconds,
    short_names,
    spelled,
    varied,
)
from dsfab.errors import DsfabError
from dsfab.preset_file import overridden

if TYPE_CHECKING:
    from dsfab.app.contact import Tile
    from dsfab.app.previewer import Previewer
    from dsfab.design import Draft
    from dsfab.preset import Preset

ASKS = 200
"""More variants than this are drawn only after --yes."""

SMALLEST, LARGEST = 64, 8000
"""Pixels of a side of a picture."""

SHOWN_WIDE = 380
"""Pixels across a tile of the contact sheet."""

View = Annotated[str, Parameter(help="iso, top, front, side, or azimuth,elevation in degrees.")]
Show = Annotated[
    str,
    Parameter(
        help="structure, stress, major, minor; of the uncut sheet: loads, directions, major_mode, minor_mode, "
        "vonmises, utilisation, energy, displacement, buckling, frequency."
    ),
]


def preview(
    preset: str,
    /,
    *,
    set_: Set = (),
    mesh: Mesh = None,
    unit: Unit = None,
    view: View = "iso",
    show: Show = "structure",
    output: Annotated[Path | None, Parameter(name=["-o", "--output"], help="PNG file [NAME.png].")] = None,
    size_: Annotated[str, Parameter(name="--size", help="WIDTHxHEIGHT in pixels.")] = "1600x1200",
    quiet: Quiet = False,
) -> int:
    """Draw a preset before it is cut: a picture in a few seconds.

    Parameters
    ----------
    preset
        Name of a shipped preset (see `dsfab presets`) or a TOML file.
    """
    from dsfab.app.gl import require_rendering
    from dsfab.app.previewer import Previewer
    from dsfab.pipeline import draft

    given, pixels = asking(read_preset(preset, set_, mesh, unit), show), picture_size(size_)
    path = output if output is not None else Path(f"{given.name}.png")
    if path.suffix.lower() != ".png":
        raise DsfabError(f"-o {path} does not end in .png; previews are PNG files")
    require_rendering()
    reporter = Reporter(quiet)
    try:
        made = draft(given, reporter)
        reporter("preview", f"drawing {path.name}")
        with Previewer(made, view=view, show=show) as previewer:
            previewer.write(path, pixels)
        reporter.done()
    finally:
        reporter.stop()
    if not quiet:
        for note in made.notes:
            out(f"note ({note.stage}): {note.text}")
        out(f"  {path}  {size(path.stat().st_size)}")
    return 0


def explore(
    preset: str,
    /,
    *,
    vary: Annotated[
        tuple[str, ...],
        Parameter(negative=(), help="KEY=LOW:HIGH:COUNT or KEY=ONE,TWO,... (repeatable: all combinations)."),
    ],
    set_: Set = (),
    mesh: Mesh = None,
    unit: Unit = None,
    view: View = "iso",
    show: Show = "structure",
    output: Annotated[
        Path | None, Parameter(name=["-o", "--output"], help="Folder for the files [outputs/NAME-explore].")
    ] = None,
    size_: Annotated[str, Parameter(name="--size", help="WIDTHxHEIGHT of each picture in pixels.")] = "800x600",
    yes: Annotated[bool, Parameter(negative=(), help=f"Draw more than {ASKS} variants.")] = False,
    quiet: Quiet = False,
) -> int:
    """Draw variants of a preset side by side: a contact sheet, and a page with the command that builds each.

    Parameters
    ----------
    preset
        Name of a shipped preset (see `dsfab presets`) or a TOML file.
    """
    from dsfab.app.contact import PAGE_NAME, SHEET_NAME, pictures_of
    from dsfab.app.gl import require_rendering
    from dsfab.app.palette import PAPER

    given, pixels, values = asking(read_preset(preset, set_, mesh, unit), show), picture_size(size_), varied(vary)
    for key, listed in values.items():
        for value in listed:  # each alone: what is wrong with a value is said before anything is made
            overridden(given, {key: value})
    folder = output if output is not None else Path("outputs") / f"{given.name}-explore"
    require_rendering()
    reporter = Reporter(quiet)
    base = _base_command(preset, set_, mesh, unit)
    try:
        with whole_or_nothing(folder) as partial:
            drawn = _Drawing(given, values, base, view, show, pixels).tiles(reporter, yes)
            _write(drawn, given, values, partial, pixels, PAPER)
            stale = pictures_of(folder) - pictures_of(partial)
        for name in stale:
            (folder / name).unlink(missing_ok=True)
        reporter.done()
    finally:
        reporter.stop()
    if not quiet:
        failed = sum(tile.picture is None for tile in drawn)
        out(f"{len(drawn)} variants" + (f", {failed} of them impossible" if failed else ""))
        out(f"  {folder / PAGE_NAME}\n  {folder / SHEET_NAME}")
    return 0


def picture_size(text: str) -> tuple[int, int]:
    """'1600x1200' as (1600, 1200); raises DsfabError for anything else."""
    words = text.lower().split("x")
    if len(words) == 2 and all(word.isdigit() for word in words):
        width, height = int(words[0]), int(words[1])
        if all(SMALLEST <= side <= LARGEST for side in (width, height)):
            return width, height
    raise DsfabError(
        f"--size {text!r} is not WIDTHxHEIGHT, sides of {SMALLEST} to {LARGEST} pixels; write for instance 1600x1200"
    )


class _Drawing:
    """The variants of a preset, drawn in the order in which most can be reused."""

    def __init__(
        self, preset: "Preset", values: Values, base: list[str], view: str, show: str, pixels: tuple[int, int]
    ) -> None:
        self.preset, self.values, self.base = preset, values, base
        self.view, self.show, self.pixels = view, show, pixels
        self.short = short_names(list(values))
        self.made: Draft | None = None
        self.previewer: Previewer | None = None

    def tiles(self, reporter: Reporter, yes: bool) -> "list[Tile]":
        """All tiles, in the order of the combinations. Raises DsfabError when there is none with a picture."""
        total = count(self.values)
        if total > ASKS and not yes:
            self._refuse(total, reporter)
        done: dict[int, Tile] = {}
        listed = list(combinations(self.values))
        reporter("preview", f"drawing {total} variants")
        with ExitStack() as stack:
            for index in best_order(self.values):
                done[index] = self._tile(index + 1, listed[index], stack)
        if all(tile.picture is None for tile in done.values()):
            raise DsfabError(f"none of the {total} variants can be drawn; the first: {done[0].error}")
        return [done[index] for index in range(total)]

    def _tile(self, number: int, changes: Mapping[str, Any], stack: ExitStack) -> "Tile":
        from dsfab.app import light
        from dsfab.app.contact import Tile

        texts = {key: spelled(value) for key, value in changes.items()}
        sets = [f"{key}={text}" for key, text in texts.items()]
        words = [*self.base, *(word for text in sets for word in ("--set", text))]
        command = shlex.join([*words, "-o", f"outputs/{self.preset.name}-{number:03}"])
        parameters = tuple((self.short[key], text) for key, text in texts.items())
        try:
            previewer = self._showing(overridden(self.preset, changes), stack)
            picture = previewer.picture(self.pixels, quality=light.QUICK, words=False)
        except DsfabError as error:
            return Tile(number, parameters, command, None, str(error))
        return Tile(number, parameters, command, picture)

    def _showing(self, preset: "Preset", stack: ExitStack) -> "Previewer":
        """A previewer of this preset: the one there is, unless the surface is another."""
        from dsfab.app.previewer import Previewer
        from dsfab.pipeline import draft

        if self.previewer and self.previewer.can_display(preset):
            self.previewer.display(preset)
            return self.previewer
        self.made = draft(preset, old=self.made)
        stack.close()
        self.previewer = None
        self.previewer = stack.enter_context(
            Previewer(self.made, view=self.view, show=self.show, marks=self.show == "loads")
        )
        return self.previewer

    def _refuse(self, total: int, reporter: Reporter) -> None:
        """Draw the first variant that can be drawn alone, to say how long all would take."""
        reporter("preview", f"trying one of {total:,} variants")
        with ExitStack() as stack:
            for number, changes in enumerate(combinations(self.values), start=1):
                tile = self._tile(number, changes, stack)
                if tile.picture is not None or number == ASKS:
                    break
            start = time.perf_counter()
            self._tile(number, changes, stack)
            picture = time.perf_counter() - start
        rows = self.made.seconds if self.made else {}
        from dsfab.pipeline import ROWS

        stages = {stage: sum(rows.get(row, 0.0) for row in ROWS[stage]) for stage in ROWS}
        expected = expected_seconds(self.values, stages, picture)
        files = size(total * picture_bytes(self.pixels))
        raise DsfabError(
            f"{total:,} variants would take about {_duration(expected)} and {files} of pictures; "
            f"add --yes to draw them all, or vary less (up to {ASKS} are drawn without asking)"
        )


def picture_bytes(pixels: tuple[int, int]) -> float:
    """About the size of a picture's file: half a byte per pixel (measured on the presets)."""
    return 0.5 * pixels[0] * pixels[1]


def _duration(seconds: float) -> str:
    if seconds < 100:
        return f"{seconds:.0f} seconds"
    return f"{seconds / 60:.0f} minutes" if seconds < 6000 else f"{seconds / 3600:.1f} hours"


def _base_command(preset: str, changes: tuple[str, ...], mesh: Path | None, unit: str | None) -> list[str]:
    words = ["dsfab", "build", preset]
    words += [word for text in changes for word in ("--set", text)]
    words += ["--mesh", str(mesh)] if mesh is not None else []
    return words + (["--unit", unit] if unit is not None else [])


def _write(
    tiles: "list[Tile]", preset: "Preset", values: Values, folder: Path, pixels: tuple[int, int], palette: Any
) -> None:
    from dsfab.app.contact import PAGE_NAME, SHEET_NAME, columns, contact_sheet, page, save

    across = columns(len(tiles), [len(listed) for listed in values.values() if len(listed) > 1])
    title = f"{preset.name}, {len(tiles)} {'variant' if len(tiles) == 1 else 'variants'}"
    line = "   ·   ".join(f"{key} = {', '.join(map(spelled, listed))}" for key, listed in values.items())
    contact_sheet(tiles, title, line, across, SHOWN_WIDE, pixels[0] / pixels[1], palette).save(folder / SHEET_NAME)
    (folder / PAGE_NAME).write_text(page(tiles, title, line, across, palette), encoding="utf-8")
    save(tiles, folder)
