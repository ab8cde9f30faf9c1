"""The live page in a real browser, on the simulated board: what it shows is what the board does, and stop stops."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from fake_board import FakeBoard, row
from ninespring.belief import Belief, beliefs
from ninespring.dashboard import words
from ninespring.logs import read_log, read_table
from playwright.sync_api import Browser, Page, expect, sync_playwright
from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect

expect.set_options(timeout=30_000)  # ms; the board is simulated beside other tests, on as few as two cores
ROOT = Path(__file__).resolve().parents[2]
SIM = Path(os.environ.get("NINESPRING_SIM", ROOT / "build" / "host" / "ninespring-sim"))
ELF = Path(os.environ.get("NINESPRING_AVR_DIR", ROOT / "build" / "avr")) / "firmware.elf"
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")

needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="SKIPPED: no Chromium: script/setup installs it")
needs_board = pytest.mark.skipif(
    not (SIM.exists() and ELF.exists()), reason=f"SKIPPED: {SIM} or {ELF} is not there: script/build makes them"
)


class Dashboard:
    """`ninespring dashboard` in its own process, ended as Ctrl-C would."""

    def __init__(self, folder: Path, *words: object) -> None:
        command = [sys.executable, "-m", "ninespring", "dashboard", "--listen", "127.0.0.1:0", "--folder", str(folder)]
        self.process = subprocess.Popen([*command, *map(str, words)], stdout=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        self.url = self.process.stdout.readline().split()[0]
        assert self.url.startswith("http://127.0.0.1:")

    @property
    def address(self) -> str:
        return self.url.removeprefix("http://").rstrip("/")

    def end(self, how: signal.Signals = signal.SIGINT) -> int:
        if self.process.poll() is None:
            self.process.send_signal(how)
        return self.process.wait(30)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield chromium
        chromium.close()


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Dashboard, Path]]:
    folder = tmp_path_factory.mktemp("recordings")
    dashboard = Dashboard(folder, "--simulate")
    yield dashboard, folder
    assert dashboard.end() == 0


def opened(browser: Browser, dashboard: Dashboard) -> Page:
    page = browser.new_page()
    page.set_default_timeout(20_000)
    page.problems = []
    page.on("pageerror", lambda error: page.problems.append(str(error)))
    page.goto(dashboard.url)
    page.wait_for_selector("#array button")
    return page


def spring(page: Page, number: int, part: str = "") -> object:
    return page.locator(f"#array button:nth-child({number}){' .' + part if part else ''}")


def sum_a(page: Page) -> float:
    return float(page.inner_text("#sum"))


@needs_browser
@needs_board
def test_a_click_heats_a_spring_and_stop_ends_it_from_button_and_key(
    browser: Browser, simulated: tuple[Dashboard, Path]
) -> None:
    page = opened(browser, simulated[0])
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
    expect(page.locator("#state")).to_have_text("ready")
    assert page.problems == []
    page.close()


@needs_browser
@needs_board
def test_two_pages_agree_and_patterns_are_drawn_and_played(browser: Browser, simulated: tuple[Dashboard, Path]) -> None:
    one, other = opened(browser, simulated[0]), opened(browser, simulated[0])
    one.click("[data-make=ring]")
    for page in (one, other):
        expect(page.locator("#array button.on")).to_have_count(8)
        expect(spring(page, 5)).not_to_have_class(re.compile("on"))
    other.click("#draw button:nth-child(1)")
    other.click("#draw button:nth-child(9)")
    other.click("#apply")
    expect(one.locator("#array button.on")).to_have_count(2)
    other.click("#add")
    other.click("#draw button:nth-child(1)")
    other.click("#add")
    other.fill("#seconds", "1")
    other.click("#play")
    for count in (1, 2, 1):
        expect(one.locator("#array button.on")).to_have_count(count)
    one.click("[data-all=off]")
    expect(other.locator("#array button.on")).to_have_count(0)
    one.fill("#fan", "50")  # with its events, as when the slider is let go
    expect(other.locator("#fan-shown")).to_have_text("50 %")
    other.select_option("#policy", "precompensate")
    expect(one.locator("#policy")).to_have_value("precompensate")
    other.select_option("#policy", "open")
    one.fill("#fan", "0")
    one.close()
    other.close()


@needs_browser
@needs_board
def test_settings_have_units_and_ranges_and_a_refusal_is_in_the_boards_words(
    browser: Browser, simulated: tuple[Dashboard, Path]
) -> None:
    page = opened(browser, simulated[0])
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
    expect(page.locator("#supply")).to_have_text("of 12.5 A")
    page.fill("#line", "frobnicate")
    page.press("#line", "Enter")
    expect(page.locator("#log li.bad").first).to_contain_text("unknown word")
    page.fill("#line", "version")
    page.press("#line", "Enter")
    expect(page.locator("#log li").first).to_contain_text("ninespring")
    page.close()


@needs_browser
@needs_board
def test_one_click_records_a_log_that_can_be_read(browser: Browser, simulated: tuple[Dashboard, Path]) -> None:
    dashboard, folder = simulated
    page = opened(browser, dashboard)
    page.click("#record")
    expect(page.locator("#recording")).to_contain_text(re.compile(r": [1-9]\d rows"))
    page.click("#record")
    expect(page.locator("#log li").first).to_contain_text("rows in")
    (log,) = folder.glob("*.csv")
    assert log.read_text().startswith("# recorded: ") and "\n# $loss_w_per_k=" in log.read_text()
    assert read_log(log, 9, temperatures=False).duration_s > 0.9
    page.close()


@needs_browser
def test_a_lost_port_comes_back_without_a_reload(browser: Browser, tmp_path: Path) -> None:
    (tmp_path / "port").symlink_to((first := FakeBoard()).port)
    first.stream, first.every_s = (row(0.1 * k) for k in range(10, 9999)), 0.1
    dashboard = Dashboard(tmp_path, "--port", tmp_path / "port")
    try:
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
        assert len(read_table(log, ("state",)).frame) >= 10
        second = FakeBoard()
        second.stream, second.every_s = (row(0.1 * k) for k in range(10, 9999)), 0.1
        (tmp_path / "port").unlink()
        (tmp_path / "port").symlink_to(second.port)
        expect(page.locator("#connection")).to_have_text("connected", timeout=15_000)
        expect(page.locator("#trouble")).to_be_hidden()
        spring(page, 1).click()
        expect(spring(page, 1)).to_have_class(re.compile("on"))
        assert "on 1 100" in second.sent()
    finally:
        assert dashboard.end(signal.SIGTERM) == 0
    assert second.sent().index("off all") > second.sent().index("on 1 100")


@needs_browser
def test_a_log_is_replayed_measured_beside_model(browser: Browser, make_log, tmp_path: Path) -> None:
    def believe(columns: dict[str, object]) -> None:
        columns |= {f"m{k}_c": columns[f"t{k}_c"] + 5.0 for k in range(1, 10)}

    dashboard = Dashboard(tmp_path, "--replay", make_log(seconds=200, change=believe))
    try:
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
    finally:
        assert dashboard.end() == 0


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


def test_foreign_pages_are_refused_and_malformed_messages_change_nothing(tmp_path: Path) -> None:
    board = FakeBoard()
    board.stream, board.every_s = (row(0.1 * k) for k in range(10, 9999)), 0.1
    dashboard = Dashboard(tmp_path, "--port", board.port)
    own = {"origin": dashboard.url.rstrip("/")}

    url = f"ws://{dashboard.address}/ws"

    def talk() -> None:
        for headers in ({"origin": "http://evil.example"}, {"origin": "null"}, {}):
            with pytest.raises(InvalidStatus, match="403"):
                connect(url, additional_headers=headers)
        with connect(url, additional_headers=own) as socket:
            for one in MALFORMED:
                socket.send(one)
                while (kind := json.loads(socket.recv(10))["kind"]) != "refused":
                    assert kind in ("state", "history", "settings"), one
            socket.send('{"do": "level", "spring": 1, "level": 50, "id": 7}')
            while (answer := json.loads(socket.recv(10)))["kind"] != "done":
                pass
            assert answer["id"] == 7
        with connect(url, additional_headers=own) as socket:
            socket.send(b"\x00\x01")  # not text: this page is gone, nobody else's

    try:
        while "telemetry csv 10" not in board.seen:
            time.sleep(0.05)
        time.sleep(0.5)
        assert status_of(dashboard) == "200"
        assert status_of(dashboard, "Host: evil.example") == "403"
        assert status_of(dashboard, "Origin: http://evil.example") == "403"
        talk()
        sent = [line for line in board.sent() if line not in ("version", "telemetry off", "$$", "model", "faults")]
        assert sent == ["telemetry csv 10", "on 1 50"]
    finally:
        assert dashboard.end(signal.SIGHUP) == 0
    assert "off all" in board.sent()


@contextmanager
def page_of(board: FakeBoard, folder: Path, every_s: float = 0.1) -> Iterator[ClientConnection]:
    """Yield a page's socket once its dashboard has found the board, which streams rows; the dashboard ends well."""
    board.stream, board.every_s = (row(0.1 * k) for k in range(10, 99999)), every_s
    dashboard = Dashboard(folder, "--port", board.port)
    try:
        with connect(
            f"ws://{dashboard.address}/ws", additional_headers={"origin": dashboard.url.rstrip("/")}
        ) as socket:
            while not json.loads(socket.recv(10)).get("connected"):
                pass
            yield socket
    finally:
        assert dashboard.end() == 0


