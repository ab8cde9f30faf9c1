"""The live page in a real browser, on the simulated board: what it shows is what the board does, and stop stops."""

from __future__ import annotations

import asyncio
import json
import random
import re
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command import process
from fake_board import TELEMETRY, FakeBoard, row
from made import ROOT, needs_board
from ninespring.dashboard import server, source
from ninespring.dashboard.replay_source import ReplaySource
from ninespring.io import words
from ninespring.io.belief import Belief, beliefs
from ninespring.io.logs import read_log, read_table
from playwright.sync_api import Browser, Page, expect, sync_playwright
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

expect.set_options(timeout=30_000)  # ms; the board is simulated beside other tests, on as few as two cores
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")

needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="SKIPPED: no Chromium: script/setup installs it")


class Dashboard:
    """`ninespring dashboard` in its own process, ended as Ctrl-C would; whatever is done to it, no traceback."""

    def __init__(
        self, folder: Path, *words: object, at: str = "127.0.0.1", ends: signal.Signals = signal.SIGINT
    ) -> None:
        self.ends = ends
        command = process("dashboard", "--listen", f"{at}:0", "--folder", folder, *words)
        self.errors = tempfile.TemporaryFile("w+")  # noqa: SIM115 - closed with this
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=self.errors, text=True)
        assert self.process.stdout is not None
        self.url = self.process.stdout.readline().split()[0]
        assert self.url.startswith("http://")

    def __enter__(self) -> Dashboard:
        return self

    def __exit__(self, *_: object) -> None:
        assert self.end() == 0

    def page(self, headers: dict[str, str] | None = None) -> ClientConnection:
        """Return the socket of a page of its own, or of one with other headers."""
        own = self.url.rstrip("/")
        return connect(
            f"{own.replace('http', 'ws')}/ws", additional_headers={"origin": own} if headers is None else headers
        )

    def end(self) -> int:
        if self.process.poll() is None:
            self.process.send_signal(self.ends)
        code = self.process.wait(30)
        self.errors.seek(0)
        said = self.errors.read()
        assert not re.search("Traceback|defect|never retrieved", said), said
        return code


def status_of(dashboard: Dashboard, *headers: str) -> str:
    words = ["curl", "-s", "-o", "/dev/null", "-w", "%{http_code}", *(one for h in headers for one in ("-H", h))]
    return subprocess.run([*words, dashboard.url], capture_output=True, text=True, timeout=20, check=True).stdout


MALFORMED = [
    "",
    "nonsense",
    "[]",
    "null",
    '{"do": "level"}',
    '{"do": "level", "spring": 0, "level": 100}',
    '{"do": "level", "spring": 1, "level": 101}',
    '{"do": "level", "spring": "1", "level": 100}',
    '{"do": "level", "spring": 1, "level": 100, "more": 1}',
    '{"do": "level", "spring": 1, "level": NaN}',
    '{"do": "pattern", "springs": "2"}',
    '{"do": "pattern", "springs": "111111111111"}',
    '{"do": "say", "line": "on 1\\non 1"}',
    '{"do": "say", "line": "telemetry off"}',
    '{"do": "set", "name": "x=1\\non 1", "value": "1"}',
    '{"do": "set", "name": "rows\\n", "value": "1"}',
    '{"do": "say", "line": "on 1\\n"}',
    '{"do": "__class__"}',
    "[" * 5000,
]


class Rows:
    """Telemetry, anew each time it is asked for, unless it is frozen."""

    def __init__(self) -> None:
        self.frozen, self.begun_s = False, time.monotonic()

    def __iter__(self) -> Iterator[str]:
        while not self.frozen:
            yield row(10.0 + time.monotonic() - self.begun_s)


UNKNOWN = [
    "spring 1: 70.0 degC, 20.0 to 120.0, 8.0 K below martensite start (+-30.2), austenite 0.0 %, 0.0 to 100.0",
    "  0.000 A, 0.000 V, 0.000000 W, target 0.000 A",
    "  not known for 75 s: it may still be hot from before power-on",
    "ok",
]


def awaited(
    socket: ClientConnection, holds: Callable[[dict[str, Any]], bool], within_s: float = 60.0
) -> dict[str, Any]:
    """Return the first of what a page is told of which that holds."""
    ends = time.monotonic() + within_s
    while not holds(told := json.loads(socket.recv(ends - time.monotonic()))):
        pass
    return told


def answer_to(socket: ClientConnection, wish: dict[str, object], within_s: float = 20.0) -> dict[str, object]:
    socket.send(json.dumps(wish))
    return awaited(socket, lambda got: got.get("id") == wish["id"], within_s)


def answers_of(socket: ClientConnection, count: int) -> list[dict[str, Any]]:
    """Return the next so many answers to a page's wishes."""
    return [awaited(socket, lambda got: got["kind"] in ("done", "refused"), 10.0) for _ in range(count)]


def test_a_wish_that_fails_as_nobody_thought_of_is_answered() -> None:
    class Broken(source.Source):
        takes = frozenset({"level"})

        def do(self, wish: dict[str, Any]) -> Future[str]:
            raise KeyError("springs")

    async def wish() -> list[dict[str, Any]]:
        answers: asyncio.Queue[dict[str, Any]] = asyncio.Queue(9)
        text = '{"do": "level", "spring": 1, "level": 50, "id": 7}'
        await server._answer(Broken(), text, server._Rate(), answers)
        return [answers.get_nowait() for _ in range(answers.qsize())]

    with ThreadPoolExecutor(1) as pool:  # the browser's own event loop runs in this thread
        answers = pool.submit(lambda: asyncio.run(wish())).result()
    assert answers == [{"kind": "refused", "id": 7, "why": "a defect of the tool: KeyError: 'springs'"}]


