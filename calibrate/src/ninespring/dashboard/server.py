"""Serves the page: files, and one websocket a page over which states go out and wishes come in."""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import re
import secrets
import socket
import time
from collections.abc import AsyncIterator, Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import plotly
import uvicorn
from starlette.applications import Starlette
from starlette.requests import HTTPConnection
from starlette.responses import FileResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect

from ..errors import InputError, WorkError, in_words
from . import wishes
from .source import Source

PAGE = Path(__file__).with_name("page")
PLOTLY = Path(plotly.__file__).with_name("package_data") / "plotly.min.js"
LOOPBACK = ("127.0.0.1", "localhost", "::1")
EVERY_S = 0.05
"""Most often that a page is told a new state: half a row's time at 10 Hz, so that no row falls between two looks."""
ANSWER_S = 15.0
"""So long a page waits for the board's words."""
LONGEST_WISH = 65536
A_SECOND, AT_ONCE = 20.0, 100.0
"""So many wishes a page may have a second, and so many in a burst; to switch off is always free."""
MOST_ANSWERS = 1000
"""A page that does not read so many answers is not there."""
HOST = re.compile(r"(\[[0-9a-f:.]+\]|[a-z0-9._-]+)(:[0-9]{1,5})?", re.IGNORECASE)


@dataclass(frozen=True)
class Door:
    """Who may come in: by which names the page is called, and with which token (none on the loopback address)."""

    names: frozenset[str] = frozenset(LOOPBACK)
    any_address: bool = False
    """Whether every address in numbers is a name of this machine: no other site can have its pages come from one."""
    token: str | None = None
    cookie: str = field(default_factory=lambda: f"ninespring-{secrets.token_hex(4)}")
    """Of this run: two dashboards of one machine share their cookies."""

    def knows(self, host: str) -> bool:
        """Return whether a Host header is one of this machine's names."""
        match = HOST.fullmatch(host)
        if not match:
            return False
        name = match[1].strip("[]").lower()
        if name in self.names:
            return True
        try:
            ipaddress.ip_address(name)
        except ValueError:
            return False
        return self.any_address

    def fits(self, token: str | None) -> bool:
        """Return whether that is the token."""
        return self.token is None or (
            token is not None and secrets.compare_digest(token.encode("utf-8", "replace"), self.token.encode())
        )


class OwnPagesOnly:
    """Refuses requests that a page of another site made, that came by another name (DNS rebinding), or without token."""

    def __init__(self, app: ASGIApp, door: Door) -> None:
        self.app, self.door = app, door

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on what may be, refuse the rest with 403."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        asked = HTTPConnection(scope)
        answer: Response | None = None
        if not self._own(asked):
            answer = PlainTextResponse("not from here: --host-name NAME adds a name of this machine", 403)
        elif not self.door.fits(asked.cookies.get(self.door.cookie)):
            answer = self._let_in(asked)
        if answer is None:
            await self.app(scope, receive, send)
        elif scope["type"] == "websocket":
            await WebSocket(scope, receive, send).close(1008)
        else:
            await answer(scope, receive, send)

    def _own(self, asked: HTTPConnection) -> bool:
        hosts, origins = asked.headers.getlist("host"), asked.headers.getlist("origin")
        if len(hosts) != 1 or len(origins) > 1 or not self.door.knows(hosts[0]):
            return False
        return origins[0] == f"http://{hosts[0]}" if origins else asked.scope["type"] == "http"

    def _let_in(self, asked: HTTPConnection) -> Response:
        """Keep the token of the printed address in a cookie, so that it stands in no address bar."""
        token = asked.query_params.get("token")
        if asked.scope["path"] == "/" and token and self.door.fits(token):
            answer = RedirectResponse("/", 303, headers={"cache-control": "no-store", "referrer-policy": "no-referrer"})
            answer.set_cookie(self.door.cookie, token, httponly=True, samesite="lax")
            return answer
        return PlainTextResponse("open the address that the dashboard printed, with its token", 403)


class _Rate:
    """How many wishes a page still has."""

    def __init__(self) -> None:
        self._left, self._at_s = AT_ONCE, time.monotonic()

    def take(self) -> bool:
        now = time.monotonic()
        self._left, self._at_s = min(AT_ONCE, self._left + A_SECOND * (now - self._at_s)), now
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True


