"""What a page shows and does, whatever is behind it: a state that is replaced whole, its history, and wishes."""

from __future__ import annotations

import threading
import time
from collections import deque
from concurrent.futures import Future
from typing import Any

import numpy as np

RECENT_S, HISTORY_S = 600.0, 3600.0
"""Every row is kept for ten minutes, one in OLD_EVERY_S for an hour."""
OLD_EVERY_S = 1.0
POINTS = 1200
"""Most points of each part of the history that a new page gets."""
SERIES = ("temperature_c", "low_c", "high_c", "measured_c", "current_a", "voltage_v", "power_w", "duty", "phase")
"""What is kept of each spring over time."""


class Source:
    """One array as all pages see it."""

    kind = ""
    words = ""
    """What it is, in words."""
    takes: frozenset[str] = frozenset()
    """The wishes that it can carry out, beside stop and settings."""
    off_within_s = 0.8
    """An off that is not confirmed within so long becomes a stop."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._state: dict[str, Any] = {"connected": False, "trouble": "looking for the board"}
        self._revision = 0
        self._row_at_s: float | None = None
        """When the newest row came, monotonic; None where what is shown does not age."""
        self._history: deque[dict[str, Any]] = deque()
        self._older: deque[dict[str, Any]] = deque()
        self.closing = threading.Event()

    @property
    def revision(self) -> int:
        """Counts the states: another number, another state."""
        return self._revision

    def state(self) -> dict[str, Any]:
        """Return the state as it is now."""
        with self._lock:
            state = self._state | {"kind": "state", "source": self.kind, "revision": self._revision}
            if self._row_at_s is not None:
                state["age_s"] = round(time.monotonic() - self._row_at_s, 3)
        return state

    def history(self) -> dict[str, Any]:
        """Return the last hour: {time_s: (n,), name: (k, n) ...}."""
        with self._lock:
            parts = [list(self._older), list(self._history)]
        rows = [row for part in parts for row in part[:: 1 + len(part) // POINTS]]
        out: dict[str, Any] = {"kind": "history", "time_s": [row["time_s"] for row in rows]}
        for name in SERIES:
            none = [None] * max((len(row[name] or ()) for row in rows), default=0)
            out[name] = [list(one) for one in zip(*(row[name] or none for row in rows), strict=True)]
        return out

    def _change(self, **values: Any) -> None:
        with self._lock:
            self._state = self._state | values
            self._revision += 1

    def _remember(self, row: dict[str, Any]) -> None:
        with self._lock:
            if self._history and row["time_s"] < self._history[-1]["time_s"]:
                self._forget()
            self._history.append({name: row.get(name) for name in ("time_s", *SERIES)})
            while row["time_s"] - self._history[0]["time_s"] > RECENT_S:
                old = self._history.popleft()
                if not self._older or old["time_s"] - self._older[-1]["time_s"] >= OLD_EVERY_S:
                    self._older.append(old)
            while self._older and row["time_s"] - self._older[0]["time_s"] > HISTORY_S:
                self._older.popleft()

    def _forget(self) -> None:
        """Begin the history anew; the caller has the lock."""
        self._history.clear()
        self._older.clear()

    def settings(self) -> list[dict[str, Any]]:
        """Return the settings with value, unit and range; none where there is no board."""
        return []

    def start(self) -> None:
        """Begin."""

    def stop_now(self, supply: bool = False) -> str:
        """Switch everything off, with `supply` that, too, at once, from any thread; return what was done, in words."""
        raise NotImplementedError

    def do(self, wish: dict[str, Any]) -> Future[str]:
        """Take a valid wish, one of `takes`, without waiting: wishes are carried out in the order in which they are
        taken, but those that only switch off come first.

        The board's words come later; WorkError or InputError, at once or as what comes, where it is refused.
        """
        raise NotImplementedError

    def close(self) -> None:
        """Switch everything off and end."""
        self.closing.set()


def at_once(said: str) -> Future[str]:
    """Return an answer that is there already."""
    answer: Future[str] = Future()
    answer.set_result(said)
    return answer


def plain(values: np.ndarray) -> list[float | None]:
    """Return numbers as JSON has them: it has no NaN."""
    return [None if np.isnan(one) else round(float(one), 4) for one in values]
