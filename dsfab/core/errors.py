"""Error classes of dsfab, and hints for misspelt names."""

import difflib
from collections.abc import Iterable


class DsfabError(Exception):
    """Unusable input. The message has one sentence: the fault, its place, and the remedy.
    `dsfab.app.cli` alone turns this error into a line and an exit code. Any other exception is a bug of dsfab."""


class SurfaceError(DsfabError):
    """A mesh, a shape, a support or a load that cannot be used."""


class StaticsError(DsfabError):
    """A sheet that cannot carry its loads: a mechanism, a piece without support, a failed solve."""


class PatternError(DsfabError):
    """A pattern that leaves nothing to build, or an impossible stripe."""


class SolidError(DsfabError):
    """A sheet that could not be thickened to a closed solid."""


class ExportError(DsfabError):
    """A file that could not be written, or whose content differs from the design when dsfab reads it again."""


class NotMadeError(ExportError):
    """A requested result that dsfab did not make, for instance because a file would be larger than allowed."""


class PresetError(DsfabError):
    """A preset with unknown keys, wrong types or impossible values."""


def did_you_mean(word: str, choices: Iterable[str]) -> str:
    """Return '; did you mean dome?' with the choice nearest to `word` (the first of equally near choices), or ''."""
    names = list(choices)
    matches = difflib.get_close_matches(word, names)
    ratios = [difflib.SequenceMatcher(None, name, word).ratio() for name in matches]
    nearest = min(
        (name for name, ratio in zip(matches, ratios, strict=True) if ratio == max(ratios)), key=names.index, default=""
    )
    return f"; did you mean {nearest}?" if nearest else ""
