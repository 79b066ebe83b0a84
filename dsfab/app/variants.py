"""The variants of a preset as tiles of a contact sheet, drawn in the order in which most can be reused."""

import shlex
import time
from collections.abc import Mapping
from typing import Any

from dsfab.app.terminal import Reporter
from dsfab.errors import DsfabError
from dsfab.pipeline import ROWS
from dsfab.preset import Preset
from dsfab.preset_file import overridden
from dsfab.render import light
from dsfab.render.png import png
from dsfab.render.previewers import Previewers
from dsfab.report.contact_sheet import Tile
from dsfab.study.variations import Values, best_order, combinations, count, expected_seconds, short_names, spelled_value
from dsfab.wording import size

ASKS = 200
"""More variants than this are drawn only after --yes."""


class Variants:
    """Every combination of `values` of a preset; `base` is the command that builds the preset itself."""

    def __init__(
        self, preset: Preset, values: Values, base: list[str], view: str, show: str, pixels: tuple[int, int]
    ) -> None:
        self.preset, self.values, self.base = preset, values, base
        self.view, self.show, self.pixels = view, show, pixels
        self.short = short_names(list(values))

    def tiles(self, reporter: Reporter, yes: bool) -> list[Tile]:
        """All tiles, in the order of the combinations. Raises DsfabError when there is none with a picture."""
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
        """Draw the first variant that can be drawn alone, to say how long all would take."""
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
    """About the size of a picture's file: half a byte per pixel (measured on the presets)."""
    return 0.5 * pixels[0] * pixels[1]


def _duration(seconds: float) -> str:
    if seconds < 100:
        return f"{seconds:.0f} seconds"
    return f"{seconds / 60:.0f} minutes" if seconds < 6000 else f"{seconds / 3600:.1f} hours"