def test_foreign_pages_are_refused_and_malformed_messages_change_nothing(tmp_path: Path) -> None:
    board = FakeBoard(stream=(row(0.1 * k) for k in range(10, 9999)), every_s=0.1)
    with Dashboard(tmp_path, "--port", board.port, ends=signal.SIGHUP) as dashboard:
        while "telemetry csv 10" not in board.seen:
            time.sleep(0.05)
        time.sleep(0.5)
        assert status_of(dashboard) == "200"
        for host in ("evil.example", "[", "127.0.0.1.evil.example", "127.0.0.2", "", "[::1", "\xff", "a:b:c"):
            assert status_of(dashboard, f"Host: {host}") in ("403", "400"), host
        assert status_of(dashboard, "Origin: http://evil.example") == "403"
        for headers in ({"origin": "http://evil.example"}, {"origin": "null"}, {}):
            with pytest.raises(InvalidStatus, match="403"):
                dashboard.page(headers)
        with dashboard.page() as socket:
            for one in MALFORMED:
                socket.send(one)
                told = awaited(socket, lambda told: told["kind"] not in ("state", "history", "settings"))
                assert told["kind"] == "refused", one
            assert answer_to(socket, {"do": "level", "spring": 1, "level": 50, "id": 7})["kind"] == "done"
        with dashboard.page() as socket:
            socket.send(b"\x00\x01")  # not text: this page is gone, nobody else's
        asked = ("version", "echo off", "telemetry off", "$$", "$telemetry_hz", "$telemetry_format", "model", "faults")
        assert [line for line in board.sent() if line not in asked] == ["telemetry csv 10", "on 1 50"]
    assert "off all" in board.sent()


@contextmanager
def page_of(board: FakeBoard, folder: Path, every_s: float = 0.1) -> Iterator[ClientConnection]:
    """Yield a page's socket once its dashboard has found the board, which streams rows; the dashboard ends well."""
    board.stream, board.every_s = (row(0.1 * k) for k in range(10, 99999)), every_s
    with Dashboard(folder, "--port", board.port) as dashboard, dashboard.page() as socket:
        awaited(socket, lambda state: state.get("connected"))
        yield socket


def test_the_board_that_gets_the_number_of_a_lost_terminal_is_left_alone(tmp_path: Path) -> None:
    for _ in range(5):
        first = FakeBoard()
        with page_of(first, tmp_path) as socket:
            first.pull()
            awaited(socket, lambda state: state.get("trouble"))  # its port is closed
            second = FakeBoard()  # somebody else's, beside it
            if second.port != first.port:
                continue  # another process on this machine has got the number
            trouble, until = "", time.monotonic() + 60.0
            while "another one has that number now" not in trouble and time.monotonic() < until and not second.seen:
                with suppress(TimeoutError):
                    trouble = json.loads(socket.recv(1)).get("trouble", "")
        assert second.seen == [] and "another one has that number now" in trouble
        return
    pytest.fail("in each of five attempts another process had the number first")


def test_a_pages_wishes_are_carried_out_in_their_order(tmp_path: Path) -> None:
    board = FakeBoard()
    with page_of(board, tmp_path) as socket:
        for level in range(1, 101):
            socket.send(json.dumps({"do": "level", "spring": 1, "level": level, "id": level}))
        answered = [(got["kind"], got["id"]) for got in answers_of(socket, 100)]
    assert answered == [("done", level) for level in range(1, 101)]
    assert [line for line in board.sent() if line.startswith("on ")] == [f"on 1 {level}" for level in range(1, 101)]


def test_a_refusal_says_what_would_be_right_and_to_which_wish(tmp_path: Path) -> None:
    refused = [
        ({"do": "set", "name": "rows", "value": "0,006"}, "'0,006' is not a number with a point"),
        ({"do": "set", "name": "rows", "value": ""}, "nothing is not a number with a point"),
        ({"do": "level", "spring": 1, "level": 101}, "101 is not 0 to 100 percent"),
        ({"do": "level", "spring": 2, "level": 0}, "there are 1 springs"),
        ({"do": "level", "spring": 1}, "level has spring and level"),
        ({"do": "fan"}, "fan has percent"),
        ({"do": "pause"}, "'pause' is nothing that a board can do"),
        ({"do": "seek", "time_s": 1}, "'seek' is nothing that a board can do"),
        ({"do": "speed", "speed": 1}, "'speed' is nothing that a board can do"),
        ({"do": "say", "line": "model ?"}, "? acts at once"),
        ({"do": []}, "not a wish"),
    ]
    board = FakeBoard()
    with page_of(board, tmp_path) as socket:
        for number, (wish, why) in enumerate(refused):
            got = answer_to(socket, wish | {"id": number})
            assert got["kind"] == "refused" and why in got["why"], got
        typed = {"on 1.0 50": "", "on 1 30%": "", "off 1.": "", "on one 50": "defect", "?": "<off|t:12.340|"}
        for line, said in typed.items():
            got = answer_to(socket, {"do": "say", "line": line, "id": 99})
            assert (got["kind"] == "refused") == (said == "defect") and said in got.get("said", got.get("why")), got
        assert answer_to(socket, {"do": "level", "spring": 1, "level": 5, "id": 100})["kind"] == "done"
        assert "!" not in board.sent()
        # what the board's own console takes is taken here, too: its longest line, and the stop that takes the supply
        assert answer_to(socket, {"do": "say", "line": "x" * 64, "id": 101})["kind"] == "done"
        got = answer_to(socket, {"do": "say", "line": "!!", "id": 102})
        assert got["kind"] == "done" and "supply" in got["said"], got
        until_s = time.monotonic() + 3.0
        while "!!" not in board.sent():  # it is sent; the board may read it a moment later
            assert time.monotonic() < until_s
            time.sleep(0.01)
    assert board.sent().count("version") == 1


