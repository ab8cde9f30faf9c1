"""Serves the page: files, and one websocket a page over which states go out and wishes come in."""

from __future__ import annotations

import asyncio
import contextlib
import json
import socket
from collections.abc import AsyncIterator, Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import jsonschema
import plotly
import uvicorn
from starlette.applications import Starlette
from starlette.responses import FileResponse, PlainTextResponse
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect

from ..errors import InputError, WorkError
from .source import Source

PAGE = Path(__file__).with_name("page")
PLOTLY = Path(plotly.__file__).with_name("package_data") / "plotly.min.js"
LOOPBACK = ("127.0.0.1", "localhost", "::1")
EVERY_S = 0.05
"""Most often that a page is told a new state: half a row's time at 10 Hz, so that no row falls between two looks."""
ANSWER_S = 15.0
"""So long a page waits for the board's words."""
LONGEST_WISH = 65536


def _wish(do: str, /, **properties: Any) -> dict[str, Any]:
    return {
        "type": "object",
        "properties": {"do": {"const": do}, "id": {"type": "integer"}} | properties,
        "required": ["do", *properties],
        "additionalProperties": False,
    }


_LEVEL = {"type": "integer", "minimum": 0, "maximum": 100}
_PATTERN = {"type": "string", "pattern": r"^[01]{1,64}\Z"}
WISHES = jsonschema.Draft202012Validator(
    {
        "oneOf": [
            *(_wish(name) for name in ("stop", "clear", "unlock", "record", "end_recording", "settings", "pause")),
            _wish("level", spring={"type": "integer", "minimum": 1, "maximum": 64}, level=_LEVEL),
            _wish("all", level=_LEVEL),
            _wish("pattern", springs=_PATTERN),
            _wish(
                "play",
                patterns={"type": "array", "items": _PATTERN, "minItems": 1, "maxItems": 100},
                seconds={"type": "number", "minimum": 0.5, "maximum": 3600},
            ),
            _wish("policy", policy={"enum": ["open", "precompensate"]}),
            _wish("fan", percent=_LEVEL),
            _wish("ambient", celsius={"type": "number", "minimum": -40, "maximum": 85}),
            _wish(
                "set",
                name={"type": "string", "pattern": r"^[a-z0-9_]{1,40}\Z"},
                value={"type": "string", "pattern": r"^-?[0-9]{1,9}(\.[0-9]{1,9})?\Z"},
            ),
            _wish("say", line={"type": "string", "pattern": r'^["-~][ -~]{0,62}\Z'}),
            _wish("seek", time_s={"type": "number"}),
            _wish("speed", speed={"type": "number", "minimum": 0.1, "maximum": 1000}),
        ]
    }
)
"""Everything that a page may wish, exactly; what is not one of these changes nothing."""


