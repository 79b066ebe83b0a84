"""The static files of the page, and the requests that the page may send to a session."""

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
"""JavaScript modules of the page: connection to a server, connection to a notebook, and start in a notebook."""

_FROM = re.compile(r"""(\b(?:from|import)\s*['"])\./((?:vendor/)?[\w.]+['"])""")
"""Matches a relative import in a JavaScript module of the page."""


def static_files() -> dict[str, bytes]:
    """Return the files of the editor's page, by path below `/static/`."""
    contents, folders = {}, [("", files("dsfab.app.editor").joinpath("static"))]
    while folders:
        prefix, folder = folders.pop()
        for entry in folder.iterdir():
            if entry.is_dir():
                folders.append((f"{prefix}{entry.name}/", entry))
            else:
                contents[prefix + entry.name] = entry.read_bytes()
    return contents


def index_page(static: Mapping[str, bytes], token: str) -> tuple[bytes, str]:
    """Return the bytes of index.html, and the content security policy (CSP) of the page.
    static : files of the page, by path.    token : secret that every request of the page must contain."""
    nonce = secrets.token_urlsafe(12)
    policy = (
        f"default-src 'none'; script-src 'self' 'nonce-{nonce}'; style-src 'self'; connect-src 'self'; "
        "img-src 'self' data: blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
    modules = sorted(name for name in static if name.endswith(".js") and name not in (WIDGET, NOTEBOOK))
    links = "\n".join(f'<link rel="modulepreload" href="/static/{name}">' for name in modules)
    html = static["index.html"].decode().replace("<!-- modules -->", links)
    return html.replace("{token}", token).replace("{nonce}", nonce).encode(), policy


def widget_module() -> str:
    """Return the whole page as a single JavaScript module for anywidget."""
    texts = {name: content.decode() for name, content in static_files().items()}
    modules = {name: text for name, text in texts.items() if name.endswith(".js") and name != WIDGET}
    modules[HTTP] = modules.pop(NOTEBOOK)
    named = {f"dsfab/{name}": _with_absolute_imports(name, text) for name, text in modules.items()}
    parts = {"html": texts["index.html"], "css": texts["style.css"], "modules": named}
    zipped = gzip.compress(json.dumps(parts).encode(), mtime=0)
    return texts[WIDGET].replace("{packed}", base64.b64encode(zipped).decode())


def _with_absolute_imports(name: str, text: str) -> str:
    folder = name.rpartition("/")[0]
    return _FROM.sub(rf"\1dsfab/{folder + '/' if folder else ''}\2", text)


SMALLEST, WIDEST = 64, 2400  # Limits on the sides of a picture, pixels.
RequestFields = Mapping[str, Any]


class RequestError(DsfabError):
    """Error for a request with a missing field or a wrong type."""


def _required_field(fields: RequestFields, name: str, kind: type) -> Any:
    value = fields.get(name)
    if not isinstance(value, kind):
        raise RequestError(f"the field {name} of the request is missing or has a wrong type; reload the page")
    return value


def _changes_field(fields: RequestFields) -> RequestFields:
    changes: RequestFields = _required_field(fields, "changes", dict)
    return changes


def _handle_export(session: Session, fields: RequestFields) -> RequestFields:
    changes, suffix = _changes_field(fields), _required_field(fields, "format", str)
    return session.ask_build(changes, bool(fields.get("replace", False)), suffix)


def _handle_picture(session: Session, fields: RequestFields) -> RequestFields:
    size = _required_field(fields, "size", list)
    if len(size) != 2 or not all(isinstance(x, int) and SMALLEST <= x <= WIDEST for x in size):
        raise RequestError(f"the field size is not two numbers of pixels from {SMALLEST} to {WIDEST}; reload the page")
    show, view = _required_field(fields, "show", str), _required_field(fields, "view", str)
    return {"job": session.ask_picture(_changes_field(fields), view, show, (size[0], size[1]))}


def _handle_keep(session: Session, fields: RequestFields) -> RequestFields:
    kinds = {"name": str, "picture": str, "figures": dict}
    name, picture, figures = (_required_field(fields, key, kind) for key, kind in kinds.items())
    session.variants.keep(KeptVariant(name, session.current_preset, _changes_field(fields), picture, figures))
    return {"variants": session.variants.records()}


def _handle_rename(session: Session, fields: RequestFields) -> RequestFields:
    session.variants.rename(_required_field(fields, "variant", int), _required_field(fields, "name", str))
    return {"variants": session.variants.records()}


def _handle_drop(session: Session, fields: RequestFields) -> RequestFields:
    session.variants.drop(_required_field(fields, "variant", int))
    return {"variants": session.variants.records()}


def _handle_compare(session: Session, fields: RequestFields) -> RequestFields:
    numbers = _required_field(fields, "variants", list)
    if len(numbers) not in (1, 2) or not all(isinstance(number, int) for number in numbers):
        raise RequestError("the field 'variants' must be a list of one or two numbers; reload the page")
    presets = [session.variants[number].preset for number in numbers]
    before, after = (*presets, session.current_preset.preset_with(_changes_field(fields)))[:2]
    return {"differences": differences(before, after)}


def _handle_open(session: Session, fields: RequestFields) -> RequestFields:
    if "preset" in fields:
        return session.open_preset(_required_field(fields, "preset", str))
    if "toml" in fields:
        return session.open_toml(_required_field(fields, "toml", str))
    if "variant" in fields:
        return session.open_variant(_required_field(fields, "variant", int))
    name, data, unit = _required_field(fields, "name", str), _required_field(fields, "data", str), fields.get("unit")
    return session.ask_mesh(name, str(unit) if unit else None, data)


HANDLERS: dict[str, Callable[[Session, RequestFields], RequestFields]] = {
    "solve": lambda session, given: {"job": session.ask_solve(_changes_field(given))},
    "build": lambda session, given: session.ask_build(_changes_field(given), bool(given.get("replace", False))),
    "export": _handle_export,
    "formats": lambda session, given: {"formats": offered_formats()},
    "picture": _handle_picture,
    "members": lambda session, given: {"job": session.ask_members(bool(given.get("judged", False)))},
    "preset": lambda session, given: session.preset_file(_changes_field(given)),
    "command": lambda session, given: session.command(_changes_field(given)),
    "open": _handle_open,
    "keep": _handle_keep,
    "rename": _handle_rename,
    "drop": _handle_drop,
    "compare": _handle_compare,
    "cancel": lambda session, given: {"stopped": session.jobs.cancel(_required_field(given, "job", int))},
}
"""Functions that answer requests, by name of the request. They return JSON values, or raise DsfabError."""
