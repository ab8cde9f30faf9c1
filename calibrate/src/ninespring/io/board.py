"""A board and its console (docs/console.md): one line out, lines in until `ok` or `error:N`."""

from __future__ import annotations

import contextlib
import math
import re
import subprocess
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import DECIMAL_COMMA, InputError, RefusedError, WorkError
from . import ranges
from .belief import Belief, beliefs
from .logs import COLUMN, EXTRA, read_text
from .port import Port
from .simulated import simulated_board

if TYPE_CHECKING:
    import pandas as pd

ERROR = re.compile(r"^error:(\d+) ?(.*)$")
TELEMETRY = re.compile(r"^(?:\d+\.\d+,.*|<.*>|~S[0-9A-F]+)$")
"""A row, a status line, or a tick's inputs: comes at any moment, also in the middle of an answer."""
FOUND_WITHIN_S = 5.0
"""So soon a board is found, or it is said that there is none."""
BOOTING_S = 2.0
"""A Mega's boot loader listens for so long after a reset, and takes what is sent meanwhile for a program."""
CSV = 1
"""What `telemetry csv` makes of `telemetry_format`."""
SIMULATED = "simulated"
PATIENCE = 6.0
"""So many times longer an answer of the simulated board is awaited: it has what the machine leaves it."""
HOST_TIMEOUT_S = 5
"""Springs go off when nothing came from here for so long, where the board has that setting."""
ALIVE_EVERY_S = 1.0
"""By the clock here and by the board's: that of a simulated one may run faster."""
LOOK_EVERY_S = 1.0
"""By the board's clock: so often `stream` asks what telemetry does not tell."""
SCRIPT_ALIVE_EVERY_S = 0.2
"""For a script that may sleep or compute between two lines: a simulated board's second may be so short."""
DRIVES = re.compile(r"\s*(on|pattern)\b", re.IGNORECASE)
LINE = re.compile("[ -~]+")
"""What the console takes for a line ..."""
AT_ONCE = re.compile("[!?]")
"""... and what is no part of one: it acts as it comes."""
SAVES = re.compile(r"\s*\$save\s*", re.IGNORECASE)
STATUS = re.compile(r"^<(off|on|fault|locked)\|t:.*>$")
"""What `?` is answered with."""
CLOCK = re.compile(r"(?P<row_s>\d+\.\d+),|~S(?P<tick>[0-9A-F]{4})")
"""The board's time in a row, or in ticks of 20 ms, modulo 65536."""


@dataclass(frozen=True)
class Reading:
    """One row of telemetry: arrays have one entry per spring (n,)."""

    time_s: float
    current_a: np.ndarray
    voltage_v: np.ndarray
    temperature_c: np.ndarray
    """What the model on the chip believes."""
    duty: np.ndarray
    fan: float
    ambient_c: float
    state: str
    low_c: np.ndarray
    """The temperature is above this and below `high_c` in 99 of 100 cases, as the board believes; NaN where it was not asked."""
    high_c: np.ndarray
    austenite: np.ndarray
    """The phase that the board believes, 0..1; NaN where it was not asked."""

    def __repr__(self) -> str:
        hottest = int(np.argmax(self.temperature_c))
        return (
            f"<{self.time_s:.1f} s, {self.current_a.sum():.2f} A, hottest spring {hottest + 1} at "
            f"{self.temperature_c[hottest]:.1f} degC, {self.state}>"
        )


WARM_K = 5.0
"""Above the room: then the board calls a spring warm itself, and does not believe that it loses more than was declared before."""


