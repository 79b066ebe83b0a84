"""HTTP server of the editor, for this machine alone.

Every request must name this server as its host, and carry the token of this run. A POST must have JSON."""

import hmac
import json
import logging
import queue
import secrets
from collections.abc import Callable, Mapping
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import parse_qs, quote, urlsplit

from dsfab.app.editor.page import HANDLERS, KINDS, RequestError, RequestFields, index_page, static_files
from dsfab.app.editor.session import Session
from dsfab.core.errors import DsfabError

log = logging.getLogger(__name__)
LOOPBACK = "127.0.0.1"
LARGEST = 96 * 2**20  # Largest request in bytes, for a mesh of a million triangles.
NO_ADDRESS = HTTPStatus.NOT_FOUND, "this page does not exist; open the address that dsfab edit printed"


class RefusedRequest(Exception):  # noqa: N818  # no error of the server
    """Error for a refused request, with an HTTP status and a message."""

    def __init__(self, status: HTTPStatus, text: str) -> None:
        super().__init__(text)
        self.status = status


class EditorServer(ThreadingHTTPServer):
    """HTTP server of an editor session. The user opens `address` in a browser."""

    daemon_threads = True
    request_queue_size = 256  # limit of waiting connections; a page loads dozens of files at once
    allow_reuse_address = False  # on Windows True would let another program take the port too

    def __init__(self, session: Session, port: int = 0) -> None:
        self.session, self.token = session, secrets.token_urlsafe(24)
        self.static = static_files()
        super().__init__((LOOPBACK, port), EditorHandler)
        number = self.server_address[1]
        self.hosts = {f"{name}:{number}" for name in (LOOPBACK, "localhost")}

    def handle_error(self, request: object, client_address: object) -> None:
        """Log a broken connection at the debug level."""
        log.debug("connection of %s", client_address, exc_info=True)

    @property
    def address(self) -> str:
        """Address of the page with the secret token of this run."""
        return f"http://{LOOPBACK}:{self.server_address[1]}/?token={self.token}"


