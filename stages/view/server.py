"""A server on this machine alone that shows a bag: the page, its scripts, and one scene at a time."""

from __future__ import annotations

import json
import re
import sys
import threading
from collections.abc import Callable
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from advpipe.pipeline.core.errors import AdvpipeError, one_line
from advpipe.pipeline.core.verbosity import notice
from advpipe.pipeline.viewer.encoding import encode_scene
from advpipe.pipeline.viewer.page import THREE_JS, style, viewer_page, viewer_script
from advpipe.stages.view.bag_scenes import BagScenes

LOCALHOST = "127.0.0.1"

HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; "
    "img-src 'self' data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}

HTML, CSS, JS, JSON = "text/html", "text/css", "text/javascript", "application/json"

_SCENE = re.compile(r"/scene/(\d{1,4})/(\d{1,9})\.json", re.ASCII)


class ViewServer(ThreadingHTTPServer):
    """Answers browsers of this machine. Port 0 is any free one; `url` names the one that it became.

    A request under another name than this machine's is refused: a page elsewhere whose name suddenly means
    this machine (DNS rebinding) reads nothing. No path names a file.
    """

    daemon_threads = True

    def __init__(self, scenes: BagScenes, port: int = 0) -> None:
        super().__init__((LOCALHOST, port), _Handler)
        self.scenes = scenes
        self.bag_lock = threading.Lock()  # readers are made for one thread at a time
        number = self.server_address[1]
        self.names = {f"{LOCALHOST}:{number}", f"localhost:{number}"}
        self.url = f"http://{LOCALHOST}:{number}/"

    def handle_error(self, request: Any, client_address: Any) -> None:
        """In one line; a browser that goes away while it is answered is no error."""
        error = sys.exc_info()[1]
        if not isinstance(error, ConnectionError | TimeoutError):
            notice(f"advpipe: a request failed: {type(error).__name__}: {error}")

    def about(self) -> str:
        """What the page has to know before it asks for a frame."""
        names = self.scenes.names
        with self.bag_lock:
            attacked = [*map(self.scenes.attacked_runs, range(len(names))), []]
        options = [*names, "clean bag alone"]
        return json.dumps({"frames": self.scenes.labels, "options": options, "attacked": attacked})

    def scene(self, option: int, index: int) -> str:
        """One frame beside an attack, or alone for the option behind the last attack."""
        with self.bag_lock:
            return encode_scene(self.scenes.scene(index, option if option < len(self.scenes.names) else None))


class _Handler(BaseHTTPRequestHandler):
    server: ViewServer
    server_version, sys_version = "advpipe", ""
    timeout = 60

    def do_GET(self) -> None:
        if self.headers.get("Host") not in self.server.names:
            self._answer(HTTPStatus.MISDIRECTED_REQUEST, "text/plain", "for this machine alone")
            return
        path = self.path.partition("?")[0]
        if path in _PAGES:
            kind, text = _PAGES[path]
            self._answer(HTTPStatus.OK, kind, text())
        elif path == "/bag.json":
            self._answer(HTTPStatus.OK, JSON, self.server.about())
        elif found := _SCENE.fullmatch(path):
            self._answer_scene(int(found[1]), int(found[2]))
        else:
            self._answer(HTTPStatus.NOT_FOUND, "text/plain", "there is nothing here")

    def _answer_scene(self, option: int, index: int) -> None:
        if index >= len(self.server.scenes) or option > len(self.server.scenes.names):
            self._answer(HTTPStatus.NOT_FOUND, "text/plain", "there is no such frame")
            return
        try:
            text = self.server.scene(option, index)
        except AdvpipeError as error:
            self._answer(HTTPStatus.UNPROCESSABLE_ENTITY, "text/plain", one_line(error))
            return
        self._answer(HTTPStatus.OK, JSON, text)

    def _answer(self, status: HTTPStatus, kind: str, text: str) -> None:
        body = text.encode()
        self.send_response(status)
        for name, value in HEADERS.items():
            self.send_header(name, value)
        self.send_header("Content-Type", f"{kind}; charset=utf-8")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:
        """Nothing on the terminal for a request."""


_PAGES: dict[str, tuple[str, Callable[[], str]]] = {
    "/": (HTML, viewer_page),
    "/viewer.css": (CSS, style),
    "/viewer.js": (JS, viewer_script),
    "/three.min.js": (JS, lambda: THREE_JS.read_text(encoding="utf-8")),
}