def test_a_pages_wishes_are_carried_out_in_their_order(tmp_path: Path) -> None:
    board = FakeBoard()
    with page_of(board, tmp_path) as socket:
        for level in range(1, 101):
            socket.send(json.dumps({"do": "level", "spring": 1, "level": level, "id": level}))
        answered = []
        while len(answered) < 100:
            if (got := json.loads(socket.recv(10)))["kind"] in ("done", "refused"):
                answered.append((got["kind"], got["id"]))
    assert answered == [("done", level) for level in range(1, 101)]
    assert [line for line in board.sent() if line.startswith("on ")] == [f"on 1 {level}" for level in range(1, 101)]


def test_a_full_disk_ends_the_recording_and_nothing_else(small_disk: Path) -> None:
    with page_of(FakeBoard(), small_disk, 0.01) as socket:
        socket.send('{"do": "record"}')
        while "No space left on device" not in (state := json.loads(socket.recv(30))).get("said", ""):
            pass
        assert state["connected"] and state["recording"] is None
        while json.loads(socket.recv(10)).get("time_s", 0.0) <= state["time_s"]:
            pass  # the array is shown as before
    (log,) = small_disk.iterdir()
    assert log.suffix == ".csv" and log.read_text().endswith("\n")
    assert len(read_table(log, ("state",)).frame) > 50


