"""What the page may ask of a session, by name and read with care, whether HTTP carries it or a notebook's messages."""

from collections.abc import Callable, Mapping
from typing import Any

from dsfab.app.editor.session import Session
from dsfab.errors import DsfabError

SMALLEST, WIDEST = 64, 2400
"""Pixels of the sides of a picture that the page may ask for."""

Given = Mapping[str, Any]


class AskError(DsfabError):
    """A question that no page of ours asks: something is missing in it, or of another type."""


def _typed(given: Given, name: str, kind: type) -> Any:
    value = given.get(name)
    if not isinstance(value, kind):
        raise AskError(f"{name} is missing or of another type")
    return value


def _changes(given: Given) -> Given:
    changes: Given = _typed(given, "changes", dict)
    return changes


def _build(session: Session, given: Given) -> Given:
    return session.ask_build(_changes(given), bool(given.get("replace", False)))


def _picture(session: Session, given: Given) -> Given:
    size = _typed(given, "size", list)
    if len(size) != 2 or not all(isinstance(x, int) and SMALLEST <= x <= WIDEST for x in size):
        raise AskError(f"size is two numbers of pixels from {SMALLEST} to {WIDEST}")
    show, view = _typed(given, "show", str), _typed(given, "view", str)
    return {"job": session.ask_picture(_changes(given), view, show, (size[0], size[1]))}


def _open(session: Session, given: Given) -> Given:
    if "preset" in given:
        return session.open_preset(_typed(given, "preset", str))
    if "toml" in given:
        return session.open_toml(_typed(given, "toml", str))
    unit = given.get("unit")
    return session.open_mesh(_typed(given, "name", str), str(unit) if unit else None, _typed(given, "data", str))


ASKS: dict[str, Callable[[Session, Given], Given]] = {
    "solve": lambda session, given: {"job": session.ask_solve(_changes(given))},
    "build": _build,
    "picture": _picture,
    "preset": lambda session, given: session.preset_file(_changes(given)),
    "command": lambda session, given: session.command(_changes(given)),
    "open": _open,
    "cancel": lambda session, given: {"stopped": session.jobs.cancel(_typed(given, "job", int))},
}
"""Each raises DsfabError with a sentence for the person; the answers are ready for JSON."""
