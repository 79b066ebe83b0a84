"""The page's own files: as they are for a server, and all in one module for a notebook."""

import base64
import gzip
import json
import re
import secrets
from collections.abc import Mapping
from importlib.resources import files

KINDS = {".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}

HTTP, NOTEBOOK, WIDGET = "transport.js", "transport_notebook.js", "widget.js"
"""How the page speaks with a server, how with a notebook, and what opens the page there."""

_FROM = re.compile(r"""(\b(?:from|import)\s*['"])\./((?:vendor/)?[\w.]+['"])""")
"""A module's name for another one beside it."""


def static_files() -> dict[str, bytes]:
    """Every file of the page by its place in the address; there are no others."""
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
    """index.html with the token of this run, and the policy (CSP) that lets it load what is ours alone.

    The browser is told all modules at once: they name each other in a chain, each link of which would be a journey.
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
    """The whole page as one module for anywidget: widget.js with the other files in it, packed.

    Modules cannot name their neighbours by place there: './x.js' becomes 'dsfab/x.js', which the page's import map
    knows (HTML Standard, import maps). Of the two ways to speak with Python the notebook's takes the other's name.
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