class Board:
    """A board at a serial port. Leaving its `with` block switches all springs off.

    >>> with Board("/dev/ttyACM0") as board:  # or Board("simulated")
    ...     board.on(5, 80)
    ...     print(board.read().temperature_c)
    """

    def __init__(
        self,
        port: str = SIMULATED,
        *,
        stopped: Callable[[], bool] = lambda: False,
        off_at_end: bool = True,
        simulated: Sequence[str] = (),
    ) -> None:
        """Open the port and find the board; `stopped` is asked while waiting, and ends it with KeyboardInterrupt.

        `simulated`: further words for the simulator, where it is started.
        """
        self.off_at_end = off_at_end
        self.stopped = stopped
        self.version: list[str] = []
        """What the board says of itself."""
        self._telemetry: deque[str] = deque()
        self._alive_s = 0.0
        self._alive_board_s = 0.0
        self._owed = 0
        """Answers that are still to come."""
        self._lent: dict[str, tuple[str, int]] = {}
        """Settings that are this program's for a while: as they were, and as they are here."""
        self._guards = False
        """Whether somebody has seen to that setting."""
        self._script_ends = threading.Event()
        self.thermometers = ""
        """Port of the simulated board's thermometers."""
        self._simulated: subprocess.Popen[str] | None = None
        self.patience = PATIENCE if port == SIMULATED else 1.0
        """Times as long as usual everything may take."""
        with contextlib.ExitStack() as undo:
            if port == SIMULATED:
                self._simulated, port, self.thermometers = simulated_board(simulated)
                undo.callback(self._end_simulation)
            self.port = port
            self._port = Port(port)
            undo.callback(self._port.close)
            self._greet()
            undo.pop_all()

    def __repr__(self) -> str:
        return f"<board at {self.port}: {self.version[0] if self.version else 'closed'}>"

    def __enter__(self) -> Board:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Switch everything off (unless told otherwise) and close the port."""
        try:
            if self.off_at_end:
                self.make_safe()
        finally:
            self._script_ends.set()
            self._port.close()
            self._end_simulation()

    def _end_simulation(self) -> None:
        if self._simulated:
            self._simulated.terminate()
            self._simulated.communicate(timeout=10)
            self._simulated = None

    def _greet(self) -> None:
        """Find out what is there: a board says `ninespring` to `version`."""
        until = time.monotonic() + self.patience * FOUND_WITHIN_S - 0.2
        heard = [self._wait(time.monotonic() + BOOTING_S) or ""] if self._port.resets_the_board else []
        while not self.version and (left := until - time.monotonic()) > 0:
            self._port.write("\nversion\n")
            ends = time.monotonic() + min(self.patience, left)
            while not self.version and (line := self._wait(ends)) is not None:
                heard.append(line)
                self.version = [line] if line.startswith("ninespring ") else []
        if not self.version and (said := next(filter(None, heard), "")):
            shown = re.sub(r"[^ -~]", "?", said)[:40]
            raise WorkError(f"{self.port}: what is there is no Ninespring board: it says '{shown}'")
        if not self.version:
            raise WorkError(f"{self.port}: silent at 115200 baud: is it the right port, does the board run Ninespring?")
        # the rest of the answer, and those to what was asked while the board was still starting
        sent = ("echo off", "telemetry off")  # a board that knows no echo refuses the first
        self._port.write("".join(f"{line}\n" for line in sent))
        quiet_s, answered = 0.2 * self.patience, False
        until = time.monotonic() + self.patience
        while (line := self._wait(until)) is not None:
            if TELEMETRY.match(line):
                continue
            if not answered and line not in ("", "ok", "version", *sent) and not ERROR.match(line):
                self.version.append(line)
            answered = answered or line == "ok"
            until = time.monotonic() + (quiet_s if answered else self.patience)

    def _wait(self, until_s: float) -> str | None:
        line = None if self.stopped() else self._port.read_line(until_s, self.stopped)
        if line is None and self.stopped():
            raise KeyboardInterrupt
        return line

    def ask(self, line: str, timeout_s: float = 3.0) -> list[str]:
        """Send one line; return the answer's lines. WorkError where it is refused, or nothing of it comes for so long.

        Telemetry that comes meanwhile is kept for `next_line`. What `$save` keeps is what was set, not what this program needs
        for a while.
        """
        if self._lent and SAVES.fullmatch(line):
            with self._given_back():
                return self.ask(line, timeout_s)
        if not LINE.fullmatch(line):
            raise InputError(f"{line[:40]!r} is not one line of plain ASCII")
        if AT_ONCE.search(line):
            raise InputError(f"{line[:40]!r}: ! and ? are no part of a line, they act at once: stop_now, status")
        if DRIVES.match(line):
            self._guard_script()
        self._port.write(line + "\n")
        self._alive_s = time.monotonic()
        timeout_s *= self.patience
        until = self._alive_s + timeout_s
        self._owed += 1
        answer: list[str] = []
        while (got := self._wait(until)) is not None:
            match = ERROR.match(got)
            if got == "ok" or match:
                self._owed -= 1
                if self._owed:  # the end of an answer that was not waited for
                    answer = []
                    continue
            if got == "ok":
                return answer
            if match:
                raise RefusedError(f"'{line}' refused: error {match[1]} {match[2]}".rstrip(), answer)
            if TELEMETRY.match(got):
                self._telemetry.append(got)
            elif got and got != line:  # that is the board's echo
                answer.append(got)
                until = time.monotonic() + timeout_s
        self._owed = 0
        raise WorkError(f"{self.port}: no answer to '{line}' for {timeout_s:g} s")

    def status(self, timeout_s: float = 3.0) -> str:
        """Return the line of status that `?` is answered with, at any moment."""
        self._port.write("?")
        until = time.monotonic() + self.patience * timeout_s
        while (got := self._wait(until)) is not None:
            if STATUS.match(got):
                return got
            if TELEMETRY.match(got):
                self._telemetry.append(got)
        raise RefusedError(f"'?' is not answered within {self.patience * timeout_s:g} s")

    def next_line(self, until_s: float) -> str | None:
        """Return the next line that nobody asked for (telemetry), None where none came until that monotonic time."""
        if self._telemetry:
            return self._came(self._telemetry.popleft())
        while True:
            if time.monotonic() >= self._alive_s + ALIVE_EVERY_S:
                self._show_life()
            if (line := self._wait(min(until_s, self._alive_s + ALIVE_EVERY_S))) is not None:
                return self._came(line)
            if time.monotonic() >= until_s:
                return None

    def telemetry(self, hz: int, again: bool = False) -> list[str]:
        """Have the board send rows, so many a second, until `telemetry_off`; return their columns. WorkError where it names none that can be read.

        `again`: nobody has set another rate since the last time, so it is not asked for: a spring may be on meanwhile.
        """
        if not (again and "telemetry_hz" in self._lent):
            self._borrow("telemetry_hz", hz, self._setting("telemetry_hz"))
            self._borrow("telemetry_format", CSV, self._setting("telemetry_format"))
        for _ in range(3):
            if names := next(filter(None, map(telemetry_names, self.ask(f"telemetry csv {hz}"))), None):
                return names
        raise WorkError(f"{self.port}: the board's telemetry has no header that can be read")

    def next_row(self, names: list[str], until_s: float) -> dict[str, str] | None:
        """Return the next row of telemetry that is whole, by column; None where none came until that monotonic time."""
        while (line := self.next_line(until_s)) is not None:
            cells = line.split(",")
            if line[:1].isdigit() and len(cells) == len(names):
                return dict(zip(names, cells, strict=True))
        return None

    def _show_life(self) -> None:
        self._alive_s = time.monotonic()
        self._port.write("\n")  # an empty line is not answered, but shows that this end lives

    def _came(self, line: str) -> str:
        if match := CLOCK.match(line):
            board_s = float(match["row_s"] or 0.02 * int(match["tick"] or "0", 16))
            if not 0.0 <= board_s - self._alive_board_s < ALIVE_EVERY_S:
                self._alive_board_s = board_s
                self._show_life()
        return line

    def settings(self) -> dict[str, str]:
        """Return the settings as `$$` shows them, without their units."""
        pairs = (line[1:].split("=", 1) for line in self.ask("$$", 10.0) if line.startswith("$") and "=" in line)
        return {name: value.split()[0] for name, value in pairs if value.strip()}

    def _setting(self, name: str) -> str:
        """Return a setting, empty where the board has it not."""
        with contextlib.suppress(RefusedError):
            for line in self.ask(f"${name}"):
                if line.startswith(f"${name}="):
                    return line.partition("=")[2]
        return ""

    def _borrow(self, name: str, here: int, has: str) -> None:
        """Note what a setting is, before it is another here; what was set here is not what the board has."""
        was, mine = self._lent.get(name, ("", here))
        if has:
            self._lent[name] = was if was and float(has) == mine else has, here

    def as_lent(self, settings: dict[str, str]) -> dict[str, str]:
        """Return a board's settings as they will be when this program needs nothing of them any more."""
        lent = {name: was for name, (was, here) in self._lent.items() if float(settings.get(name, math.nan)) == here}
        return settings | lent

    def guard(self, settings: dict[str, str]) -> None:
        """Have the springs go off when this program falls silent, where the board can: ended by `make_safe`."""
        self._guards = True
        if "host_timeout_s" in settings:
            self._borrow("host_timeout_s", HOST_TIMEOUT_S, settings["host_timeout_s"])
            self.ask(f"$host_timeout_s={HOST_TIMEOUT_S}")

    def _guard_script(self) -> None:
        """Do so for a script that is about to drive and has not: it is kept alive as long as this process lives."""
        if self._guards:
            return
        self._guards = True
        value = self._setting("host_timeout_s")  # a board may be without it
        if value and not 0 < float(value) <= HOST_TIMEOUT_S:
            self.guard({"host_timeout_s": value})
        if value:
            threading.Thread(target=self._live, daemon=True).start()

    def _live(self) -> None:
        while not self._script_ends.wait(SCRIPT_ALIVE_EVERY_S):
            try:
                self._port.write("\n")
            except WorkError:
                return

    def give_back(self, *names: str) -> None:
        """Give the board back its settings (left out: all) as they were before they were this program's."""
        for name in names or tuple(self._lent):
            if name in self._lent:
                self.ask(f"${name}={self._lent[name][0]}", 1.0)
                del self._lent[name]

    @contextlib.contextmanager
    def _given_back(self) -> Iterator[None]:
        """Have the board's own settings for so long."""
        lent = dict(self._lent)
        self.give_back()
        try:
            yield
        finally:
            for name, (_, here) in lent.items():
                self.ask(f"${name}={here}")
            self._lent = lent

    def telemetry_off(self, timeout_s: float = 3.0) -> None:
        """End telemetry; the board's own rate is what it was."""
        self.ask("telemetry off", timeout_s)
        self._telemetry.clear()
        self.give_back("telemetry_hz", "telemetry_format")

    def make_safe(self) -> bool:
        """Switch telemetry and all springs off; True where the board confirms it. Never raises, and nothing stops it."""
        self.stopped = lambda: False
        for urgent in (False, False, True):
            with contextlib.suppress(WorkError):
                if urgent:
                    self._port.write("!")
                else:
                    self.ask("off all", 1.0)
                self.telemetry_off(1.0)
                self.give_back()
                return True
        return False

    def stop_now(self, supply: bool = False) -> None:
        """Stop at once, from any thread, whatever is under way: `clear` goes on. With `supply` that goes off, too: then also `supply on`."""
        self._port.write("!!" if supply else "!")

    def on(self, spring: int | None = None, level: float = 100) -> None:
        """Drive a spring (1 = top left, row by row; None: all) at a level of 0..100 percent."""
        self.ask(f"on {'all' if spring is None else spring} {level:g}")

    def off(self, spring: int | None = None) -> None:
        """Stop driving a spring, or all."""
        self.ask(f"off {'all' if spring is None else spring}")

    def pattern(self, springs: str) -> None:
        """Drive exactly the springs that are 1 in a text of 0 and 1, row by row."""
        self.ask(f"pattern {springs}")

    def fan(self, percent: float) -> None:
        """Set the fan, 0..100 percent."""
        self.ask(f"fan {percent:g}")

    def warm(self) -> dict[int, float]:
        """Return which springs are warm by what the board gave them, and as how warm it believes them, degC."""
        told = self.ask("model")
        unknown = {k for k, one in beliefs(told).items() if one.unknown_s is not None}
        each = re.findall(r"^(?:spring )?(\w+): (-?[\d.]+) degC", "\n".join(told), re.MULTILINE)
        limit_c = next((float(t) for name, t in each if name == "ambient"), math.inf) + WARM_K
        return {int(k): float(t) for k, t in each if k.isdigit() and int(k) not in unknown and float(t) > limit_c}

    def cool(self, say: Callable[[str], None] = lambda words: None) -> None:
        """Wait until no spring is warm; what the board has learnt it forgets. WorkError where one is on."""
        self.ask("learnt clear", 10.0)
        for _ in self.stream(1):
            if not (warm := self.warm()):
                return
            say(f"waiting until the springs are cold: the hottest is at {max(warm.values()):.0f} degC")

    def read(self) -> Reading:
        """Return what the board measures now, and what it believes of the springs."""
        with contextlib.closing(self.stream(50)) as rows:
            return next(rows)

    def stream(self, hz: int = 5, seconds: float = math.inf) -> Generator[Reading, None, None]:
        """Yield what the board measures, `hz` rows a second, for so many seconds of its own; ends telemetry with the loop.

        Bounds and phase are asked for once a second. In the loop the board may be driven and asked as ever.

        >>> for now in board.stream(hz=5, seconds=60):
        ...     print(now.time_s, now.temperature_c.max())
        """
        ranges.RECORD_HZ.check("hz", hz)
        if not seconds > 0.0:
            raise InputError(f"seconds = {seconds!r}: not a number above 0")
        names = self.telemetry(hz)
        begins_s, looked_s, believed = math.nan, -math.inf, None
        try:
            while (row := self.next_row(names, time.monotonic() + 3.0 * self.patience)) is not None:
                now_s = float(row["time_s"])
                begins_s = now_s if math.isnan(begins_s) else begins_s
                if now_s - begins_s > seconds:
                    return
                if not 0.0 <= now_s - looked_s < LOOK_EVERY_S:
                    looked_s = now_s
                    with contextlib.suppress(RefusedError):  # a board that does not know the word
                        believed = beliefs(self.ask("model"))
                yield reading(row, believed)
        finally:
            with contextlib.suppress(WorkError):  # the loop may end after the board went away
                self.telemetry_off()
        raise WorkError(f"{self.port}: no telemetry came")


