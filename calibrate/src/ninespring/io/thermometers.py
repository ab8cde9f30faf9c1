"""A thermocouple logger at a port of its own: its lines, and what they are on the board's clock.

Lines of numbers, separated by commas, semicolons, tabs or spaces; what is no number is an empty cell. A header
(`time_s,t1_c,t2_c`, or any names: columns whose name has no `t<number>` are left out, one that begins with `time` is the
logger's own clock in s) may come at any time. Until one comes, the first GUESSED_FROM lines tell: a first column that rises
by the same step each time is a clock, no temperature does that; the other columns are springs 1, 2, ...
"""

from __future__ import annotations

import math
import re
import statistics
import threading
import time
from collections import deque
from contextlib import AbstractContextManager, closing, nullcontext

from ..errors import WorkError
from .logs import LIMITS, number_in
from .port import Port

FOUND_WITHIN_S = 5.0
UNDERSTOOD_WITHIN_S = 15.0
GUESSED_FROM = 4
STEADY_STEP = 0.05
"""How much the steps of a clock may differ, of their mean."""
SEPARATOR = re.compile(r"[,;\t ]+")
SPRING = re.compile(r"t(?:c|emp\w*)?[ _]?(\d+)(?:_c)?", re.IGNORECASE)
KEPT = 4096
"""Readings that wait for their rows, at most."""


class Lines:
    """Turns a logger's lines into readings."""

    def __init__(self) -> None:
        self.springs: list[int | None] | None = None
        """Spring of each column, None where it is none."""
        self.clock: int | None = None
        """Column of the logger's own clock."""
        self.heard = 0
        self._first: list[list[float | None]] = []

    def read(self, line: str) -> tuple[float | None, dict[int, float]] | None:
        """Return a line's time by the logger's clock (None: it has none) and {spring: degC}; None where it is no reading."""
        cells = SEPARATOR.split(line.strip().strip(",;"))
        if line.startswith("#") or not line.strip():
            return None
        self.heard += 1
        numbers = [number_in(cell) for cell in cells]
        if all(one is None for one in numbers):
            self._header(cells)
            return None
        if self.springs is None:
            self._guess(numbers)
            return None
        if len(cells) != len(self.springs):
            return None
        stamp = None if self.clock is None else numbers[self.clock]
        if self.clock is not None and stamp is None:
            return None
        low, high = LIMITS["t"][:2]
        each = zip(self.springs, numbers, strict=True)
        return stamp, {k: c for k, c in each if k is not None and c is not None and low <= c <= high}

    def _guess(self, numbers: list[float | None]) -> None:
        if self._first and len(numbers) != len(self._first[0]):
            self._first.clear()
        self._first.append(numbers)
        if len(self._first) < GUESSED_FROM:
            return
        first = [one[0] for one in self._first if one[0] is not None]
        steps = [b - a for a, b in zip(first, first[1:], strict=False)]
        mean = sum(steps) / len(steps) if steps else 0.0
        clock = len(first) == GUESSED_FROM and all(abs(one - mean) < STEADY_STEP * mean for one in steps)
        self.clock = 0 if clock and len(numbers) > 1 else None
        shift = 0 if self.clock is None else 1
        self.springs = [k + 1 - shift or None for k in range(len(numbers))]

    def _header(self, cells: list[str]) -> None:
        springs = [int(match[1]) if (match := SPRING.fullmatch(cell)) else None for cell in cells]
        if any(springs):
            self.springs = springs
            self.clock = next((k for k, cell in enumerate(cells) if cell.lower().startswith("time")), None)


class Thermometers:
    """Reads a logger in a thread of its own, and tells what each spring was at on the board's clock."""

    def __init__(self, port: str) -> None:
        """Open the port; WorkError where nothing comes within FOUND_WITHIN_S."""
        self._port = Port(port)
        self._lines = Lines()
        self._lock = threading.Lock()
        self._readings: deque[tuple[float, dict[int, float]]] = deque(maxlen=KEPT)
        """Logger's time (or of arrival, where it has no clock) and values."""
        self._offsets: deque[float] = deque(maxlen=KEPT)
        """Board's time less the logger's, each time that a reading came."""
        self._board: tuple[float, float, float] | None = None
        """Last row: board's time, time of its arrival, time between rows."""
        self._closing = threading.Event()
        self.trouble = ""
        """Why nothing more comes."""
        self.latest: dict[int, float] = {}
        self.count = 0
        self._thread = threading.Thread(target=self._run, name="thermometers", daemon=True)
        self._thread.start()
        begun = time.monotonic()
        while not self.count and not self.trouble:
            waited = time.monotonic() - begun
            if waited > (UNDERSTOOD_WITHIN_S if self._lines.heard else FOUND_WITHIN_S - 0.2):
                break
            time.sleep(0.02)
        if not self.count:
            self.close()
            raise WorkError(self.trouble or f"{port}: no temperatures come: is it the thermometers' port?")

    @property
    def offset_s(self) -> float | None:
        """What is added to the logger's clock to have the board's, s; None before the first row."""
        with self._lock:
            return statistics.median(self._offsets) if self._offsets else None

    @property
    def springs(self) -> list[int]:
        """Springs that have a thermometer."""
        return sorted(one for one in self._lines.springs or [] if one)

    def _run(self) -> None:
        try:
            while not self._closing.is_set():
                line = self._port.read_line(time.monotonic() + 0.5, self._closing.is_set)
                got = self._lines.read(line.strip()) if line else None
                if got is None:
                    continue
                now = time.monotonic()
                stamp, values = (now if got[0] is None else got[0]), got[1]
                with self._lock:
                    last = self._readings[-1][0] if self._readings else -math.inf
                    if stamp == last:
                        continue
                    if stamp < last:  # its clock began anew
                        self._readings.clear()
                        self._offsets.clear()
                    self._readings.append((stamp, values))
                    if self._board:
                        at_s, came_s, period_s = self._board
                        self._offsets.append(at_s + min(now - came_s, period_s) - stamp)
                self.latest = self.latest | values
                self.count += 1
        except WorkError as error:
            self.trouble = str(error)

    def row_came(self, board_s: float) -> None:
        """Take note of the board's clock: a row of that time came just now."""
        now = time.monotonic()
        with self._lock:
            period = board_s - self._board[0] if self._board else 0.0
            self._board = (board_s, now, period)

    def at(self, board_s: float) -> dict[int, float] | None:
        """Return {spring: degC} at a time of the board, on straight lines between readings; None: not known yet."""
        with self._lock:
            if not self._offsets:
                return None
            wanted = board_s - statistics.median(self._offsets)
            after = next((k for k, (stamp, _) in enumerate(self._readings) if stamp >= wanted), None)
            if after is None:
                return None
            if after == 0:
                return {}
            (t0, before), (t1, behind) = self._readings[after - 1], self._readings[after]
            for _ in range(after - 1):
                self._readings.popleft()
        part = (wanted - t0) / (t1 - t0)
        return {k: before[k] + part * (behind[k] - before[k]) for k in before.keys() & behind.keys()}

    def close(self) -> None:
        """Close the port."""
        self._closing.set()
        self._thread.join(2)
        self._port.close()


def measuring(port: str | None) -> AbstractContextManager[Thermometers | None]:
    """Return a logger's thermometers for as long as they are needed; None where no port is given."""
    return closing(Thermometers(port)) if port else nullcontext()
