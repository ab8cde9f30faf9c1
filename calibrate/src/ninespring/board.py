"""A board at a serial port (docs/console.md): one line out, lines in until `ok` or `error:N`."""

from __future__ import annotations

import contextlib
import math
import re
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from types import TracebackType

import serial

from .errors import InputError, WorkError

BAUD = 115200
ERROR = re.compile(r"^error:(\d+) ?(.*)$")


class Board:
    """An open serial connection. Use as a context manager."""

    def __init__(self, port: str, timeout_s: float = 3.0) -> None:
        """Open the port; a Mega resets when it is opened."""
        try:
            self._serial = serial.Serial(port, BAUD, timeout=0.2, write_timeout=2.0)
        except (serial.SerialException, OSError, ValueError) as error:
            reason = str(error).split(":")[-1].strip()
            raise WorkError(f"{port}: cannot be opened ({reason}): is the board there, is the port free?") from None
        self.port = port
        self.timeout_s = timeout_s

    def __enter__(self) -> Board:
        """Return the board."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the port."""
        self._serial.close()

    def read_line(self, until: float) -> str | None:
        """Return the next line without its end, None where none came until that monotonic time."""
        buffer = b""
        while time.monotonic() < until:
            try:
                buffer += self._serial.readline()
            except (serial.SerialException, OSError):
                raise WorkError(f"{self.port}: the board went away") from None
            if buffer.endswith(b"\n"):
                return buffer.decode("ascii", "replace").strip()
        return None

    def greet(self) -> None:
        """Wait until the board answers an empty question; it may still be starting."""
        for _ in range(8):
            try:
                self.ask("telemetry off", 1.5)
                return
            except WorkError as error:
                last = error
        raise WorkError(f"{self.port}: no board answers at {BAUD} baud ({last})")

    def ask(self, line: str, timeout_s: float | None = None) -> list[str]:
        """Send one line; return the answer's lines. WorkError where it is refused or nothing comes."""
        try:
            self._serial.write(line.encode("ascii") + b"\n")
        except UnicodeEncodeError:
            raise InputError(f"'{line}' is not plain ASCII") from None
        except (serial.SerialException, OSError):
            raise WorkError(f"{self.port}: the board does not take '{line}'") from None
        until = time.monotonic() + (timeout_s or self.timeout_s)
        answer: list[str] = []
        while (got := self.read_line(until)) is not None:
            if got == "ok":
                return answer
            if match := ERROR.match(got):
                raise WorkError(f"'{line}' refused: error {match[1]} {match[2]}".rstrip())
            answer.append(got)
        raise WorkError(f"no answer to '{line}'")

    def telemetry(self, hz: int, until: float) -> Iterator[str]:
        """Switch CSV telemetry on and yield its lines, the header first, and status in angle brackets, until that time.

        The time is monotonic.
        """
        for line in self.ask(f"telemetry csv {hz}"):
            if line.startswith("time_s,"):
                yield line
        while time.monotonic() < until:
            line = self.read_line(min(until, time.monotonic() + 5.0))
            if line is None:
                if time.monotonic() < until:
                    raise WorkError(f"{self.port}: no telemetry for 5 s")
                return
            if match := ERROR.match(line):
                raise WorkError(f"the board refuses what it was sent: error {match[1]} {match[2]}".rstrip())
            status = line.startswith("<") and line.endswith(">")
            if status or (line and line[0] not in "[<>" and line != "ok"):
                yield line

    def send(self, line: str) -> None:
        """Send one line whose answer comes among the telemetry."""
        try:
            self._serial.write(line.encode("ascii") + b"\n")
        except (serial.SerialException, OSError):
            raise WorkError(f"{self.port}: the board went away") from None

    def off(self) -> None:
        """Switch all springs off, if the board is still there."""
        with contextlib.suppress(WorkError):
            self.send("off all")

    def stop(self) -> None:
        """Switch telemetry off, whatever is still under way."""
        with contextlib.suppress(WorkError, serial.SerialException, OSError):
            self._serial.reset_input_buffer()
            self.ask("telemetry off")


@dataclass
class Step:
    """A console line to send so many seconds after the first row (None: before the recording)."""

    line: str
    at_s: float | None = None


