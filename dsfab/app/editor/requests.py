"""What the page may ask of a session, by name and read with care, whether HTTP carries it or a notebook's messages."""

from collections.abc import Callable, Mapping
from typing import Any

from dsfab.app.editor.session import Session
from dsfab.app.editor.tray import KeptVariant, differences
from dsfab.app.export import offered_formats
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


def _export(session: Session, given: Given) -> Given:
    return session.ask_build(_changes(given), bool(given.get("replace", False)), _typed(given, "format", str))


def _picture(session: Session, given: Given) -> Given:
    size = _typed(given, "size", list)
    if len(size) != 2 or not all(isinstance(x, int) and SMALLEST <= x <= WIDEST for x in size):
        raise AskError(f"size is two numbers of pixels from {SMALLEST} to {WIDEST}")
    show, view = _typed(given, "show", str), _typed(given, "view", str)
    return {"job": session.ask_picture(_changes(given), view, show, (size[0], size[1]))}


def _keep(session: Session, given: Given) -> Given:
    name, picture, figures = _typed(given, "name", str), _typed(given, "picture", str), _typed(given, "figures", dict)
    session.variants.keep(KeptVariant(name, session.opened, _changes(given), picture, figures))
    return {"variants": session.variants.listed()}


def _rename(session: Session, given: Given) -> Given:
    session.variants.rename(_typed(given, "variant", int), _typed(given, "name", str))
    return {"variants": session.variants.listed()}


def _drop(session: Session, given: Given) -> Given:
    session.variants.drop(_typed(given, "variant", int))
    return {"variants": session.variants.listed()}


def _compare(session: Session, given: Given) -> Given:
    """Two variants, or one and what is shown now."""
    numbers = _typed(given, "variants", list)
    if len(numbers) not in (1, 2) or not all(isinstance(number, int) for number in numbers):
        raise AskError("variants are one or two numbers")
    presets = [session.variants[number].preset for number in numbers]
    one, other = (*presets, session.opened.changed(_changes(given)))[:2]
    return {"differences": differences(one, other)}


def _open(session: Session, given: Given) -> Given:
    if "preset" in given:
        return session.open_preset(_typed(given, "preset", str))
    if "toml" in given:
        return session.open_toml(_typed(given, "toml", str))
    if "variant" in given:
        return session.open_variant(_typed(given, "variant", int))
    unit = given.get("unit")
    return session.ask_mesh(_typed(given, "name", str), str(unit) if unit else None, _typed(given, "data", str))


ASKS: dict[str, Callable[[Session, Given], Given]] = {
    "solve": lambda session, given: {"job": session.ask_solve(_changes(given))},
    "build": _build,
    "export": _export,
    "formats": lambda session, given: {"formats": offered_formats()},
    "picture": _picture,
    "members": lambda session, given: {"job": session.ask_members(bool(given.get("judged", False)))},
    "preset": lambda session, given: session.preset_file(_changes(given)),
    "command": lambda session, given: session.command(_changes(given)),
    "open": _open,
    "keep": _keep,
    "rename": _rename,
    "drop": _drop,
    "compare": _compare,
    "cancel": lambda session, given: {"stopped": session.jobs.cancel(_typed(given, "job", int))},
}
"""Each raises DsfabError with a sentence for the person; the answers are ready for JSON."""