def test_off_waits_behind_nothing(tmp_path: Path) -> None:
    board = FakeBoard({"selftest": []})
    with page_of(board, tmp_path) as socket:
        origin = {"origin": f"http://{socket.request.headers['host']}"}
        with connect(f"ws://{socket.request.headers['host']}/ws", additional_headers=origin) as other:
            board.slow_s = 0.05
            for number in range(300):  # more than a page may have at once
                socket.send(json.dumps({"do": "level", "spring": 1, "level": 1 + number % 100, "id": number}))
            begun_s = time.monotonic()
            assert answer_to(other, {"do": "level", "spring": 1, "level": 0, "id": 1})["kind"] == "done"
            assert time.monotonic() - begun_s < 3.0  # a queue of 15 s, on a machine that may be busy
            answered = [got.get("why", "") for got in answers_of(socket, 300)]
            assert any("too many wishes" in one for one in answered)
            assert any("dropped by an off" in one for one in answered)
            assert board.sent().count("off 1") == 1 and "!" not in board.sent()
            # the board itself is busy: then it is stopped
            socket.send(json.dumps({"do": "say", "line": "selftest", "id": 400}))
            while "selftest" not in board.seen:
                time.sleep(0.01)
            begun_s = time.monotonic()
            got = answer_to(other, {"do": "say", "line": "off all", "id": 2})
            assert got["kind"] == "done" and "it was stopped" in got["said"]
            while "!" not in board.sent():  # it is sent; the board may read it a moment later
                assert time.monotonic() - begun_s < 3.0
                time.sleep(0.01)
            assert time.monotonic() - begun_s < 3.0
            assert answer_to(other, {"do": "level", "spring": 1, "level": 5, "id": 3})["kind"] == "done"
    assert board.sent().count("version") == 1


def test_beyond_this_machine_the_printed_token_opens_the_page(tmp_path: Path) -> None:
    board = FakeBoard()
    with Dashboard(tmp_path, "--port", board.port, "--host-name", "bench.local", at="127.0.0.2") as dashboard:
        name, port, token = re.fullmatch(r"http://(bench\.local):(\d+)/\?token=([\w-]{20,})", dashboard.url).groups()

        def get(host: str, path: str, *more: str) -> tuple[str, str]:
            words = ["curl", "-s", "-i", "-H", f"Host: {host}", *more, f"http://127.0.0.2:{port}{path}"]
            got = subprocess.run(words, capture_output=True, text=True, timeout=20, check=True).stdout
            cookie = re.search(r"^set-cookie: ([^;]+); HttpOnly", got, re.MULTILINE)
            return got.split()[1], cookie[1] if cookie else ""

        def socket_of(host: str, cookie: str) -> ClientConnection:
            headers = {"origin": f"http://{host}"} | ({"cookie": cookie} if cookie else {})
            return connect(f"ws://127.0.0.2:{port}/ws", additional_headers=headers)

        for path in ("/", "/?token=", "/?token=" + token[:-1], "/page/page.js", "/page/page.js?token=" + token):
            assert get(name, path) == ("403", "")
        status, cookie = get(name, f"/?token={token}")
        assert status == "303" and token in cookie
        for path in ("/", "/page/page.js"):
            assert get(name, path, "-H", f"Cookie: {cookie}")[0] == "200"
            assert get(f"127.0.0.2:{port}", path, "-H", f"Cookie: {cookie}")[0] == "200"
            assert get("evil.example", path, "-H", f"Cookie: {cookie}")[0] == "403"
        assert get("evil.example", f"/?token={token}")[0] == "403"
        for given in ("", cookie[:-1], "a=b"):
            with pytest.raises(InvalidStatus, match="403"):
                socket_of(f"127.0.0.2:{port}", given)
        with socket_of(f"127.0.0.2:{port}", cookie) as socket:
            assert json.loads(socket.recv(10))["kind"] == "history"


def test_a_stop_of_a_replay_says_that_it_pauses(make_log, tmp_path: Path) -> None:
    with Dashboard(tmp_path, "--replay", make_log(seconds=20)) as dashboard, dashboard.page() as socket:
        got = answer_to(socket, {"do": "stop", "id": 1})
        assert "paused" in got["said"] and "nothing to switch off" in got["said"]
        got = answer_to(socket, {"do": "all", "level": 0, "id": 2})
        assert got["why"] == "'all' is nothing that a log that is replayed can do"
        assert answer_to(socket, {"do": "seek", "time_s": 1e8, "id": 3})["kind"] == "done"