def application(source: Source, door: Door) -> ASGIApp:
    """Return the application that shows one source."""

    async def page(websocket: WebSocket) -> None:
        await websocket.accept()
        answers: asyncio.Queue[dict[str, Any]] = asyncio.Queue(MOST_ANSWERS)
        await websocket.send_json(source.history())
        await websocket.send_json({"kind": "settings", "settings": source.settings()})
        both = {
            asyncio.create_task(_tell(websocket, source, answers)),
            asyncio.create_task(_listen(websocket, source, answers)),
        }
        try:
            await asyncio.wait(both, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for one in both:
                one.cancel()
            # gone, or it sent bytes, or it reads no answers: this page ends, and nothing else
            await asyncio.gather(*both, return_exceptions=True)
            with contextlib.suppress(RuntimeError, WebSocketDisconnect):
                await websocket.close(1008)

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
    return OwnPagesOnly(inner, door)


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


async def _listen(websocket: WebSocket, source: Source, answers: asyncio.Queue[dict[str, Any]]) -> None:
    """Take a page's wishes as they come."""
    rate = _Rate()
    running: set[asyncio.Task[None]] = set()
    while not answers.full():
        text = await websocket.receive_text()
        one = asyncio.create_task(_answer(source, text, rate, answers))
        running.add(one)
        one.add_done_callback(running.discard)


async def _answer(source: Source, text: str, rate: _Rate, answers: asyncio.Queue[dict[str, Any]]) -> None:
    """Do what a page wishes, or say why not: whatever is wrong with a wish is the answer to that wish."""
    number, wish = wishes.read(text)
    try:
        said = await _carry_out(source, wish, rate, answers)
        answer = {"kind": "done", "id": number, "said": said}
    except TimeoutError:
        answer = {"kind": "refused", "id": number, "why": f"the board does not answer for {ANSWER_S:g} s"}
    except Exception as error:
        answer = {"kind": "refused", "id": number, "why": in_words(error)}
    with contextlib.suppress(asyncio.QueueFull):
        answers.put_nowait(answer)


async def _carry_out(source: Source, wish: dict[str, Any], rate: _Rate, answers: asyncio.Queue[dict[str, Any]]) -> str:
    # a wish is taken before anything is awaited: a page's wishes keep their order
    wish = wishes.validated(wish)
    if wish["do"] == "stop":
        return source.stop_now(wish.get("supply", False))
    off = wishes.switches_off(wish)
    if not off and not rate.take():
        raise WorkError(f"too many wishes of this page: {A_SECOND:g} a second, {AT_ONCE:g} at once")
    if wish["do"] == "settings":
        answers.put_nowait({"kind": "settings", "settings": source.settings()})
        return ""
    if wish["do"] not in source.takes:
        raise InputError(f"'{wish['do']}' is nothing that {source.words} can do")
    answer = asyncio.wrap_future(source.do(wish))
    if not off:
        return await asyncio.wait_for(answer, ANSWER_S)
    answer.add_done_callback(lambda late: late.cancelled() or late.exception())  # when nobody waits for it any more
    try:
        return await asyncio.wait_for(asyncio.shield(answer), source.off_within_s)
    except TimeoutError:
        return f"the board was busy, so that it was stopped. {source.stop_now()}"


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


def door_of(here: socket.socket, host_names: tuple[str, ...] = ()) -> Door:
    """Return who may come in at a listening socket: beyond the loopback address only with a token."""
    names = {*LOOPBACK, *(one.lower() for one in host_names)}
    if here.getsockname()[0] in LOOPBACK:
        return Door(frozenset(names))
    return Door(frozenset({*names, socket.gethostname().lower()}), True, secrets.token_urlsafe(16))


def address_of(here: socket.socket, door: Door, host_names: tuple[str, ...] = ()) -> str:
    """Return the page's address, with its token where it has one."""
    name, port = here.getsockname()[:2]
    if host_names:
        name = host_names[0]
    elif name in ("0.0.0.0", "::"):
        name = socket.gethostname()
    return f"http://{f'[{name}]' if ':' in name else name}:{port}/" + (f"?token={door.token}" if door.token else "")


def serve(source: Source, here: socket.socket, stopped: Callable[[], bool], door: Door) -> None:
    """Serve until told to stop; then the springs are off and the log is finished."""
    config = uvicorn.Config(
        application(source, door),
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
