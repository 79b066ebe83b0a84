"""The static files of the page, and the requests that it may send to a session."""

import base64
import gzip
import json
import re
import secrets
from collections.abc import Callable, Mapping
from importlib.resources import files
from typing import Any

from dsfab.app.editor.session import Session
from dsfab.app.editor.workspace import KeptVariant, differences
from dsfab.app.export import offered_formats
from dsfab.core.errors import DsfabError

KINDS = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}

HTTP, NOTEBOOK, WIDGET = "transport.js", "transport_notebook.js", "widget.js"
"""Modules that connect the page with a server or with a notebook, and the module that opens it in a notebook."""

_FROM = re.compile(r"""(\b(?:from|import)\s*['"])\./((?:vendor/)?[\w.]+['"])""")
"""A relative import of a module of the page."""


def static_files() -> dict[str, bytes]:
    """Return every file of the page by its path in the address."""
    found, folders = {}, [("", files("dsfab.app.editor").joinpath("static"))]
    while folders:
        prefix, folder = folders.pop()
        for entry in folder.iterdir():
            if entry.is_dir():
                folders.append((f"{prefix}{entry.name}/", entry))
            else:
                found[prefix + entry.name] = entry.read_bytes()
    return found


def page(static: Mapping[str, bytes], token: str) -> tuple[bytes, str]:
    """Return index.html with the token of this run, and the policy (CSP) that allows our own files only.

    The page preloads all modules, because they import each other in a chain of requests.
    """
    nonce = secrets.token_urlsafe(12)
    policy = (
        f"default-src 'none'; script-src 'self' 'nonce-{nonce}'; style-src 'self'; connect-src 'self'; "
        "img-src 'self' data: blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
    modules = sorted(name for name in static if name.endswith(".js") and name not in (WIDGET, NOTEBOOK))
    links = "\n".join(f'<link rel="modulepreload" href="/static/{name}">' for name in modules)
    html = static["index.html"].decode().replace("<!-- modules -->", links)
    return html.replace("{token}", token).replace("{nonce}", nonce).encode(), policy


def bundle() -> str:
    """Return the whole page as one module for anywidget: widget.js with the other files packed into it.

    Relative imports do not work there: './x.js' becomes 'dsfab/x.js', a name of the page's import map (HTML Standard).
    The notebook's transport replaces the server's under the same name.
    """
    texts = {name: content.decode() for name, content in static_files().items()}
    modules = {name: text for name, text in texts.items() if name.endswith(".js") and name != WIDGET}
    modules[HTTP] = modules.pop(NOTEBOOK)
    named = {f"dsfab/{name}": _absolute(name, text) for name, text in modules.items()}
    parts = {"html": texts["index.html"], "css": texts["style.css"], "modules": named}
    zipped = gzip.compress(json.dumps(parts).encode(), mtime=0)
    return texts[WIDGET].replace("{packed}", base64.b64encode(zipped).decode())


def _absolute(name: str, text: str) -> str:
    folder = name.rpartition("/")[0]
    return _FROM.sub(rf"\1dsfab/{folder + '/' if folder else ''}\2", text)


SMALLEST, WIDEST = 64, 2400
"""Limits on the sides of a picture, pixels."""

Given = Mapping[str, Any]


class AskError(DsfabError):
    """A request that the page never sends: a field is missing or has another type."""


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
"""Handlers of requests. Each raises DsfabError with a sentence for the user and returns data for JSON."""
