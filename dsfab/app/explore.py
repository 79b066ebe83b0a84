"""`dsfab explore`: many designs seen side by side, or one after another, before anything is cut."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from dsfab.app.options import UNCHANGED, Quiet, Show, Source, View, picture_size
from dsfab.app.terminal import Reporter, out
from dsfab.export import whole_or_nothing
from dsfab.preset_file import overridden
from dsfab.render.answers import asking
from dsfab.render.palette import PAPER
from dsfab.study.variations import parse_variations, spelled_value
from dsfab.wording import size

if TYPE_CHECKING:
    from dsfab.app.variants import Variants
    from dsfab.report.contact_sheet import Tile

SHOWN_WIDE = 380
"""Pixels across a tile of the contact sheet."""


@Parameter(name="*")
@dataclass(frozen=True)
class TileOptions:
    """How each variant is drawn, and where the pictures go."""

    view: View = "iso"
    show: Show = "structure"
    output: Annotated[
        Path | None, Parameter(name=["-o", "--output"], help="Folder for the files [outputs/NAME-explore].")
    ] = None
    size_: Annotated[str, Parameter(name="--size", help="WIDTHxHEIGHT of each picture in pixels.")] = "800x600"


@Parameter(name="*")
@dataclass(frozen=True)
class FilmOptions:
    """The film over the one key that is varied."""

    animate: Annotated[
        Literal["gif", "webp"] | None, Parameter(help="Also make a film over the one key that is varied: gif or webp.")
    ] = None
    fps: Annotated[float, Parameter(help="Pictures a second of the film.")] = 8.0


def explore(
    preset: str,
    /,
    *,
    vary: Annotated[
        tuple[str, ...],
        Parameter(negative=(), help="KEY=LOW:HIGH:COUNT or KEY=ONE,TWO,... (repeatable: all combinations)."),
    ],
    source: Source = UNCHANGED,
    tile: TileOptions = TileOptions(),
    film: FilmOptions = FilmOptions(),
    yes: Annotated[bool, Parameter(negative=(), help="Draw more than 200 variants.")] = False,
    quiet: Quiet = False,
) -> int:
    """Draw variants of a preset side by side: a contact sheet, and a page with the command that builds each.

    With --animate also a film of them, forth and back.

    Parameters
    ----------
    preset
        Name of a shipped preset (see `dsfab presets`), a TOML file, or a folder that `dsfab build` wrote.
    """
    from dsfab.app.variants import Variants
    from dsfab.render.opengl import require_rendering
    from dsfab.report.film import check_film

    given, pixels, values = asking(source.read(preset), tile.show), picture_size(tile.size_), parse_variations(vary)
    for key, listed in values.items():
        for value in listed:  # each alone: what is wrong with a value is said before anything is made
            overridden(given, {key: value})
    if film.animate:
        check_film(values, film.fps)
    folder = tile.output or Path("outputs") / f"{given.name}-explore"
    require_rendering()
    reporter = Reporter(quiet)
    variants = Variants(given, values, ["dsfab", "build", *source.words(preset)], tile.view, tile.show, pixels)
    try:
        tiles = _drawn(variants, folder, film, yes, reporter)
        reporter.done()
    finally:
        reporter.stop()
    if not quiet:
        _summary(tiles, folder, folder / f"{given.name}.{film.animate}" if film.animate else None)
    return 0


def _drawn(variants: "Variants", folder: Path, film: FilmOptions, yes: bool, reporter: Reporter) -> "list[Tile]":
    """Draw all tiles and write the folder; pictures of an earlier sheet that are gone are removed."""
    from dsfab.report.contact_sheet import pictures_of
    from dsfab.report.film import write_film

    name = variants.preset.name
    with whole_or_nothing(folder, lambda old, new: pictures_of(old) - pictures_of(new)) as partial:
        tiles = variants.tiles(reporter, yes)
        _write(tiles, variants, partial)
        if film.animate:
            reporter("preview", f"making {name}.{film.animate}")
            write_film(tiles, partial / f"{name}.{film.animate}", name, film.fps, PAPER)
    return tiles


def _write(tiles: "list[Tile]", variants: "Variants", folder: Path) -> None:
    """The contact sheet, the page and the pictures of the tiles."""
    from dsfab.report.contact_sheet import PAGE_NAME, SHEET_NAME, columns, contact_sheet, page, save

    values, pixels = variants.values, variants.pixels
    across = columns(len(tiles), [len(listed) for listed in values.values() if len(listed) > 1])
    title = f"{variants.preset.name}, {len(tiles)} {'variant' if len(tiles) == 1 else 'variants'}"
    line = "   ·   ".join(f"{key} = {', '.join(map(spelled_value, listed))}" for key, listed in values.items())
    contact_sheet(tiles, title, line, across, SHOWN_WIDE, pixels[0] / pixels[1], PAPER).save(folder / SHEET_NAME)
    (folder / PAGE_NAME).write_text(page(tiles, title, line, across), encoding="utf-8")
    save(tiles, folder)


def _summary(tiles: "list[Tile]", folder: Path, film: Path | None) -> None:
    from dsfab.report.contact_sheet import PAGE_NAME, SHEET_NAME

    failed = sum(tile.png is None for tile in tiles)
    out(f"{len(tiles)} variants" + (f", {failed} of them impossible" if failed else ""))
    out(f"  {folder / PAGE_NAME}\n  {folder / SHEET_NAME}")
    if film:
        out(f"  {film}  {size(film.stat().st_size)}")