def springs_in(names: Iterable[str]) -> int:
    """Return of how many springs columns of telemetry are."""
    return sum(re.fullmatch(r"i\d+_a", name) is not None for name in names)


def telemetry_names(header: str) -> list[str] | None:
    """Return the columns of a telemetry header, None where it is none or corrupt."""
    names = header.split(",")
    springs = springs_in(names)
    wanted = {"time_s", *(f"i{k}_a" for k in range(1, springs + 1))}
    whole = all(COLUMN.match(name) or EXTRA.match(name) for name in names) and len(set(names)) == len(names)
    return names if springs and whole and wanted <= set(names) else None


def shape_of(settings: Mapping[str, str], springs: int) -> tuple[int, int]:
    """Return rows and columns of a board's springs, by its settings; all in a row where these are of another number."""
    rows, columns = (int(float(settings.get(name, 0))) for name in ("rows", "columns"))
    return (rows, columns) if rows * columns == springs else (1, springs)


EACH = {"current_a": "i{}_a", "voltage_v": "v{}_v", "temperature_c": "m{}_c"}
EACH |= {"low_c": "low{}_c", "high_c": "high{}_c", "austenite": "x{}", "duty": "d{}"}
"""What a Reading has of each spring, and how its columns are called."""
BELIEVED = ("low_c", "high_c", "austenite")
"""What of it telemetry does not tell."""


