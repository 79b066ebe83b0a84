"""One previewer after another: the one there is draws the next preset if it can, and what was solved is kept."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Self

from dsfab.pipeline import Progress
from dsfab.pipeline.design import Design
from dsfab.preset import Preset
from dsfab.render.colouring import ANSWERS, MODES

if TYPE_CHECKING:
    from dsfab.render.previewer import Previewer


class Previewers:
    """Previewers for presets that follow one another; use as `with Previewers(view=..., ...) as previewers`.

    sketched : called with a sketch of each design that is not there yet (see `Design.sketch`).
    options  : those of `Previewer`, for all of them.
    """

    def __init__(self, sketched: Callable[[Design], None] | None = None, **options: Any) -> None:
        self._sketched, self._options = sketched, options
        self._previewer: Previewer | None = None
        self.made: Design | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Give the window back."""
        if self._previewer:
            self._previewer.close()
        self._previewer = None

    def showing(self, preset: Preset, progress: Progress | None = None) -> "Previewer":
        """A previewer that shows this preset; raises DsfabError for what cannot be made or drawn."""
        from dsfab.render.previewer import Previewer  # a sketch is drawn elsewhere meanwhile

        if self._previewer and self._previewer.can_display(preset):
            self._previewer.display(preset)
            return self._previewer
        made = self.drafted(preset, progress)
        self.close()
        self._previewer = Previewer(made, **self._options)
        return self._previewer

    def drafted(self, preset: Preset, progress: Progress | None = None) -> Design:
        """What is drawn: with the stages of the last one before the first section that differs."""
        design = Design.of(preset, self.made, progress)
        if self._sketched and not design.has("pattern"):
            show = self._options.get("show")
            sketch = design.sketch(modes=show in MODES, answers=show in ("stress", *ANSWERS))
            if sketch:
                self._sketched(sketch)
        self.made = design.until("pattern")
        return self.made
