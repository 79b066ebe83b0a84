"""HTTP server for Hops on this machine."""

import json
import logging
import multiprocessing
import threading
from collections.abc import Mapping
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from multiprocessing.pool import Pool
from typing import Any, Self
from urllib.parse import urlsplit

from dsfab.app.hops.components import COMPONENTS
from dsfab.app.hops.protocol import HopsError, read_request
from dsfab.core.errors import DsfabError

log = logging.getLogger(__name__)


class Solver:
    """A process that solves one request at a time. Use in a `with` block. seconds : time limit of a request."""

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self._turn = threading.Lock()
        self._pool: Pool | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._end()

    def solve(self, name: str, body: Mapping[str, Any]) -> str:
        """Return the component's answer as JSON. Raises HopsError if the request fails or is too slow."""
        with self._turn:
            if self._pool is None:
                self._pool = multiprocessing.get_context("spawn").Pool(1)
            try:
                succeeded, text = self._pool.apply_async(solve_request, (name, dict(body))).get(self.seconds)
            except multiprocessing.TimeoutError:
                self._end()
                raise HopsError(
                    f"the component was stopped after {self.seconds:g} s; make the mesh coarser, or start "
                    "dsfab hops with more --seconds"
                ) from None
        if not succeeded:
            raise HopsError(text)
        return str(text)

    def _end(self) -> None:
        if self._pool is not None:
            self._pool.terminate()
            self._pool.join()
            self._pool = None


def solve_request(name: str, body: Mapping[str, Any]) -> tuple[bool, str]:
    """Return True and the component's answer as JSON, or False and the reason why the request failed."""
    component = COMPONENTS[name]
    try:
        return True, json.dumps(component.answer(read_request(component, body)))
    except DsfabError as error:
        return False, str(error)
    except Exception as error:  # Grasshopper also gets an answer after an unexpected error
        log.exception("%s", name)
        return False, f"dsfab made a mistake ({type(error).__name__}: {error}); please report it"


LOOPBACK = "127.0.0.1"
LARGEST = 64 * 2**20  # Largest request in bytes, for a mesh of 100,000 faces.


class HopsServer(ThreadingHTTPServer):
    """HTTP server of all components for Grasshopper."""

    daemon_threads = True
    allow_reuse_address = False  # on Windows True would let another program take the port too

    def __init__(self, solver: Solver, port: int = 0) -> None:
        self.solver = solver
        super().__init__((LOOPBACK, port), HopsHandler)
        number = self.server_address[1]
        self.hosts = {f"{name}:{number}" for name in (LOOPBACK, "localhost")}

    @property
    def address(self) -> str:
        """Address of this server, without the name of a component."""
        return f"http://localhost:{self.server_address[1]}"

    def handle_error(self, request: object, client_address: object) -> None:
        """Log a broken connection at the debug level."""
        log.debug("connection of %s", client_address, exc_info=True)


class HopsHandler(BaseHTTPRequestHandler):
    server: HopsServer
    protocol_version = "HTTP/1.1"
    server_version = "dsfab"
    sys_version = ""
    timeout = 60
    disable_nagle_algorithm = True  # otherwise an answer's body waits up to 40 ms until its header is acknowledged

    def log_message(self, format: str, *args: object) -> None:
        """Do not log requests."""

    def do_HEAD(self) -> None:
        """Answer a HEAD request: the server runs."""
        self._answer(HTTPStatus.OK, "", body=False)

    def do_GET(self) -> None:
        """Answer a GET request with a description of one component, or of all components."""
        name = urlsplit(self.path).path.strip("/")
        if refusal := self._refusal():
            self._refuse(HTTPStatus.FORBIDDEN, refusal)
        elif not name:
            self._answer(HTTPStatus.OK, json.dumps([component.description_json() for component in COMPONENTS.values()]))
        elif name in COMPONENTS:
            self._answer(HTTPStatus.OK, json.dumps(COMPONENTS[name].description_json()))
        else:
            self._refuse(HTTPStatus.NOT_FOUND, f"there is no component {name!r}; there are {', '.join(COMPONENTS)}")

    def do_POST(self) -> None:
        """Answer a POST request with the outputs of a component."""
        length = self.headers.get("Content-Length", "")
        if refusal := self._refusal():
            self._refuse(HTTPStatus.FORBIDDEN, refusal)
        elif not (length.isascii() and length.isdigit() and len(length) < 12):
            self._refuse(HTTPStatus.LENGTH_REQUIRED, "the request has no header Content-Length; send this header")
        elif int(length) > LARGEST:
            self._refuse(
                HTTPStatus.REQUEST_ENTITY_TOO_LARGE,
                f"the request is larger than {LARGEST >> 20} MB; make the mesh coarser",
            )
        else:
            self._solve(self.rfile.read(int(length)))

    def _solve(self, content: bytes) -> None:
        try:
            body = json.loads(content)
        except (ValueError, RecursionError):
            body = None
        if not isinstance(body, dict):
            self._refuse(
                HTTPStatus.BAD_REQUEST,
                "this is not a request of Hops, because it is not a JSON object; use a Hops component",
            )
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
            return "this server answers only at its own address; use the address that dsfab hops printed"
        return (
            "this server answers only Hops; web pages cannot use it" if self.headers.get("Origin") is not None else ""
        )

    def _refuse(self, status: HTTPStatus, text: str) -> None:
        self.close_connection = True  # unread bytes would look like the next request
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
