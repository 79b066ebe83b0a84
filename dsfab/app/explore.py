"""The command `dsfab explore`: many variants of a design on a contact sheet or in a film."""

import shlex
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from dsfab.app.options import UNCHANGED, Quiet, Show, Source, View, picture_size
from dsfab.app.terminal import Reporter, out
from dsfab.core.errors import DsfabError
from dsfab.core.messages import size
from dsfab.design import ROWS
from dsfab.export import whole_or_nothing
from dsfab.preset.file import overridden
from dsfab.preset.model import Preset
from dsfab.render import light
from dsfab.render.colouring import asking
from dsfab.render.lettering import PAPER
from dsfab.render.picture import png
from dsfab.render.previewer import Previewers
from dsfab.report.contact_sheet import Tile
from dsfab.study.variations import (
    Values,
    best_order,
    combinations,
    count,
    expected_seconds,
    parse_variations,
    short_names,
    spelled_value,
)

ASKS = 200
"""Variants that are drawn without --yes."""


class Variants:
    """Every combination of `values` of a preset; `base` is the command that builds the preset itself."""

    def __init__(
        self, preset: Preset, values: Values, base: list[str], view: str, show: str, pixels: tuple[int, int]
    ) -> None:
        self.preset, self.values, self.base = preset, values, base
        self.view, self.show, self.pixels = view, show, pixels
        self.short = short_names(list(values))

    def tiles(self, reporter: Reporter, yes: bool) -> list[Tile]:
        """Return all tiles, in the order of the combinations. Raises DsfabError if none has a picture."""
        total = count(self.values)
        if total > ASKS and not yes:
            self._refuse(total, reporter)
        done: dict[int, Tile] = {}
        listed = list(combinations(self.values))
        reporter("preview", f"drawing {total} variants")
        with self._previewers() as previewers:
            for index in best_order(self.values):
                done[index] = self._tile(index + 1, listed[index], previewers)
        if all(tile.png is None for tile in done.values()):
            raise DsfabError(f"none of the {total} variants can be drawn; the first: {done[0].error}")
        return [done[index] for index in range(total)]

    def _previewers(self) -> Previewers:
        return Previewers(view=self.view, show=self.show, marks=self.show == "loads")

    def _tile(self, number: int, changes: Mapping[str, Any], previewers: Previewers) -> Tile:
        texts = {key: spelled_value(value) for key, value in changes.items()}
        sets = [f"{key}={text}" for key, text in texts.items()]
        words = [*self.base, *(word for text in sets for word in ("--set", text))]
        command = shlex.join([*words, "-o", f"outputs/{self.preset.name}-{number:03}"])
        parameters = tuple((self.short[key], text) for key, text in texts.items())
        try:
            previewer = previewers.showing(overridden(self.preset, changes))
            picture = previewer.picture(self.pixels, quality=light.QUICK, words=False)
        except DsfabError as error:
            return Tile(number, parameters, command, None, str(error))
        return Tile(number, parameters, command, png(picture))

    def _refuse(self, total: int, reporter: Reporter) -> None:
        """Raise DsfabError with the expected time, measured on the first variant that can be drawn."""
        reporter("preview", f"trying one of {total:,} variants")
        with self._previewers() as previewers:
            for number, changes in enumerate(combinations(self.values), start=1):
                tile = self._tile(number, changes, previewers)
                if tile.png is not None or number == ASKS:
                    break
            start = time.perf_counter()
            self._tile(number, changes, previewers)
            picture = time.perf_counter() - start
            rows = previewers.made.seconds if previewers.made else {}
        stages = {stage: sum(rows.get(row, 0.0) for row in ROWS[stage]) for stage in ROWS}
        expected = expected_seconds(self.values, stages, picture)
        files = size(total * picture_bytes(self.pixels))
        raise DsfabError(
            f"{total:,} variants would take about {_duration(expected)} and {files} of pictures; "
            f"add --yes to draw them all, or vary less (up to {ASKS} are drawn without asking)"
        )