def test_a_replay_is_paused_at_its_end_and_played_once_more_from_its_beginning(make_log) -> None:
    replay = ReplaySource(read_log(make_log(seconds=20)), 3, 3, None, 1000.0)
    replay.start()
    while replay.state()["time_s"] < 19.0:
        time.sleep(0.05)
    assert (replay.state()["playing"], replay.state()["state_words"]) == (False, "paused, 1000 x")
    replay.do({"do": "speed", "speed": 0.01})
    replay.do({"do": "pause"})
    assert (replay.state()["playing"], replay.state()["time_s"]) == (True, 0.0)
    replay.close()


WORDS = "on off pattern model faults clear policy fan $rows $$ $ ? learnt # help"
NAMES = "spring level springs patterns seconds percent celsius name value time_s more"
VALUES = [0, 1, -1, 1.0, 0.5, 100, 10**30, 1e308, None, True, [], {}, ["1"], [[]]]
VALUES += ["", "1", "0,006", "on all\n", "!", "é"]


def anything(draw: random.Random) -> str | bytes:
    """Return a wish, or what resembles one, or neither."""
    line = " ".join(
        draw.choices([*WORDS.split(), "1", "1.0", "2.", "all", "x", "\x7f", "1e9", "-"], k=draw.randint(1, 5))
    )
    kinds = ("level", "all", "pattern", "play", "end_play", "policy", "fan", "set", "seek", "speed", "pause")
    wish = {"do": draw.choice([*kinds, "record", "end_recording", "settings", "cold", "unlock", "clear", "nothing"])}
    wish |= {name: draw.choice(VALUES) for name in draw.sample(NAMES.split(), draw.randint(0, 3))}
    good = [
        {"do": "level", "spring": 1, "level": draw.randint(1, 100)},
        {"do": "say", "line": line},
        {"do": "play", "patterns": ["1", "0"], "seconds": 0.5},
        {"do": "set", "name": "supply_limit_a", "value": draw.choice(["1", "99999", "12.5"])},
        {"do": "record"},
        {"do": "end_recording"},
    ]
    what = draw.choice([wish, draw.choice(good), draw.choice(good)])
    what["id"] = draw.choice([draw.randint(1000, 9999), draw.randint(1000, 9999), 10**4000, -1, "x", None])
    text = json.dumps(what)
    cut = draw.randrange(len(text))
    return draw.choice([text, text, text, text[:cut], text[:cut] + chr(draw.randrange(1, 0xD000)) + text[cut + 1 :]])


@pytest.mark.parametrize("kind", ["fake", pytest.param("simulated", marks=[needs_board, pytest.mark.nightly])])
def test_whatever_pages_send_the_board_stays_and_off_is_answered(kind: str, tmp_path: Path) -> None:
    draw, board = random.Random(15), FakeBoard()
    board.stream, board.every_s = Rows(), 0.1
    with Dashboard(tmp_path, *(("--port", board.port) if kind == "fake" else ("--simulate",))) as dashboard:
        slowest_s, offs, version, times = 0.0, 0, None, []
        with ExitStack() as stack, dashboard.page() as calm:
            version = awaited(calm, lambda state: state.get("connected"))["version"]
            ends = time.monotonic() + 6.0
            wild = stack.enter_context(dashboard.page())
            while time.monotonic() < ends:
                for _ in range(draw.randint(1, 40)):
                    try:
                        wild.send(anything(draw) if draw.random() < 0.99 else draw.randbytes(20))
                    except ConnectionClosed:
                        wild = stack.enter_context(dashboard.page())
                begun_s, offs = time.monotonic(), offs + 1
                got = answer_to(calm, {"do": "all", "level": 0, "id": offs})
                assert got["kind"] == "done", got
                slowest_s = max(slowest_s, time.monotonic() - begun_s)
            while len(times) < 3:
                if (state := json.loads(calm.recv(30)))["kind"] == "state":
                    assert state["connected"] and state["version"] == version
                    times += [state["time_s"]] if state.get("time_s") not in times else []
    assert times == sorted(times) and offs > 5
    print(f"slowest of {offs} offs: {slowest_s:.2f} s")
    if kind == "fake":
        assert slowest_s < 2.0  # 1 s on a machine that does nothing else
        assert board.sent().count("telemetry off") == 2  # at its beginning and its end: it was found once


def test_a_full_disk_ends_the_recording_and_nothing_else(small_disk: Path) -> None:
    with page_of(FakeBoard(), small_disk, 0.01) as socket:
        socket.send('{"do": "record"}')
        state = awaited(socket, lambda state: "No space left on device" in state.get("said", ""))
        assert state["connected"] and state["recording"] is None
        awaited(socket, lambda now: now.get("time_s", 0.0) > state["time_s"])  # the array is shown as before
    (log,) = small_disk.iterdir()
    assert log.suffix == ".csv" and log.read_text().endswith("\n")
    assert len(read_table(log).frame) > 50


def test_a_stop_that_drops_what_is_being_answered_loses_no_board(tmp_path: Path) -> None:
    board = FakeBoard({"model": ["error:12 dropped by the stop"]})
    with page_of(board, tmp_path) as socket:
        until = time.monotonic() + 3.0
        while time.monotonic() < until:
            assert json.loads(socket.recv(10)).get("connected", True)
    assert board.sent().count("version") == 1 and "model" in board.sent()


