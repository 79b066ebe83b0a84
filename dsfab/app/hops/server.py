"""HTTP for Hops on this machine alone: `/` lists the components, `/NAME` describes one, `/solve` and `/NAME` solve.

A page of a web site can make a browser send requests here, and Hops sends no key. So whatever comes from a page (it
says its origin), or asks for another host, is turned away.
"""

import json
import logging
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import urlsplit

from dsfab.app.hops.components import COMPONENTS
from dsfab.app.hops.protocol import HopsError
from dsfab.app.hops.solver import Solver

log = logging.getLogger(__name__)

LOOPBACK = "127.0.0.1"
LARGEST = 64 * 2**20
"""Bytes of a request: a mesh of some hundred thousand faces."""

DIGITS = 12
"""Of a number of bytes: more are none that anybody sends."""


class HopsServer(ThreadingHTTPServer):
    """Serves `COMPONENTS`; `address` is what a Hops component is given, with the name of a component after it."""

    daemon_threads = True
    allow_reuse_address = False  # on Windows it would let another program take the port too

    def __init__(self, solver: Solver, port: int = 0) -> None:
        self.solver = solver
        super().__init__((LOOPBACK, port), HopsHandler)
        number = self.server_address[1]
        self.hosts = {f"{name}:{number}" for name in (LOOPBACK, "localhost")}

    @property
    def address(self) -> str:
        """Of this server."""
        return f"http://localhost:{self.server_address[1]}"

    def handle_error(self, request: object, client_address: object) -> None:
        """A connection that went wrong ends, without a word to the terminal."""
        log.debug("connection of %s", client_address, exc_info=True)


class HopsHandler(BaseHTTPRequestHandler):
    """One connection."""

    server: HopsServer
    protocol_version = "HTTP/1.1"
    server_version = "dsfab"
    sys_version = ""
    timeout = 60
    disable_nagle_algorithm = True  # else an answer waits up to 40 ms until Hops has told that it has the head

    def log_message(self, format: str, *args: object) -> None:
        """Silence: the terminal is for the person."""

    def do_HEAD(self) -> None:
        """Hops looks whether somebody is there."""
        self._answer(HTTPStatus.OK, "", body=False)

    def do_GET(self) -> None:
        """All components, or one."""
        name = urlsplit(self.path).path.strip("/")
        if refusal := self._refusal():
            self._refuse(HTTPStatus.FORBIDDEN, refusal)
        elif not name:
            self._answer(HTTPStatus.OK, json.dumps([one.described() for one in COMPONENTS.values()]))
        elif name in COMPONENTS:
            self._answer(HTTPStatus.OK, json.dumps(COMPONENTS[name].described()))
        else:
            self._refuse(HTTPStatus.NOT_FOUND, f"there is no component {name!r}; there are {', '.join(COMPONENTS)}")

    def do_POST(self) -> None:
        """Solve; what is refused is told as an error that Hops shows on the component."""
        length = self.headers.get("Content-Length", "")
        if refusal := self._refusal():
            self._refuse(HTTPStatus.FORBIDDEN, refusal)
        elif not (length.isascii() and length.isdigit() and len(length) < DIGITS):
            self._refuse(HTTPStatus.LENGTH_REQUIRED, "say how long the request is")
        elif int(length) > LARGEST:
            self._refuse(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"over {LARGEST >> 20} MB; make the mesh coarser")
        else:
            self._solve(self.rfile.read(int(length)))

    def _solve(self, content: bytes) -> None:
        try:
            body = json.loads(content)
        except (ValueError, RecursionError):
            body = None
        if not isinstance(body, dict):
            self._refuse(HTTPStatus.BAD_REQUEST, "this is no request of Hops: it is not a JSON object")
            return
        name = urlsplit(self.path).path.strip("/")
        name = str(body.get("pointer", "")).strip("/") if name == "solve" else name
        if name not in COMPONENTS:
            self._refuse(HTTPStatus.NOT_FOUND, f"there is no component {name!r}; there are {', '.join(COMPONENTS)}")
            return
        try:
            self._answer(HTTPStatus.OK, self.server.solver.solve(name, body))
        except HopsError as error:
            self._refuse(HTTPStatus.INTERNAL_SERVER_ERROR, str(error))

    def _refusal(self) -> str:
        if self.headers.get("Host", "").lower() not in self.server.hosts:
            return "this server answers for its own address only"
        return "this server answers Hops, and no page" if self.headers.get("Origin") is not None else ""

    def _refuse(self, status: HTTPStatus, text: str) -> None:
        self.close_connection = True  # what it still sends is not read
        self._answer(status, json.dumps({"values": [], "errors": [text]}))

    def _answer(self, status: HTTPStatus, text: str, body: bool = True) -> None:
        content = text.encode()
        head: dict[str, Any] = {"Content-Type": "application/json", "Content-Length": len(content)}
        try:
            self.send_response(status)
            for name, value in {**head, "Cache-Control": "no-store", "X-Content-Type-Options": "nosniff"}.items():
                self.send_header(name, str(value))
            self.end_headers()
            if body:
                self.wfile.write(content)
        except (ConnectionError, TimeoutError):
            self.close_connection = True
