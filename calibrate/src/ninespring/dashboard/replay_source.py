"""A log behind the page, played again: measured beside what a model makes of it."""

from __future__ import annotations

import threading
import time
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import numpy as np

from ..infer.predict import predict
from ..io.logs import Run
from ..model.models import Model
from ..say.plotting import believed
from .source import Source, at_once, plain

TICK_S = 0.1


class ReplaySource(Source):
    """A log, and perhaps a model of it."""

    kind = "replay"
    words = "a log that is replayed"
    takes = frozenset({"pause", "seek", "speed"})

    def __init__(self, run: Run, rows: int, cols: int, model: Model | None, speed: float) -> None:
        super().__init__()
        self._run = run
        modelled = predict(model, run) if model else believed(run)
        empty = np.full((len(run.time_s), run.springs), np.nan)
        zero = np.zeros((len(run.time_s), run.springs))
        self._columns = {
            "temperature_c": run.temperature_c if modelled is None else modelled,
            "measured_c": empty if modelled is None else run.temperature_c,
            "current_a": zero if run.current_a is None else run.current_a,
            "voltage_v": empty if run.voltage_v is None else run.voltage_v,
            "power_w": run.drive if run.mode == "power" else empty,
            "duty": run.drive if run.mode == "command" else empty,
            "phase": empty,
        }
        self._speed, self._playing = speed, True
        self._at_s = float(run.time_s[0])
        self._row = -1
        self._moved = threading.Lock()
        self._change(
            connected=True,
            trouble="",
            name=Path(run.name).name,
            rows=rows,
            cols=cols,
            springs=run.springs,
            begins_s=float(run.time_s[0]),
            ends_s=float(run.time_s[-1]),
            level=[0] * run.springs,
            limits=[[] for _ in range(run.springs)],
            faults=[],
            recording=None,
            state="ok",
            said="; ".join(run.notes),
        )
        self._thread = threading.Thread(target=self._play, name="replay", daemon=True)

    def start(self) -> None:
        """Begin to play."""
        self._show(0)
        self._thread.start()

    def close(self) -> None:
        """End."""
        self.closing.set()
        self._thread.join(5)

    def stop_now(self, supply: bool = False) -> str:
        """Pause: there is nothing to switch off."""
        self._playing = False
        self._show(self._row)
        return "paused: a log is replayed, there is nothing to switch off"

    def do(self, wish: dict[str, Any]) -> Future[str]:
        """Play, pause, seek, or change the speed."""
        with self._moved:
            to_s = wish.get("time_s")
            if wish["do"] == "pause":
                to_s = -np.inf if self._ended(self._row) else None  # once more
                self._playing = to_s is not None or not self._playing
            if to_s is not None:
                self._at_s = float(np.clip(to_s, self._run.time_s[0], self._run.time_s[-1]))
                row = int(np.searchsorted(self._run.time_s, self._at_s, "right")) - 1
                with self._lock:
                    self._forget()
                for one in range(max(0, row - 600), row):
                    self._remember(self._values(one))
                self._show(row)
            elif wish["do"] == "speed":
                self._speed = wish["speed"]
        self._show(self._row)
        return at_once("")

    def _ended(self, row: int) -> bool:
        return row == len(self._run.time_s) - 1

    def _values(self, row: int) -> dict[str, Any]:
        return {name: plain(values[row]) for name, values in self._columns.items()} | {
            "time_s": float(self._run.time_s[row])
        }

    def _show(self, row: int) -> None:
        values = self._values(row)
        run = self._run
        playing = self._playing and not self._ended(row)
        self._change(
            **values,
            fan=float(run.fan[row]),
            ambient_c=None if run.ambient_c is None else float(run.ambient_c[row]),
            level=[100.0 if one > 0 else 0 for one in run.drive[row]],
            sum_a=float(np.nansum(self._columns["current_a"][row])),
            state_words=("playing" if playing else "paused") + f", {self._speed:g} x",
            speed=self._speed,
            playing=playing,
        )
        if row != self._row:
            self._remember(values)
        self._row = row

    def _play(self) -> None:
        before = time.monotonic()
        while not self.closing.wait(TICK_S):
            now = time.monotonic()
            with self._moved:
                if self._playing and not self._ended(self._row):
                    self._at_s += (now - before) * self._speed
                    last = int(np.searchsorted(self._run.time_s, self._at_s, "right")) - 1
                    for row in range(self._row + 1, last):
                        self._remember(self._values(row))
                    if last > self._row:
                        self._show(last)
            before = now