def test_a_silent_board_is_no_more_connected_while_it_is_made_safe(tmp_path: Path) -> None:
    board = FakeBoard({"model": []})
    with page_of(board, tmp_path) as socket:
        awaited(socket, lambda state: not state.get("connected", True))
        assert "!" not in board.seen  # the last of what is tried to make it safe
        board.answers["model"] = ["ok"]
        awaited(socket, lambda state: state.get("connected"))


def test_what_a_board_believes_reaches_the_page(tmp_path: Path) -> None:
    with page_of(FakeBoard({"model": UNKNOWN}), tmp_path) as socket:
        state = awaited(socket, lambda state: state.get("unknown_s", [None])[0])
        assert state["unknown_s"] == [75.0] and state["target_a"] == [0.0]
        assert state["doing"] == ["not known for 75 s: it may still be hot from before power-on"]


def test_an_array_of_another_size_is_shown_and_driven_as_that(tmp_path: Path) -> None:
    board = FakeBoard()
    board.settings = {"rows": "1", "columns": "1"}
    with page_of(board, tmp_path) as socket:
        assert answer_to(socket, {"do": "record", "id": 1})["kind"] == "done"
        awaited(socket, lambda state: (state.get("recording") or {}).get("rows"))
        board.answers["telemetry csv 10"] = [TELEMETRY.replace(",fan", ",i2_a,v2_v,m2_c,fan"), "ok"]
        assert answer_to(socket, {"do": "set", "name": "rows", "value": "2", "id": 2})["kind"] == "done"
        state = awaited(socket, lambda state: state.get("springs") == 2)
        assert (state["rows"], state["cols"], state["recording"]) == (2, 1, None) and state["connected"]
        assert state["temperature_c"] == [None, None]
        for k in range(3):
            board.say(row(90000.0 + 0.1 * k).replace(",0.00,", ",0.500,0.100,21.00,0.00,"))
        awaited(socket, lambda state: state.get("temperature_c") == [20.0, 21.0])
        assert answer_to(socket, {"do": "pattern", "springs": "01", "id": 3})["kind"] == "done"
        own = f"http://{socket.request.headers['host']}"
        with connect(f"{own.replace('http', 'ws')}/ws", additional_headers={"origin": own}) as later:
            assert len(awaited(later, lambda told: told["kind"] == "history")["current_a"]) == 2
    (log,) = tmp_path.iterdir()
    assert log.suffix == ".csv" and len(read_table(log).frame)
    assert board.sent().count("version") == 1


def test_springs_are_shown_as_off_by_their_faults_and_the_boards_not_by_a_remark(tmp_path: Path) -> None:
    told = [
        "thermistor: no room is as it says, 21.00 degC holds",
        "found: supply 4.93 V, diodes 0.38 V +-0.03; declared: 5.00 V, 0.00 V",
    ]
    board = FakeBoard()
    with page_of(board, tmp_path) as socket:
        for faults, level in ((told, 30), (["spring 1: fault 15 sensor_mismatch", told[1]], 0), (["supply: off"], 0)):
            board.answers["faults"] = ["ok"]
            awaited(socket, lambda state: state.get("faults") == [])
            assert answer_to(socket, {"do": "level", "spring": 1, "level": 30, "id": 1})["kind"] == "done"
            board.answers["faults"] = [*faults, "ok"]
            state = awaited(socket, lambda state, last=faults[-1]: state.get("faults", [])[-1:] == [last])
            assert state["level"] == [level], faults


def test_a_sight_reaches_the_page_and_the_log_and_counts_as_no_corrupt_line(tmp_path: Path) -> None:
    board = FakeBoard()
    sight = "<sight|spring:1|t:96.250|lost|read:-1.32|read_sd:0.05|now_k:0.1|now_sd:1.0|shift_k:0.4|loss:1.20|heated|opened>"
    with page_of(board, tmp_path) as socket:
        socket.send(json.dumps({"do": "record", "id": 1}))
        awaited(socket, lambda state: state.get("recording"))
        board.say(sight)
        state = awaited(socket, lambda state: state.get("sights") == [1])
        now = awaited(socket, lambda now: now.get("time_s", 0.0) >= state.get("time_s", 0.0) + 0.3)
        assert now["corrupt"] == 0
    (log,) = tmp_path.iterdir()
    assert f"# {sight}\n" in log.read_text()


def test_each_id_of_the_page_is_of_one_element_and_the_script_finds_it() -> None:
    page = ROOT / "calibrate" / "src" / "ninespring" / "dashboard" / "page"
    ids = re.findall(r' id="([^"]+)"', (page / "index.html").read_text())
    assert len(ids) == len(set(ids))
    assert set(re.findall(r'\$\("([^"]+)"\)', (page / "page.js").read_text())) <= set(ids)


def test_limits_in_words_are_those_of_the_table() -> None:
    table = re.findall(r"^\| \d+ \| `([a-z]+)` \|", (ROOT / "docs" / "driving.md").read_text(), re.MULTILINE)
    assert set(table) == words.LIMITS.keys()