def test_a_stop_that_drops_what_is_being_answered_loses_no_board(tmp_path: Path) -> None:
    board = FakeBoard({"model": ["error:12 dropped by the stop"]})
    with page_of(board, tmp_path) as socket:
        until = time.monotonic() + 3.0
        while time.monotonic() < until:
            assert json.loads(socket.recv(10)).get("connected", True)
    assert board.sent().count("version") == 1 and "model" in board.sent()


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
        "ambient: 21.50 degC",
    ]
    assert beliefs(lines) == {
        1: Belief(66.4, 95.3, 1.0, "hold", 1.37),
        2: Belief(-9.4, 4.3, 0.0, "", 0.0, "waits 29 s: it may still be hot from before power-on"),
    }


def test_faults_and_states_in_words_are_those_of_the_table() -> None:
    table = [line.split(",") for line in (ROOT / "docs" / "codes.csv").read_text().splitlines()]
    faults = {int(number): text for kind, number, _, text in table if kind == "fault"}
    assert faults.keys() == words.FAULTS.keys()
    assert all(words.FAULTS[number] == text for number, text in faults.items() if number != 13)
    assert words.of_state("fault_2") == faults[2]


def test_what_hinders_is_said_in_the_terminal_too(tmp_path: Path) -> None:
    words = [sys.executable, "-m", "ninespring", "dashboard", "--listen", "127.0.0.1:0", "--port", str(tmp_path / "no")]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        said = process.stderr.readline()
        process.send_signal(signal.SIGINT)
    assert "no: cannot be opened (No such file or directory)" in said
    assert process.returncode == 0


@pytest.mark.parametrize(
    "arguments", [(), ("--simulate", "--port", "x"), ("--simulate", "--listen", "here"), ("--replay", "no-such.csv")]
)
def test_arguments_that_do_not_go_together_are_refused(arguments: tuple[str, ...]) -> None:
    words = [sys.executable, "-m", "ninespring", "dashboard", *arguments]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1