class OwnPagesOnly:
    """Refuses requests that a page of another site made, or that came by another name (DNS rebinding)."""

    def __init__(self, app: ASGIApp, loopback: bool) -> None:
        self.app, self.loopback = app, loopback

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on what may be, refuse the rest with 403."""
        if scope["type"] in ("http", "websocket") and not self._may(scope):
            if scope["type"] == "websocket":
                await WebSocket(scope, receive, send).close(1008)
            else:
                await PlainTextResponse("not from here", 403)(scope, receive, send)
            return
        await self.app(scope, receive, send)

    def _may(self, scope: Scope) -> bool:
        headers = [(name, value.decode("latin-1")) for name, value in scope["headers"]]
        hosts = [value for name, value in headers if name == b"host"]
        origins = [value for name, value in headers if name == b"origin"]
        if len(hosts) != 1 or len(origins) > 1:
            return False
        if self.loopback and urlsplit(f"//{hosts[0]}").hostname not in LOOPBACK:
            return False
        if scope["type"] == "websocket" and not origins:
            return False
        return not origins or origins[0] == f"http://{hosts[0]}"


def application(source: Source, loopback: bool = True) -> ASGIApp:
    """Return the application that shows one source."""

    async def page(websocket: WebSocket) -> None:
        await websocket.accept()
        answers: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
        await websocket.send_json(source.history())
        await websocket.send_json({"kind": "settings", "settings": source.settings()})
        tell = asyncio.create_task(_tell(websocket, source, answers))
        wishes: set[asyncio.Task[None]] = set()
        try:
            while True:
                text = await websocket.receive_text()
                one = asyncio.create_task(_carry_out(source, text, answers))
                wishes.add(one)
                one.add_done_callback(wishes.discard)
        except (WebSocketDisconnect, KeyError, RuntimeError):
            pass  # gone, or it sent bytes
        finally:
            tell.cancel()
            with contextlib.suppress(asyncio.CancelledError, WebSocketDisconnect, RuntimeError):
                await tell

    @contextlib.asynccontextmanager
    async def life(app: Starlette) -> AsyncIterator[None]:
        source.start()
        try:
            yield
        finally:
            await asyncio.to_thread(source.close)

    inner = Starlette(
        routes=[
            Route("/", lambda request: FileResponse(PAGE / "index.html", headers=POLICY)),
            Route("/plotly.js", lambda request: FileResponse(PLOTLY, headers={"cache-control": "max-age=86400"})),
            WebSocketRoute("/ws", page),
            Mount("/page", StaticFiles(directory=PAGE)),
        ],
        lifespan=life,
    )
    return OwnPagesOnly(inner, loopback)


POLICY = {
    "content-security-policy": "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
    "frame-ancestors 'none'; base-uri 'none'; form-action 'none'",
    "referrer-policy": "no-referrer",
}


async def _tell(websocket: WebSocket, source: Source, answers: asyncio.Queue[dict[str, Any]]) -> None:
    """Send states as they change, and answers as they come."""
    told, read = -1, None
    while True:
        while not answers.empty():
            await websocket.send_json(answers.get_nowait())
        if source.revision != told:
            state = source.state()
            told = state["revision"]
            if state.get("settings_read") != read:
                read = state.get("settings_read")
                await websocket.send_json({"kind": "settings", "settings": source.settings()})
            await websocket.send_json(state)
        await asyncio.sleep(EVERY_S)


def _no_number(text: str) -> float:
    raise ValueError(text)


async def _carry_out(source: Source, text: str, answers: asyncio.Queue[dict[str, Any]]) -> None:
    """Do what a page wishes, or say why not."""
    number = None
    try:
        wish = json.loads(text, parse_constant=_no_number)
        WISHES.validate(wish)
        number = wish.get("id")
        if wish["do"] == "stop":
            source.stop_now()
            said = "stopped"
        elif wish["do"] == "settings":
            answers.put_nowait({"kind": "settings", "settings": source.settings()})
            said = ""
        else:
            # taken before anything is awaited: a page's wishes keep their order
            said = await asyncio.wait_for(asyncio.wrap_future(source.do(wish)), ANSWER_S)
    except (ValueError, jsonschema.ValidationError, RecursionError):
        answers.put_nowait({"kind": "refused", "id": number, "why": "not a wish that this page can have"})
    except (WorkError, InputError, TimeoutError) as error:
        answers.put_nowait({"kind": "refused", "id": number, "why": str(error) or "the board does not answer"})
    else:
        answers.put_nowait({"kind": "done", "id": number, "said": said})


class _Server(uvicorn.Server):
    """uvicorn, ended by whoever started it rather than by signals of its own."""

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        yield


def listen(host: str, port: int) -> socket.socket:
    """Return a listening socket. WorkError where the address is taken or not this machine's."""
    try:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        return socket.create_server((host, port), family=family)
    except OSError as error:
        raise WorkError(f"{host}:{port}: {error.strerror or error}: another one with --listen HOST:PORT") from None


def serve(source: Source, here: socket.socket, stopped: Callable[[], bool]) -> None:
    """Serve until told to stop; then the springs are off and the log is finished."""
    host = here.getsockname()[0]
    config = uvicorn.Config(
        application(source, host in LOOPBACK),
        log_level="warning",
        ws_max_size=LONGEST_WISH,
        ws_ping_interval=5,
        ws_ping_timeout=10,
        timeout_graceful_shutdown=2,
        server_header=False,
    )

    async def run() -> None:
        server = _Server(config)

        async def watch() -> None:
            while not stopped():
                await asyncio.sleep(0.1)
            server.should_exit = True

        watcher = asyncio.create_task(watch())
        await server.serve(sockets=[here])
        watcher.cancel()

    asyncio.run(run())