def test_what_a_board_believes_is_read_from_its_answer() -> None:
    lines = [
        "spring 1: 80.9 degC, 66.4 to 95.3, 2.4 K above martensite start (+-2.1), austenite 100.0 %, 94.8 to 100.0, hold",
        "  1.347 A, 0.296 V, 0.398712 W, target 1.370 A, limits supply: 1.200 A less",
        "spring 2: -3.0 degC, -9.4 to 4.3, 81.0 K below martensite start (+-7.2), austenite 0.0 %, 0.0 to 0.0",
        "  0.000 A, 0.000 V, 0.000000 W, target 0.000 A",
        "  waits 29 s: it may still be hot from before power-on",
        "spr\x01ng 3: 80.9 degC",
        "  1.000 A, 0.296 V, 0.398712 W, target 1.000 A",
        "spring 4: 70.0 degC, 20.0 to 120.0, 8.0 K below martensite start (+-30.2), austenite 0.0 %, 0.0 to 100.0",
        "  0.000 A, 0.000 V, 0.000000 W, target 0.000 A",
        "  not known for 75 s: it may still be hot from before power-on",
        "ambient: 21.50 degC",
    ]
    assert beliefs(lines) == {
        1: Belief(66.4, 95.3, 1.0, "hold", 1.37),
        2: Belief(-9.4, 4.3, 0.0, "", 0.0, "waits 29 s: it may still be hot from before power-on", 29.0),
        4: Belief(20.0, 120.0, 0.0, "", 0.0, "not known for 75 s: it may still be hot from before power-on", 75.0),
    }


def test_faults_and_states_in_words_are_those_of_the_table() -> None:
    table = [line.split(",") for line in (ROOT / "docs" / "codes.csv").read_text().splitlines()]
    faults = {int(number): text for kind, number, _, text in table if kind == "fault"}
    assert faults.keys() == words.FAULTS.keys()
    assert all(words.FAULTS[number] == text for number, text in faults.items() if number != 13)
    assert words.of_state("fault_2") == faults[2]


def test_what_hinders_is_said_in_the_terminal_too(tmp_path: Path) -> None:
    words = process("dashboard", "--listen", "127.0.0.1:0", "--port", tmp_path / "no")
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as running:
        assert running.stderr is not None
        said = running.stderr.readline()
        running.send_signal(signal.SIGINT)
    assert "no: cannot be opened (No such file or directory)" in said
    assert running.returncode == 0


def test_an_hour_is_kept_every_row_for_ten_minutes_and_one_a_second_before() -> None:
    kept_by = source.Source()
    for k in range(4500 * 4):  # 75 min at 4 Hz
        kept_by._remember({"time_s": k / 4.0, "temperature_c": [20.0 + k]})
    kept = [row["time_s"] for row in (*kept_by._older, *kept_by._history)]
    end = kept[-1]
    assert end - kept[0] == pytest.approx(3600.0, abs=1.5)
    steps = np.diff(kept)
    recent = np.array(kept[1:]) > end - 599.0
    assert set(np.round(steps[recent], 3)) == {0.25}
    assert steps.max() == 1.0
    assert np.mean(steps[~recent] == 1.0) > 0.99
    assert len(kept) < 3010 + 2410
    told = kept_by.history()
    assert len(told["time_s"]) <= 2 * 1200 + 2
    assert told["time_s"][0] == kept[0]
    kept_by._remember({"time_s": 1.0, "temperature_c": [20.0]})  # the board began anew
    assert kept_by.history()["time_s"] == [1.0]


@pytest.fixture(scope="module")
def chromium() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield chromium
        chromium.close()


@pytest.fixture
def browser(chromium: Browser) -> Iterator[Browser]:
    """Yield the browser, of which no page goes on drawing beside the next test."""
    yield chromium
    for context in chromium.contexts:
        context.close()


def opened(browser: Browser, dashboard: Dashboard) -> Page:
    page = browser.new_page()
    page.set_default_timeout(60_000)
    page.problems = []
    page.on("pageerror", lambda error: page.problems.append(str(error)))
    page.goto(dashboard.url, wait_until="commit")  # the plots' library may come later
    page.wait_for_selector("#array button")
    return page


def spring(page: Page, number: int, part: str = "") -> object:
    return page.locator(f"#array button:nth-child({number}){' .' + part if part else ''}")


@needs_browser
def test_a_lost_port_comes_back_without_a_reload(browser: Browser, tmp_path: Path) -> None:
    (tmp_path / "port").symlink_to((first := FakeBoard()).port)
    first.stream, first.every_s = (row(0.1 * k) for k in range(10, 9999)), 0.1
    with Dashboard(tmp_path, "--port", tmp_path / "port", ends=signal.SIGTERM) as dashboard:
        page = opened(browser, dashboard)
        expect(page.locator("#connection")).to_have_text("connected")
        page.click("#record")
        expect(page.locator("#recording")).to_contain_text(re.compile(r": [1-9]\d rows"))
        first.pull()
        expect(page.locator("#connection")).to_have_text("no board")
        expect(page.locator("#trouble")).to_contain_text("went away")
        expect(page.locator("#trouble")).to_contain_text("Since then")  # how it was lost stays, while it is looked for
        expect(page.locator("#trouble")).to_contain_text("went away")
        (log,) = tmp_path.glob("*.csv")
        assert len(read_table(log).frame) >= 10
        second = FakeBoard(stream=(row(0.1 * k) for k in range(10, 9999)), every_s=0.1)
        (tmp_path / "port").unlink()
        (tmp_path / "port").symlink_to(second.port)
        expect(page.locator("#connection")).to_have_text("connected", timeout=15_000)
        expect(page.locator("#trouble")).to_be_hidden()
        spring(page, 1).click()
        expect(spring(page, 1)).to_have_class(re.compile("on"))
        assert "on 1 100" in second.sent()
    assert second.sent().index("off all") > second.sent().index("on 1 100")


