"""`dsfab explore`: many designs seen side by side, or one after another, before anything is cut."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from dsfab.app.options import Mesh, Quiet, Set, Show, Unit, View, picture_size, read_preset
from dsfab.app.terminal import Reporter, out
from dsfab.export.folder import whole_or_nothing
from dsfab.preset_file import overridden
from dsfab.render.answers import asking
from dsfab.study.variations import Values, spelled, varied
from dsfab.wording import size

if TYPE_CHECKING:
    from dsfab.preset import Preset
    from dsfab.report.contact_sheet import Tile

SHOWN_WIDE = 380
"""Pixels across a tile of the contact sheet."""


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
    animate: Annotated[
        Literal["gif", "webp"] | None, Parameter(help="Also make a film over the one key that is varied: gif or webp.")
    ] = None,
    fps: Annotated[float, Parameter(help="Pictures a second of the film.")] = 8.0,
    yes: Annotated[bool, Parameter(negative=(), help="Draw more than 200 variants.")] = False,
    quiet: Quiet = False,
) -> int:
    """Draw variants of a preset side by side: a contact sheet, and a page with the command that builds each.

    With --animate also a film of them, forth and back.

    Parameters
    ----------
    preset
        Name of a shipped preset (see `dsfab presets`) or a TOML file.
    """
    from dsfab.app.variants import Variants, base_command
    from dsfab.render.opengl import require_rendering
    from dsfab.render.palette import PAPER
    from dsfab.report.contact_sheet import PAGE_NAME, SHEET_NAME, pictures_of
    from dsfab.report.film import check_film, write_film

    given, pixels, values = asking(read_preset(preset, set_, mesh, unit), show), picture_size(size_), varied(vary)
    for key, listed in values.items():
        for value in listed:  # each alone: what is wrong with a value is said before anything is made
            overridden(given, {key: value})
    if animate:
        check_film(values, fps)
    folder = output if output is not None else Path("outputs") / f"{given.name}-explore"
    require_rendering()
    reporter = Reporter(quiet)
    base = base_command(preset, set_, mesh, unit)
    try:
        with whole_or_nothing(folder) as partial:
            drawn = Variants(given, values, base, view, show, pixels).tiles(reporter, yes)
            _write(drawn, given, values, partial, pixels, PAPER)
            if animate:
                reporter("preview", f"making {given.name}.{animate}")
                write_film(drawn, partial / f"{given.name}.{animate}", given.name, fps, PAPER)
            stale = pictures_of(folder) - pictures_of(partial)
        for name in stale:
            (folder / name).unlink(missing_ok=True)
        reporter.done()
    finally:
        reporter.stop()
    if not quiet:
        failed = sum(tile.png is None for tile in drawn)
        out(f"{len(drawn)} variants" + (f", {failed} of them impossible" if failed else ""))
        out(f"  {folder / PAGE_NAME}\n  {folder / SHEET_NAME}")
        if animate:
            film = folder / f"{given.name}.{animate}"
            out(f"  {film}  {size(film.stat().st_size)}")
    return 0


def _write(
    tiles: "list[Tile]", preset: "Preset", values: Values, folder: Path, pixels: tuple[int, int], palette: Any
) -> None:
    from dsfab.report.contact_sheet import PAGE_NAME, SHEET_NAME, columns, contact_sheet, page, save

    across = columns(len(tiles), [len(listed) for listed in values.values() if len(listed) > 1])
    title = f"{preset.name}, {len(tiles)} {'variant' if len(tiles) == 1 else 'variants'}"
    line = "   ·   ".join(f"{key} = {', '.join(map(spelled, listed))}" for key, listed in values.items())
    contact_sheet(tiles, title, line, across, SHOWN_WIDE, pixels[0] / pixels[1], palette).save(folder / SHEET_NAME)
    (folder / PAGE_NAME).write_text(page(tiles, title, line, across, palette), encoding="utf-8")
    save(tiles, folder)
