"""The worst pattern of arrays that have too many: searched for, not gone through.

.venv/bin/python bench/explore/worst.py [--size N] [--pitch MM] [--runs N] [--json FILE]

By geometry alone, Perspex, all-but-one patterns first, then one spring after another switched over in the worst so far: the
pattern in which an undriven spring comes hottest. Runs like a sweep's points: 200 s on, policy precompensate, a board for each
4 x 4 springs.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
from ninespring.explore.point import metrics_of
from ninespring.explore.spec import Spec

AUSTENITE_START_C = 88


class Search:
    """Runs patterns of one array, remembers what they came to."""

    def __init__(self, size: int, pitch_mm: float, fan: float, runs: int) -> None:
        self.size, self.runs = size, runs
        self.spec = Spec(duration_s=210, on_s=200, couplings="field")
        self.point: dict[str, Any] = {"size": size, "pitch_mm": pitch_mm, "fan": fan, "plate": "perspex"}
        self.point |= {"board_rows": 4, "board_cols": 4, "supply_limit_a": 60.0}
        self.found: dict[str, float] = {}

    def run(self, pattern: str) -> float:
        """Return the hottest that an undriven spring came, degC."""
        if pattern not in self.found and "0" in pattern and len(self.found) < self.runs:
            self.found[pattern] = metrics_of(self.spec, self.point | {"pattern": pattern}, 1)["undriven_c"]
        return self.found.get(pattern, -np.inf)

    def search(self) -> tuple[str, float]:
        """Return the worst pattern found, and what an undriven spring came to in it."""
        n = self.size
        row, col = np.divmod(np.arange(n * n), n)
        one_of_each = np.flatnonzero((row <= (n - 1) // 2) & (col <= (n - 1) // 2) & (row <= col))
        for k in one_of_each:  # by symmetry one of each kind, but for the fan's direction
            self.run("".join("0" if i == k else "1" for i in range(n * n)))
        self.run("".join(str(int((r + c) % 2 == 0)) for r, c in zip(row, col, strict=True)))
        better = True
        while better and len(self.found) < self.runs:
            worst = max(self.found, key=lambda one: self.found[one])
            middle = worst.index("0")
            near = np.argsort(np.hypot(row - row[middle], col - col[middle]))
            flipped = ("".join(c if i != k else "01"[c == "0"] for i, c in enumerate(worst)) for k in near[1:])
            better = any(self.run(pattern) > self.found[worst] for pattern in flipped)
        worst = max(self.found, key=lambda one: self.found[one])
        return worst, self.found[worst]


def main() -> None:
    """Search, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", type=int, default=8)
    parser.add_argument("--pitch", type=float, default=4.3)
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    figures = []
    for fan in (0.0, 1.0):
        search = Search(options.size, options.pitch, fan, options.runs)
        pattern, hottest_c = search.search()
        rows = [pattern[k : k + options.size] for k in range(0, len(pattern), options.size)]
        name = f"{options.size} x {options.size}, {options.pitch:g} mm, {'fan' if fan else 'still'}"
        figure = f"{name}: undriven at most, worst of {len(search.found)} patterns searched"
        print(f"{figure}: {hottest_c:.1f} degC, {' '.join(rows)}", flush=True)
        figures.append(
            {"figure": figure, "value": round(hottest_c, 1), "unit": "degC", "target": f"< {AUSTENITE_START_C}"}
            | {"command": "bench/explore/worst.py"}
        )
    if options.json:
        options.json.write_text(json.dumps(figures, indent=1) + "\n")


if __name__ == "__main__":
    main()
