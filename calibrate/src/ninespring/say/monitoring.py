"""What `ninespring monitor` shows in a terminal: the array as a grid, with totals, limits and trend."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from ..io import words
from ..io.board import Reading, reading, shape_of

TREND_S = 10.0
"""Over so long a temperature's trend is taken."""
STEADY_K_PER_S = 0.02
"""Less than this is no trend: 1.2 K a minute."""


class Screen:
    """Takes lines of telemetry with these columns, and draws what they say."""

    def __init__(self, settings: Mapping[str, str], names: list[str]) -> None:
        self._settings, self._names = settings, names
        self._past: deque[Reading] = deque()
        self._limits: dict[int, str] = {}

    def take(self, line: str) -> bool:
        """Take one line; return whether there is something new to see."""
        if match := words.ACTING.fullmatch(line):
            named = [one for one in match[2][1:].split("|") if one != "none"]
            self._limits[int(match[1])] = f"{' '.join(named)} -{float(match[3]):.2f} A" if named else ""
            return bool(self._past)
        try:
            now = reading(dict(zip(self._names, line.split(","), strict=True)))
        except ValueError:  # another line, or half a row
            return False
        if self._past and now.time_s < self._past[-1].time_s:
            self._past.clear()
        self._past.append(now)
        while now.time_s - self._past[0].time_s > TREND_S:
            self._past.popleft()
        return True

    def picture(self) -> RenderableType:
        """Return the grid, with what is true of all springs above it."""
        now, before = self._past[-1], self._past[0]
        springs = len(now.current_a)
        rows, cols = shape_of(self._settings, springs)
        elapsed = now.time_s - before.time_s
        rise = (now.temperature_c - before.temperature_c) / elapsed if elapsed > 0 else np.zeros(springs)
        grid = Table(show_header=False, show_lines=True, padding=(0, 1))
        for row in range(rows):
            grid.add_row(*(self._cell(row * cols + k, now, float(rise[row * cols + k])) for k in range(cols)))
        supply = self._settings.get("supply_limit_a")
        total = f"{now.current_a.sum():.2f} A" + (f" of {float(supply):g} A" if supply else "")
        head = Text(f"{now.time_s:.1f} s   {total}   fan {100 * now.fan:.0f} %   ambient {now.ambient_c:.1f} degC   ")
        head.append(words.of_state(now.state), style="green" if now.state == "ok" else "bold red")
        return Group(head, grid)

    def _cell(self, k: int, now: Reading, rise: float) -> Text:
        arrow = "→" if abs(rise) < STEADY_K_PER_S else "↗" if rise > 0 else "↘"
        power = now.current_a[k] * now.voltage_v[k]
        cell = Text(f"{k + 1}  ")
        cell.append(f"{now.temperature_c[k]:.1f} {arrow}", style="bold" if now.duty[k] > 0 else "")
        cell.append(f"\n{now.current_a[k]:.2f} A  {power:.2f} W\n")
        cell.append(self._limits.get(k + 1, ""), style="yellow")
        return cell