def to_pandas(readings: Iterable[Reading]) -> pd.DataFrame:
    """Return readings as a table, a row each, with a log's columns; `low1_c`, `high1_c` and `x1` (0..1) are bounds and phase."""
    import pandas as pd

    return pd.DataFrame(
        {"time_s": one.time_s}
        | {
            column.format(k): value
            for name, column in EACH.items()
            for k, value in enumerate(getattr(one, name).tolist(), 1)
        }
        | {"fan": one.fan, "ambient_c": one.ambient_c, "state": one.state}
        for one in readings
    )


def reading(cells: Mapping[str, str], believed: Mapping[int, Belief] | None = None) -> Reading:
    """Return a row of telemetry, and what is believed beside it, as numbers; ValueError where it is none."""
    springs, believed = range(1, 1 + springs_in(cells)), believed or {}
    each = {name: [float(cells.get(column.format(k), "nan")) for k in springs] for name, column in EACH.items()}
    each |= {name: [getattr(believed.get(k), name, math.nan) for k in springs] for name in BELIEVED}
    told: dict[str, Any] = {name: np.array(values) for name, values in each.items()}
    told |= {name: float(cells[name]) for name in ("time_s", "fan", "ambient_c")}
    return Reading(state=cells["state"], **told)


UNSAVED = "nothing is saved, a reset of the board gives back what it had"


