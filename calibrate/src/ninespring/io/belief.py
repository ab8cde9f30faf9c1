"""What a board answers to `model` (docs/console.md): what it believes of each spring, and why it does what it does."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

FIRST = re.compile(
    r"spring (?P<spring>\d+): (?P<temperature_c>-?[\d.]+) degC, (?P<low_c>-?[\d.]+) to (?P<high_c>-?[\d.]+), .*"
    r"austenite (?P<austenite>[\d.]+) %, .*?(?:, (?P<doing>[a-z]+))?"
)
TARGET = re.compile(r"  .*, target (\d+\.\d+) A\b.*")
WHY = re.compile(r"  ((?:waits|away|not known)\b(?:\D*(?P<unknown_s>\d+) s: .*)?.*)")


@dataclass
class Belief:
    """What the board believes of a spring; 99 % bounds."""

    low_c: float
    high_c: float
    austenite: float
    """0..1"""
    doing: str
    """heat, hold, lower; empty: nothing."""
    target_a: float | None = None
    why: str = ""
    """Why it is not where it was asked to be, or not known."""
    unknown_s: float | None = None
    """So long it may still be hot from before power-on."""


def beliefs(lines: Iterable[str]) -> dict[int, Belief]:
    """Return what is believed of each spring (1 = top left); a line that cannot be read is left out."""
    out: dict[int, Belief] = {}
    spring = 0
    for line in lines:
        if match := FIRST.fullmatch(line):
            spring = int(match["spring"])
            out[spring] = Belief(
                float(match["low_c"]), float(match["high_c"]), float(match["austenite"]) / 100.0, match["doing"] or ""
            )
        elif line and not line.startswith(" "):
            spring = 0
        elif spring and (match := TARGET.fullmatch(line)):
            out[spring].target_a = float(match[1])
        elif spring and (match := WHY.fullmatch(line)):
            out[spring].why = match[1]
            out[spring].unknown_s = float(match["unknown_s"]) if match["unknown_s"] else None
    return out
