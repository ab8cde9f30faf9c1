"""Figures as bench/results.py reads them: one row each, shares of cases, printed and written."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Figures:
    """Makes the rows of one benchmark."""

    command: str

    def row(self, figure: str, value: float, unit: str, target: str = "") -> dict[str, Any]:
        """Return one figure."""
        return {"figure": figure, "value": round(value, 3), "unit": unit, "target": target, "command": self.command}

    def percent(self, name: str, hits: Sequence[bool], target: str) -> dict[str, Any]:
        """Return how many of these are so."""
        return self.row(f"{name} ({sum(hits)} of {len(hits)})", 100.0 * sum(hits) / max(1, len(hits)), "%", target)


def tell(rows: Sequence[dict[str, Any]], path: Path | None) -> None:
    """Print figures, and write them where a path is given."""
    for one in rows:
        print(f"{one['figure']:90} {one['value']:8} {one['unit']:14} {one['target']}")
    if path:
        path.write_text(json.dumps(rows, indent=1) + "\n")