def send_settings(
    board: Board,
    settings: Mapping[str, str],
    save: bool = True,
    say: Callable[[str, int], None] = lambda line, count: None,
) -> None:
    """Send settings, read them back, save them; what the board has learnt beside its old numbers it forgets.

    WorkError, and the board has what it had, where it refuses one or shows another value.
    """
    before = board.settings()
    try:
        _send(board, settings, say)
    except WorkError as error:
        left = UNSAVED if give_back(board, settings, before) else "nothing is saved, the board has what it had"
        raise WorkError(f"{error}: {left}") from None
    if save:
        board.ask("$save", 10.0)


def give_back(board: Board, names: Iterable[str], before: Mapping[str, str]) -> list[str]:
    """Give a board back what it had of settings before; return, in words, what it has otherwise all the same."""
    had = {name: before[name] for name in names if name in before}
    try:
        has = board.settings()
        for name, value in reversed(had.items()):
            if has.get(name) != value:
                board.ask(f"${name}={value}")
        return settings_that_differ(had, board.settings())
    except WorkError:
        return ["it does not answer"]


def _send(board: Board, settings: Mapping[str, str], say: Callable[[str, int], None]) -> None:
    """Send settings and read them back; WorkError where the board refuses one or shows another value."""
    remarks = board.ask("learnt clear", 10.0)
    for k, (name, value) in enumerate(settings.items()):
        line = f"${name}={value}"
        say(line, k)
        try:
            remarks = board.ask(line)
        except WorkError as error:
            where = settings.places[name] if isinstance(settings, Settings) else ""
            raise WorkError(f"{where}{error}") from None
    if remarks:
        raise WorkError(f"the board does not take them together: {remarks[-1]}")
    say("reading back", len(settings))
    if wrong := settings_that_differ(settings, board.settings()):
        raise WorkError(f"the board shows other values than were sent: {'; '.join(wrong)}")