@needs_browser
def test_a_log_is_replayed_measured_beside_model(browser: Browser, make_log, tmp_path: Path) -> None:
    def believe(columns: dict[str, object]) -> None:
        columns |= {f"m{k}_c": columns[f"t{k}_c"] + 5.0 for k in range(1, 10)}

    with Dashboard(tmp_path, "--replay", make_log(seconds=200, change=believe)) as dashboard:
        page = opened(browser, dashboard)
        expect(page.locator(".live").first).to_be_hidden()
        expect(spring(page, 1, "measured")).to_contain_text("°")
        parts = (
            "tile => ['temperature', 'measured'].map((one) => parseFloat(tile.querySelector('.' + one).textContent))"
        )
        shown, measured = spring(page, 1).evaluate(parts)  # of one moment
        assert shown - measured == pytest.approx(5.0, abs=0.11)  # as they are rounded
        page.fill("#seek", "150")
        expect(page.locator("#time")).to_have_text(re.compile(r"1[5-9]\d\.\d"))
        page.click("#pause")
        expect(page.locator("#state")).to_contain_text("paused")
        before = page.inner_text("#time")
        time.sleep(0.5)
        assert page.inner_text("#time") == before


@needs_browser
def test_what_is_not_known_yet_or_old_is_shown_as_that(browser: Browser, tmp_path: Path) -> None:
    board, rows = FakeBoard({"model": UNKNOWN}), Rows()
    board.stream, board.every_s = rows, 0.1
    with Dashboard(tmp_path, "--port", board.port) as dashboard:
        page = opened(browser, dashboard)
        expect(page.locator("#unknown")).to_contain_text("75 s")
        expect(page.locator("#state")).to_have_text("not known yet")
        expect(page.locator("#hottest")).to_have_text("not known")
        expect(spring(page, 1, "temperature")).to_have_text("?")
        page.click("#cold")
        begun_s = time.monotonic()
        while "model cold" not in board.sent():  # it is sent; the board may read it a moment later
            assert time.monotonic() - begun_s < 10.0
            time.sleep(0.01)
        board.answers["model"] = ["ok"]
        expect(page.locator("#unknown")).to_be_hidden()
        expect(page.locator("#state")).to_have_text("ready")
        expect(page.locator("#old")).to_be_hidden()
        rows.frozen = True
        expect(page.locator("#old")).to_have_text(re.compile(r"What is shown is [2-9] s old"))
        expect(page.locator("body.old")).to_have_count(1)
        rows.frozen = False  # the board is asked for it again
        expect(page.locator("#old")).to_be_hidden()
        assert board.sent().count("telemetry csv 10") >= 2
        assert page.problems == []


@needs_browser
def test_a_list_that_is_played_outlives_a_reload_and_can_be_ended(browser: Browser, tmp_path: Path) -> None:
    board = FakeBoard(stream=Rows(), every_s=0.1)
    with Dashboard(tmp_path, "--port", board.port) as dashboard:
        page = opened(browser, dashboard)
        page.click("#add")
        page.click("#draw button")
        page.click("#add")
        page.fill("#seconds", "0.5")
        page.click("#play")
        expect(page.locator("#list li.now")).to_have_count(1)
        page.reload()
        other = opened(browser, dashboard)
        for one in (page, other):
            expect(one.locator("#list li")).to_have_count(2)
            expect(one.locator("#seconds")).to_have_value("0.5")
        other.click("#end-play")
        expect(page.locator("#end-play")).to_be_hidden()
        played = board.sent().count("pattern 1")
        time.sleep(1.2)
        assert board.sent().count("pattern 1") == played >= 1
        assert "off all" not in board.sent()
        page.reload()
        expect(page.locator("#list li")).to_have_count(2)


# The board is simulated from here to the end of this file, which takes most of a core: no other test comes behind.


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Dashboard, Path]]:
    folder = tmp_path_factory.mktemp("recordings")
    dashboard = Dashboard(folder, "--simulate")
    yield dashboard, folder
    assert dashboard.end() == 0


def on_a_page(test: Callable[..., None]) -> Callable[..., None]:
    """Mark a test that needs a browser and a simulated board."""
    return needs_browser(needs_board(test))


@pytest.fixture
def page(browser: Browser, simulated: tuple[Dashboard, Path]) -> Iterator[Page]:
    """Yield a page of the simulated board, in which nothing has gone wrong at its end."""
    page = opened(browser, simulated[0])
    yield page
    assert page.problems == []


other = page
"""A second one."""


def enter(page: Page, line: str) -> None:
    """Type a line into the page's console."""
    page.fill("#line", line)
    page.press("#line", "Enter")


def sum_a(page: Page) -> float:
    return float(page.inner_text("#sum"))


