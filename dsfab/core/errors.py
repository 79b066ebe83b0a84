"""The one family of errors a user may meet, and the nearest name for a misspelt one."""

import difflib
from collections.abc import Iterable


class DsfabError(Exception):
    """Input that cannot be used, told in one sentence: what is wrong, where, and what to do.

    The library raises it and never prints; ``dsfab.app.cli`` alone turns it into a line and exit code 1.
    Anything else that escapes the library is a mistake of ours.
    """


class SurfaceError(DsfabError):
    """A mesh, a shape, a support or a load that cannot be used."""


class StaticsError(DsfabError):
    """A sheet that cannot carry its loads: a mechanism, a piece without support, a failed solve."""


class PatternError(DsfabError):
    """A pattern that leaves nothing to build, or an impossible stripe."""


class SolidError(DsfabError):
    """A sheet that could not be thickened to a closed solid."""


class ExportError(DsfabError):
    """A file that could not be written, or that did not read back as what was written."""


class PresetError(DsfabError):
    """A preset with unknown keys, wrong types or impossible values."""


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """'; did you mean dome?' for the nearest known word, the first of equally near ones, or nothing."""
    names = list(known)
    close = difflib.get_close_matches(word, names)
    like = [difflib.SequenceMatcher(None, name, word).ratio() for name in close]
    nearest = min((name for name, x in zip(close, like, strict=True) if x == max(like)), key=names.index, default="")
    return f"; did you mean {nearest}?" if nearest else ""