@dataclass
class Recording:
    """What came of a recording."""

    rows: int = 0
    dropped: int = 0
    ended: str = ""
    """Why it ended early where that was nobody's wish."""


def script_lines(text: str, name: str) -> list[Step]:
    """Return the steps of a script: console lines, or `at SECONDS = line` as in scenarios; # and ; begin comments."""
    steps: list[Step] = []
    for number, raw in enumerate(text.splitlines(), start=1):
        line = re.split("[#;]", raw, maxsplit=1)[0].strip()
        if not line:
            continue
        if not line.isascii():
            raise InputError("the console takes plain ASCII", name, number, 1)
        step = Step(line)
        if re.match(r"at\b", line):
            match = re.fullmatch(r"at\s+(\d+(?:\.\d*)?)\s*=\s*(\S.*)", line)
            if not match:
                raise InputError(f"'{line[:40]}' is not `at SECONDS = console line`", name, number, 1)
            step = Step(match[2], float(match[1]))
            if steps and steps[-1].at_s is not None and steps[-1].at_s > float(match[1]):
                raise InputError("times of a script must not fall", name, number, 1)
        elif steps and steps[-1].at_s is not None:
            raise InputError(
                f"'{line[:40]}' comes after timed lines: give it a time, `at SECONDS = ...`", name, number, 1
            )
        steps.append(step)
    return steps


def record(
    board: Board,
    hz: int,
    duration_s: float,
    steps: Sequence[Step] = (),
    write: Callable[[str], None] = lambda line: None,
    say: Callable[[int, float], None] = lambda rows, seconds: None,
) -> Recording:
    """Write a log's lines from a board's telemetry as they come: header and rows that are whole and rise in time.

    Status between the rows, such as which limits act on a spring, becomes comments. Steps without a time are sent first;
    timed ones in between, by the board's clock. What is driven by steps is switched off at the end. WorkError where no
    row came.
    """
    got = Recording()
    header, first, last = "", math.nan, -math.inf
    for step in steps:
        if step.at_s is None:
            board.ask(step.line)
    waiting = [step for step in steps if step.at_s is not None]
    until = time.monotonic() + duration_s
    try:
        for line in board.telemetry(hz, until):
            if line.startswith("time_s,"):
                if not header:
                    header = line
                    write(line)
                continue
            if not header:
                continue
            if line.startswith("<"):
                write(f"# {line}")
                continue
            try:
                now = float(line.split(",", 1)[0])
            except ValueError:
                now = math.nan
            if now < last - 1.0:
                got.ended = "the board has started again"
                break
            if line.count(",") != header.count(",") or not now > last:
                got.dropped += 1
                continue
            last = now
            first = now if got.rows == 0 else first
            got.rows += 1
            write(line)
            say(got.rows, now - first)
            while waiting and waiting[0].at_s is not None and waiting[0].at_s <= now - first:
                board.send(waiting.pop(0).line)
    except KeyboardInterrupt:
        pass
    except WorkError as error:
        if not got.rows:
            raise
        got.ended = str(error)
    if steps:
        board.off()
    board.stop()
    if not got.rows:
        raise WorkError(f"{board.port}: no telemetry came")
    return got


def settings_that_differ(sent: Sequence[str], shown: Sequence[str]) -> list[str]:
    """Return what a board shows otherwise than it was sent, in words; both as lines `$name=value`."""
    has = dict(line[1:].split("=", 1) for line in shown if line.startswith("$") and "=" in line)
    out = []
    for line in sent:
        name, value = line[1:].split("=", 1)
        if name not in has:
            out.append(f"{name} is missing")
        elif float(has[name].split()[0]) != float(value):
            out.append(f"{name} is {has[name]}, not {value}")
    return out


def settings_lines(text: str, name: str) -> list[str]:
    """Return the `$name=value` lines of an exported file; anything else is refused."""
    out = []
    for number, line in enumerate(text.splitlines(), start=1):
        line = line.partition("#")[0].strip()
        if not line:
            continue
        if not re.fullmatch(r"\$[a-z0-9_]+=-?\d+(\.\d+)?", line):
            raise InputError(f"'{line[:40]}' is not a setting, `$name=value`", name, number, 1)
        out.append(line)
    if not out:
        raise InputError("no setting in it", name)
    return out
