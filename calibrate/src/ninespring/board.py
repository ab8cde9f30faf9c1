"""A board at a serial port (docs/console.md): one line out, lines in until `ok` or `error:N`."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator
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
        """Switch CSV telemetry on and yield its lines, the header first, until that monotonic time."""
        for line in self.ask(f"telemetry csv {hz}"):
            if line.startswith("time_s,"):
                yield line
        while time.monotonic() < until:
            line = self.read_line(min(until, time.monotonic() + 5.0))
            if line is None:
                if time.monotonic() < until:
                    raise WorkError(f"{self.port}: no telemetry for 5 s")
                return
            if line and line[0] not in "[<>" and line != "ok":
                yield line

    def stop(self) -> None:
        """Switch telemetry off, whatever is still under way."""
        try:
            self._serial.reset_input_buffer()
            self.ask("telemetry off")
        except WorkError:
            pass


def record(board: Board, hz: int, duration_s: float, say: Callable[[str], None] = lambda text: None) -> list[str]:
    """Return a log's lines from a board's telemetry: header and rows that are whole and rise in time."""
    lines: list[str] = []
    last, dropped = float("-inf"), 0
    until = time.monotonic() + duration_s
    try:
        for line in board.telemetry(hz, until):
            if line.startswith("time_s,"):
                if not lines:
                    lines.append(line)
                continue
            if not lines:
                continue
            try:
                now = float(line.split(",", 1)[0])
            except ValueError:
                dropped += 1
                continue
            if line.count(",") != lines[0].count(",") or now <= last:
                dropped += 1
                continue
            last = now
            lines.append(line)
            say(f"{len(lines) - 1} rows")
    except KeyboardInterrupt:
        pass
    board.stop()
    if len(lines) < 2:
        raise WorkError(f"{board.port}: no telemetry came")
    if dropped:
        lines.insert(0, f"# dropped_lines: {dropped}")
    return lines


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
