"""The command `dsfab explore`: pictures of many variants of a design."""

import shlex
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from dsfab.app.options import UNCHANGED, OutputName, Quiet, Show, Source, Switch, View, picture_size
from dsfab.app.terminal import Reporter, print_result
from dsfab.core.errors import DsfabError
from dsfab.core.messages import byte_size
from dsfab.design import ROWS
from dsfab.export import atomic_folder
from dsfab.preset.file import with_overrides
from dsfab.preset.model import Preset
from dsfab.render import light
from dsfab.render.colouring import preset_with_mode
from dsfab.render.lettering import PAPER
from dsfab.render.picture import png_bytes
from dsfab.render.previewer import Previewers
from dsfab.report import contact_sheet as sheets
from dsfab.report.contact_sheet import PAGE_NAME, SHEET_NAME, ContactTile
from dsfab.study.variations import (
    Values,
    combinations,
    count,
    expected_seconds,
    parse_variations,
    short_names,
    spelled_value,
    stage_order,
)

UNCONFIRMED_VARIANTS = 200  # Largest number of variants without --yes.


class Variants:
    """Variants of a preset: a variant for each combination of `values`, which are lists of values by key."""

    def __init__(
        self, preset: Preset, values: Values, base: list[str], view: str, show: str, pixels: tuple[int, int]
    ) -> None:
        self.preset, self.values, self.base = preset, values, base
        self.view, self.show, self.pixels = view, show, pixels
        self.short = short_names(list(values))

    def tiles(self, reporter: Reporter, yes: bool) -> list[ContactTile]:
        """Draw each variant; return the pictures in the order of the variants.
        Raises DsfabError if no variant can be drawn, or if there are too many variants and `yes` is false."""
        total = count(self.values)
        if total > UNCONFIRMED_VARIANTS and not yes:
            self._refuse_many(total, reporter)
        tile_by_index: dict[int, ContactTile] = {}
        listed = list(combinations(self.values))
        reporter("preview", f"drawing {total} variants")
        with self._previewers() as previewers:
            for index in stage_order(listed):
                tile_by_index[index] = self._tile(index + 1, listed[index], previewers)
        if all(tile.png is None for tile in tile_by_index.values()):
            raise DsfabError(
                f"none of the {total} variants can be drawn; the reason for the first variant: {tile_by_index[0].error}"
            )
        return [tile_by_index[index] for index in range(total)]

    def _previewers(self) -> Previewers:
        return Previewers(view=self.view, show=self.show, marks=self.show == "loads")

    def _tile(self, number: int, changes: Mapping[str, Any], previewers: Previewers) -> ContactTile:
        texts = {key: spelled_value(value) for key, value in changes.items()}
        sets = [f"{key}={text}" for key, text in texts.items()]
        words = [*self.base, *(word for text in sets for word in ("--set", text))]
        command = shlex.join([*words, "-o", f"outputs/{self.preset.name}-{number:03}"])
        parameters = tuple((self.short[key], text) for key, text in texts.items())
        try:
            previewer = previewers.previewer_for(with_overrides(self.preset, changes))
            picture = previewer.picture(self.pixels, quality=light.QUICK, words=False)
        except DsfabError as error:
            return ContactTile(number, parameters, command, None, str(error))
        return ContactTile(number, parameters, command, png_bytes(picture))

    def _refuse_many(self, total: int, reporter: Reporter) -> None:
        reporter("preview", f"trying one of {total:,} variants")
        with self._previewers() as previewers:
            for number, changes in enumerate(combinations(self.values), start=1):
                if self._tile(number, changes, previewers).png is not None or number == UNCONFIRMED_VARIANTS:
                    break
            start = time.perf_counter()
            self._tile(number, changes, previewers)
            picture = time.perf_counter() - start
            rows = previewers.design.seconds if previewers.design else {}
        stages = {stage: sum(rows.get(row, 0.0) for row in ROWS[stage]) for stage in ROWS}
        expected = expected_seconds(self.values, stages, picture)
        files = byte_size(total * 0.5 * self.pixels[0] * self.pixels[1])  # a pixel takes half a byte in a PNG file
        raise DsfabError(
            f"{total:,} variants would take about {_duration_words(expected)} and {files} of pictures; "
            f"add --yes to draw them all, or vary less (up to {UNCONFIRMED_VARIANTS} are drawn without asking)"
        )


def _duration_words(seconds: float) -> str:
    if seconds < 100:
        return f"{seconds:.0f} seconds"
    return f"{seconds / 60:.0f} minutes" if seconds < 6000 else f"{seconds / 3600:.1f} hours"