def picture_bytes(pixels: tuple[int, int]) -> float:
    """Return about the size of a picture's file: half a byte per pixel (measured on the presets)."""
    return 0.5 * pixels[0] * pixels[1]


def _duration(seconds: float) -> str:
    if seconds < 100:
        return f"{seconds:.0f} seconds"
    return f"{seconds / 60:.0f} minutes" if seconds < 6000 else f"{seconds / 3600:.1f} hours"


@Parameter(name="*")
@dataclass(frozen=True)
class TileOptions:
    """Options of the pictures, and their folder."""

    view: View = "iso"
    show: Show = "structure"
    output: Annotated[
        Path | None, Parameter(name=["-o", "--output"], help="Folder for the files [outputs/NAME-explore].")
    ] = None
    size_: Annotated[str, Parameter(name="--size", help="WIDTHxHEIGHT of each picture in pixels.")] = "800x600"


@Parameter(name="*")
@dataclass(frozen=True)
class FilmOptions:
    """Options of a film over the one key with several values."""

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
        Parameter(negative=(), help="KEY=LOW:HIGH:COUNT or KEY=ONE,TWO,... (repeatable, for all combinations)."),
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
    from dsfab.render.opengl import require_rendering
    from dsfab.report.contact_sheet import check_film

    given, pixels, values = asking(source.read(preset), tile.show), picture_size(tile.size_), parse_variations(vary)
    for key, listed in values.items():
        for value in listed:  # each value alone, so that an error appears before the work begins
            overridden(given, {key: value})
    if film.animate:
        check_film(values, film.fps)
    folder = tile.output or Path("outputs") / f"{given.name}-explore"
    require_rendering()
    reporter = Reporter(quiet)
    variants = Variants(given, values, ["dsfab", "build", *source.words(preset)], tile.view, tile.show, pixels)
    with reporter:
        tiles = _drawn(variants, folder, film, yes, reporter)
    if not quiet:
        _summary(tiles, folder, folder / f"{given.name}.{film.animate}" if film.animate else None)
    return 0


def _drawn(variants: "Variants", folder: Path, film: FilmOptions, yes: bool, reporter: Reporter) -> "list[Tile]":
    """Draw all tiles and write the folder; remove pictures of an earlier sheet that are not in the new one."""
    from dsfab.report.contact_sheet import pictures_of, write_film

    name = variants.preset.name
    with whole_or_nothing(folder, lambda old, new: pictures_of(old) - pictures_of(new)) as partial:
        tiles = variants.tiles(reporter, yes)
        _write(tiles, variants, partial)
        if film.animate:
            reporter("preview", f"making {name}.{film.animate}")
            write_film(tiles, partial / f"{name}.{film.animate}", name, film.fps, PAPER)
    return tiles


def _write(tiles: "list[Tile]", variants: "Variants", folder: Path) -> None:
    from dsfab.report.contact_sheet import PAGE_NAME, SHEET_NAME, columns, contact_sheet, page, save

    values, pixels = variants.values, variants.pixels
    across = columns(len(tiles), [len(listed) for listed in values.values() if len(listed) > 1])
    title = f"{variants.preset.name}, {len(tiles)} {'variant' if len(tiles) == 1 else 'variants'}"
    line = "   ·   ".join(f"{key} = {', '.join(map(spelled_value, listed))}" for key, listed in values.items())
    contact_sheet(tiles, title, line, across, 380, pixels[0] / pixels[1], PAPER).save(folder / SHEET_NAME)
    (folder / PAGE_NAME).write_text(page(tiles, title, line, across), encoding="utf-8")
    save(tiles, folder)


def _summary(tiles: "list[Tile]", folder: Path, film: Path | None) -> None:
    from dsfab.report.contact_sheet import PAGE_NAME, SHEET_NAME

    failed = sum(tile.png is None for tile in tiles)
    out(f"{len(tiles)} variants" + (f", {failed} of them impossible" if failed else ""))
    out(f"  {folder / PAGE_NAME}\n  {folder / SHEET_NAME}")
    if film:
        out(f"  {film}  {size(film.stat().st_size)}")