@on_a_page
def test_a_click_heats_a_spring_and_stop_ends_it_from_button_and_key(page: Page) -> None:
    page.select_option("#policy", "open")  # a set current at once: precompensate waits until nothing can be hot
    expect(page.locator("#policy")).to_have_value("open")
    for press in (lambda: page.click("#stop"), lambda: page.keyboard.press("Escape")):
        page.click("#clear")
        spring(page, 5).click()
        expect(spring(page, 5, "amps")).to_have_text(re.compile(r"^1\.[45]\d A"), timeout=15_000)
        expect(spring(page, 5)).to_have_class(re.compile("on"))
        expect(spring(page, 5, "bounds")).to_have_text(re.compile(r"^-?\d+…\d+°$"))
        assert sum_a(page) > 1.0
        press()
        expect(page.locator("#sum")).to_have_text("0.00", timeout=30_000)
        expect(page.locator("#state")).to_have_text("stopped")
        expect(page.locator("#faults li").first).to_contain_text("stopped")
        expect(spring(page, 5)).not_to_have_class(re.compile("on"))
    page.click("#clear")
    expect(page.locator("#state")).to_have_text(re.compile("^(ready|not known yet)$"))


@on_a_page
def test_why_a_spring_is_believed_to_be_where_it_is_is_shown_and_follows(page: Page) -> None:
    page.click("#clear")
    page.click("#why-card summary")
    page.select_option("#why-spring", "7")
    expect(page.locator("#why")).to_contain_text("spring 7 in the last 4 hours")  # nothing yet
    enter(page, "model cold")
    expect(page.locator("#why")).to_contain_text("it is said to be known", timeout=30_000)
    expect(page.locator("#why")).to_contain_text("of martensite start: now ")
    page.select_option("#why-spring", "2")
    expect(page.locator("#why")).to_contain_text("it is said to be known")
    expect(page.locator("#log")).not_to_contain_text(
        "it is said to be known"
    )  # each is told once, where it was asked for


@on_a_page
def test_two_pages_agree_and_patterns_are_drawn_and_played(page: Page, other: Page) -> None:
    page.click("[data-make=ring]")
    for one in (page, other):
        expect(one.locator("#array button.on")).to_have_count(8)
        expect(spring(one, 5)).not_to_have_class(re.compile("on"))
    other.click("#draw button:nth-child(1)")
    other.click("#draw button:nth-child(9)")
    other.click("#apply")
    expect(page.locator("#array button.on")).to_have_count(2)
    other.click("#add")
    other.click("#draw button:nth-child(1)")
    other.click("#add")
    other.fill("#seconds", "1")
    other.click("#play")
    for count in (1, 2, 1):
        expect(page.locator("#array button.on")).to_have_count(count)
    page.click("[data-all=off]")
    expect(other.locator("#array button.on")).to_have_count(0)
    page.fill("#fan", "50")  # with its events, as when the slider is let go
    expect(other.locator("#fan-shown")).to_have_text("50 %")
    other.select_option("#policy", "precompensate")
    expect(page.locator("#policy")).to_have_value("precompensate")
    other.select_option("#policy", "open")
    page.fill("#fan", "0")


@on_a_page
def test_settings_have_units_and_ranges_and_a_refusal_is_in_the_boards_words(page: Page) -> None:
    page.click("#settings-card summary")
    line = page.locator("tr[data-name=supply_limit_a]")
    expect(line).to_contain_text("A")
    expect(line).to_contain_text("0.1 .. 60")
    field = line.locator("input")
    field.fill("12.5")
    field.press("Enter")
    expect(page.locator("#supply")).to_have_text("of 12.5 A")
    field.fill("99")
    field.press("Enter")
    expect(line.locator(".words")).to_contain_text("a number is out of range")
    for wrong in ("0,006", "abc", ""):
        field.fill(wrong)
        field.press("Enter")
        expect(line.locator(".words")).to_contain_text(f"{wrong or 'nothing'}")
        expect(line.locator(".words")).to_contain_text("is not a number with a point")
    field.fill("12")  # and the cell takes what is right
    field.press("Enter")
    expect(page.locator("#supply")).to_have_text("of 12.0 A")
    expect(line.locator(".words")).to_be_empty()
    field.fill("12.5")
    field.press("Enter")
    expect(page.locator("#supply")).to_have_text("of 12.5 A")
    enter(page, "frobnicate")
    expect(page.locator("#log li.bad").first).to_contain_text("unknown word")
    enter(page, "version")
    expect(page.locator("#log li").first).to_contain_text("ninespring")
    enter(page, "$defaults")  # ends telemetry on the board
    expect(page.locator("#supply")).to_have_text("of 15.0 A")
    before = float(page.inner_text("#time"))
    until = time.monotonic() + 30.0
    while float(page.inner_text("#time")) <= before + 1.0:
        assert time.monotonic() < until
        time.sleep(0.1)


@on_a_page
def test_patterns_are_shared_by_a_link_that_drives_nothing(page: Page) -> None:
    page.click("#draw button:nth-child(5)")
    page.click("#add")
    page.fill("#seconds", "7")
    page.click("#share")
    expect(page.locator("#log")).to_contain_text(re.compile(r"#patterns=000010000&every=7"))
    assert page.evaluate("location.hash") == "#patterns=000010000&every=7"
    assert "token" not in page.evaluate("location.href")
    # whoever opens it sees the list, and has nothing driven; a list of one's own is kept
    page.evaluate("location.hash = '#patterns=111101111,x,100000001&every=3'")
    expect(page.locator("#list li")).to_have_count(2)
    expect(page.locator("#seconds")).to_have_value("3")
    expect(page.locator("#array button.on")).to_have_count(0)
    page.reload()
    expect(page.locator("#list li")).to_have_count(2)
    page.click("#own")
    expect(page.locator("#list li")).to_have_count(1)
    expect(page.locator("#list li").first).to_contain_text("000010000")