@Parameter(name="*")
@dataclass(frozen=True)
class TileOptions:
    """Options of the pictures, and the folder for them."""

    view: View = "iso"
    show: Show = "structure"
    output: Annotated[Path | None, OutputName(help="Folder for the files [outputs/NAME-explore].")] = None
    size_: Annotated[str, Parameter(name="--size", help="WIDTHxHEIGHT of each picture in pixels.")] = "800x600"


@Parameter(name="*")
@dataclass(frozen=True)
class FilmOptions:
    """Options of a film."""

    animate: Annotated[
        Literal["gif", "webp"] | None,
        Parameter(help="Also make a film of the variants, if only one key is varied: gif or webp."),
    ] = None
    fps: Annotated[float, Parameter(help="Frames per second of the film.")] = 8.0


def explore(
    preset: str,
    /,
    *,
    vary: Annotated[
        tuple[str, ...],
        Parameter(
            negative=(),
            help="Values of a key: KEY=LOW:HIGH:COUNT or KEY=ONE,TWO,... (repeatable; then dsfab "
            "draws all combinations).",
        ),
    ],
    source: Source = UNCHANGED,
    tile: TileOptions = TileOptions(),
    film: FilmOptions = FilmOptions(),
    yes: Annotated[bool, Switch(help="Draw more than 200 variants.")] = False,
    quiet: Quiet = False,
) -> int:
    """Draw variants of a preset side by side, each with the command that builds it; --animate also makes a film.

    Parameters
    ----------
    preset
        Name of a shipped preset (see `dsfab presets`), a TOML file, or a folder that `dsfab build` wrote."""
    from dsfab.render.opengl import require_rendering

    loaded = preset_with_mode(source.read_preset(preset, thickness="guessed"), tile.show)
    pixels, values = picture_size(tile.size_), parse_variations(vary)
    for key, listed in values.items():
        for value in listed:  # an invalid value raises its error before the work begins
            with_overrides(loaded, {key: value})
    if film.animate:
        sheets.check_film(values, film.fps)
    folder = tile.output or Path("outputs") / f"{loaded.name}-explore"
    require_rendering()
    reporter = Reporter(quiet)
    variants = Variants(loaded, values, ["dsfab", "build", *source.command_words(preset)], tile.view, tile.show, pixels)
    with reporter:
        tiles = _draw_variants(variants, folder, film, yes, reporter)
    if not quiet:
        _summary(tiles, folder, folder / f"{loaded.name}.{film.animate}" if film.animate else None)
    return 0


def _draw_variants(
    variants: "Variants", folder: Path, film: FilmOptions, yes: bool, reporter: Reporter
) -> "list[ContactTile]":
    name = variants.preset.name
    pictures = sheets.pictures_on_page
    with atomic_folder(folder, lambda old, new: pictures(old) - pictures(new)) as partial:
        tiles = variants.tiles(reporter, yes)
        _write(tiles, variants, partial)
        if film.animate:
            reporter("preview", f"making {name}.{film.animate}")
            sheets.write_film(tiles, partial / f"{name}.{film.animate}", name, film.fps, PAPER)
    return tiles


def _write(tiles: "list[ContactTile]", variants: "Variants", folder: Path) -> None:
    values, pixels = variants.values, variants.pixels
    columns = sheets.column_count(len(tiles), [len(listed) for listed in values.values() if len(listed) > 1])
    title = f"{variants.preset.name}, {len(tiles)} {'variant' if len(tiles) == 1 else 'variants'}"
    subtitle = "   ·   ".join(f"{key} = {', '.join(map(spelled_value, listed))}" for key, listed in values.items())
    sheet = sheets.contact_sheet(tiles, title, subtitle, columns, 380, pixels[0] / pixels[1], PAPER)
    sheet.save(folder / SHEET_NAME)
    (folder / PAGE_NAME).write_text(sheets.contact_page(tiles, title, subtitle, columns), encoding="utf-8")
    sheets.save(tiles, folder)


def _summary(tiles: "list[ContactTile]", folder: Path, film: Path | None) -> None:
    failed = sum(tile.png is None for tile in tiles)
    print_result(f"{len(tiles)} variants" + (f", {failed} of them impossible" if failed else ""))
    print_result(f"  {folder / PAGE_NAME}\n  {folder / SHEET_NAME}")
    if film:
        print_result(f"  {film}  {byte_size(film.stat().st_size)}")
