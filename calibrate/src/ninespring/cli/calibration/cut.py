"""A plan that is gone on with: what is left of its steps after so many seconds, and how the springs were driven then."""

from __future__ import annotations

import re
from collections.abc import Sequence

from ...io.recording import Step

SOON_S = 1.0
"""What was on is on again so long after the first row."""
ONE = re.compile(r"(on|off) (\d+|all)(?: (\d+))?")


def left_of(steps: Sequence[Step], from_s: float, springs: int) -> list[Step]:
    """Return the steps that are left after `from_s` seconds of a plan; first, what was on then is switched on again."""
    if from_s <= 0.0:
        return list(steps)
    level, fan = ["0"] * springs, "0"
    head, after = [step for step in steps if step.at_s is None], []
    for step in steps:
        if step.at_s is None:
            continue
        if step.at_s > from_s:
            after.append(Step(step.line, step.at_s - from_s + SOON_S))
        elif match := ONE.fullmatch(step.line):
            value = "0" if match[1] == "off" else match[3] or "100"
            which = range(springs) if match[2] == "all" else [int(match[2]) - 1]
            for k in which:
                level[k] = value
        elif step.line.startswith("fan "):
            fan = step.line.split()[1]
    again = [Step(f"on {k + 1} {value}", SOON_S) for k, value in enumerate(level) if value != "0"]
    return [*head, *([Step(f"fan {fan}", SOON_S)] if fan != "0" else []), *again, *after]