class EditorHandler(BaseHTTPRequestHandler):
    server: EditorServer
    protocol_version = "HTTP/1.1"
    server_version = "dsfab"
    sys_version = ""
    timeout = 60
    disable_nagle_algorithm = True  # otherwise a response's body waits up to 40 ms until its header is acknowledged

    def do_GET(self) -> None:
        self._guard(self._get)

    def do_POST(self) -> None:
        self._guard(self._post)

    def log_message(self, format: str, *args: object) -> None:
        """Do not log requests."""

    def _guard(self, handle: Callable[[], None]) -> None:
        try:
            self._check_host()
            self._answer(handle)
        except RefusedRequest as refused:
            self.close_connection = True  # unread bytes would look like the next request
            self._json({"error": str(refused)}, refused.status)
        except (ConnectionError, TimeoutError):
            self.close_connection = True

    def _answer(self, handle: Callable[[], None]) -> None:
        try:
            handle()
        except (RefusedRequest, ConnectionError, TimeoutError):
            raise
        except RequestError as error:
            self._json({"error": str(error)}, HTTPStatus.BAD_REQUEST)
        except DsfabError as error:
            self._json({"error": str(error)}, HTTPStatus.UNPROCESSABLE_ENTITY)
        except Exception as error:  # the server continues after a bug
            log.exception("%s", self.path)
            self.close_connection = True
            mistake = f"dsfab made a mistake ({type(error).__name__}); please report it"
            self._json({"error": mistake}, HTTPStatus.INTERNAL_SERVER_ERROR)

    def _check_host(self) -> None:
        if self.headers.get("Host", "").lower() not in self.server.hosts:
            raise RefusedRequest(
                HTTPStatus.FORBIDDEN,
                "this server answers only at its own address; open the address that dsfab edit printed",
            )
        origin = self.headers.get("Origin")
        if origin is not None and urlsplit(origin).netloc.lower() not in self.server.hosts:
            raise RefusedRequest(
                HTTPStatus.FORBIDDEN,
                "this server answers only the page of dsfab edit; open the address that dsfab edit printed",
            )

    def _check_token(self, query: Mapping[str, list[str]]) -> None:
        token = self.headers.get("X-Dsfab-Token") or query.get("token", [""])[0]
        if not hmac.compare_digest(token.encode(), self.server.token.encode()):
            raise RefusedRequest(
                HTTPStatus.FORBIDDEN, "the address has no valid token; open the address that dsfab edit printed"
            )

    def _get(self) -> None:
        parts = urlsplit(self.path)
        query = parse_qs(parts.query)
        if parts.path.startswith("/static/"):
            self._static(parts.path.removeprefix("/static/"))
            return
        self._check_token(query)
        if parts.path == "/":
            self._page()
        elif parts.path == "/api/start":
            self._json(self.server.session.start())
        elif parts.path == "/api/model":
            self._bytes(self.server.session.model(_number_field(query, "have")), "application/octet-stream")
        elif parts.path == "/api/cut":
            self._bytes_or_nothing(self.server.session.cut_sheet(_number_field(query, "draft")))
        elif parts.path == "/api/early":
            self._bytes_or_nothing(self.server.session.first_model())
        elif parts.path == "/api/events":
            self._events()
        elif parts.path == "/api/file":
            self._file(_number_field(query, "build"), _number_field(query, "index"))
        else:
            raise RefusedRequest(*NO_ADDRESS)

    def _post(self) -> None:
        parts = urlsplit(self.path)
        self._check_token(parse_qs(parts.query))
        if self.headers.get_content_type() != "application/json":
            raise RefusedRequest(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "the request is not of the type application/json")
        handle = HANDLERS.get(parts.path.removeprefix("/api/")) if parts.path.startswith("/api/") else None
        if handle is None:
            raise RefusedRequest(*NO_ADDRESS)
        self._json(handle(self.server.session, self._body()))

    def _body(self) -> RequestFields:
        length = self.headers.get("Content-Length", "")
        if not (length.isascii() and length.isdigit() and len(length) < 19):
            raise RefusedRequest(
                HTTPStatus.LENGTH_REQUIRED, "the request has no header Content-Length; send this header"
            )
        if int(length) > LARGEST:
            raise RefusedRequest(
                HTTPStatus.REQUEST_ENTITY_TOO_LARGE,
                f"the request is larger than {LARGEST >> 20} MB; make the mesh coarser",
            )
        try:
            body = json.loads(self.rfile.read(int(length)))
        except (ValueError, RecursionError):
            raise RefusedRequest(HTTPStatus.BAD_REQUEST, "the request is not JSON") from None
        if not isinstance(body, dict):
            raise RefusedRequest(HTTPStatus.BAD_REQUEST, "the request is not a JSON object")
        return body

    def _page(self) -> None:
        content, policy = index_page(self.server.static, self.server.token)
        self._bytes(content, "text/html; charset=utf-8", {"Content-Security-Policy": policy})

    def _static(self, name: str) -> None:
        content = self.server.static.get(name)
        if content is None or name == "index.html":
            raise RefusedRequest(*NO_ADDRESS)
        kind = KINDS.get("." + name.rpartition(".")[2], "text/plain")
        self._bytes(content, f"{kind}; charset=utf-8")

    def _file(self, build: int, index: int) -> None:
        path = self.server.session.builds.file(build, index)
        if path is None:
            raise RefusedRequest(HTTPStatus.NOT_FOUND, "this build has no file of this name; build again")
        attachment = {"Content-Disposition": f"attachment; filename={quote(path.name)}"}
        self._bytes(path.read_bytes(), "application/octet-stream", attachment)

    def _events(self) -> None:
        jobs = self.server.session.jobs
        listener = jobs.add_listener()
        try:
            self.send_response(HTTPStatus.OK)
            self._headers("text/event-stream", {"Connection": "close"})
            self.close_connection = True
            self.wfile.write(b": here\n\n")
            while True:
                try:
                    news = listener.get(timeout=15)  # after 15 s without news, write a line to test the connection
                except queue.Empty:
                    self.wfile.write(b": still here\n\n")
                    continue
                if news is None:
                    return
                self.wfile.write(f"data: {json.dumps(news)}\n\n".encode())
        finally:
            jobs.remove_listener(listener)

    def _json(self, fields: RequestFields, status: HTTPStatus = HTTPStatus.OK) -> None:
        self._bytes(json.dumps(fields).encode(), "application/json", status=status)

    def _bytes_or_nothing(self, content: bytes) -> None:
        self._bytes(content, "application/octet-stream", status=HTTPStatus.OK if content else HTTPStatus.NO_CONTENT)

    def _bytes(
        self,
        content: bytes,
        kind: str,
        extra_headers: Mapping[str, str] | None = None,
        status: HTTPStatus = HTTPStatus.OK,
    ) -> None:
        self.send_response(status)
        self._headers(kind, {**(extra_headers or {}), "Content-Length": str(len(content))})
        self.wfile.write(content)

    def _headers(self, kind: str, extra_headers: Mapping[str, str]) -> None:
        common_headers = {
            "Content-Type": kind,
            "Cache-Control": "no-store",
            "Referrer-Policy": "no-referrer",  # the address contains the token
            "X-Content-Type-Options": "nosniff",
            "Cross-Origin-Resource-Policy": "same-origin",
            "Cross-Origin-Opener-Policy": "same-origin",
        }
        for name, value in {**common_headers, **extra_headers}.items():
            self.send_header(name, value)
        self.end_headers()


def _number_field(query: Mapping[str, list[str]], name: str) -> int:
    text = query.get(name, ["0"])[0]
    if not (text.isascii() and text.isdigit() and len(text) < 10):
        raise RefusedRequest(HTTPStatus.BAD_REQUEST, f"{name} must be a number")
    return int(text)