def settings_that_differ(sent: Mapping[str, str], has: Mapping[str, str]) -> list[str]:
    """Return what a board shows otherwise than it was sent, in words."""
    return [
        f"{name} is {has[name]}, not {value}" if name in has else f"{name} is missing"
        for name, value in sent.items()
        if name not in has or float(has[name]) != float(value)
    ]


def as_lines(settings: Mapping[str, str]) -> str:
    """Return settings as console lines, `$name=value`."""
    return "".join(f"${name}={value}\n" for name, value in settings.items())


class Settings(dict[str, str]):
    """Settings of console lines, and where each stands: file, line, column."""

    def __init__(self) -> None:
        super().__init__()
        self.places: dict[str, str] = {}


def settings_in(text: str, name: str) -> Settings:
    """Return the settings of console lines, `$name=value`, also where `$$` told units behind the values; anything else is refused."""
    out = Settings()
    for number, raw in enumerate(text.splitlines(), start=1):
        line = re.sub(r"^(\$\S+=\S+)\s+(?:1/)?[a-zA-Z]\S*$", r"\1", raw.partition("#")[0].strip())
        if not line:
            continue
        column = 1 + len(raw) - len(raw.lstrip())
        if not (match := re.fullmatch(r"\$([a-z0-9_]+)=(-?\d+(?:\.\d+)?)", line)):
            hint = f": {DECIMAL_COMMA}" if re.search(r"\d,\d", line) else ""
            raise InputError(f"'{line[:40]}' is not a setting, `$name=value`{hint}", name, number, column)
        if (before := out.setdefault(match[1], match[2])) != match[2]:
            raise InputError(
                f"{match[1]} is {match[2]} here and {before} before: leave one of them", name, number, column
            )
        out.places[match[1]] = f"{name}:{number}:{column}: "
    if not out:
        raise InputError("no setting in it", name)
    return out


def read_settings(path: Path) -> Settings:
    """Return the settings of a file of console lines; anything else is refused."""
    return settings_in(read_text(path), str(path))
