"""What numbers a user may give: one table, which the commands' options and the functions of `import ninespring` both ask."""

from __future__ import annotations

import math
import numbers
from dataclasses import dataclass
from typing import Any

from ..errors import InputError


@dataclass(frozen=True)
class Range:
    """From `low` to `high`, in `unit`; `above`: the low end itself is not in it; `whole`: integers only."""

    low: float
    high: float
    unit: str = ""
    above: bool = False
    whole: bool = False

    def check(self, name: str, value: Any) -> float:
        """Return the number; InputError with `name` where it is none, not finite, or outside."""
        real = isinstance(value, numbers.Real) and not isinstance(value, bool)
        good = real and math.isfinite(value) and (self.low < value if self.above else self.low <= value)
        if not good or value > self.high or (self.whole and value != int(value)):
            kind = "a whole number" if self.whole else "a number"
            span = f"{'above' if self.above else 'from'} {self.low:g} to {self.high:g} {self.unit}".rstrip()
            raise InputError(f"{name} = {value!r}: not {kind} {span}")
        return int(value) if self.whole else float(value)


PLAN_S = Range(300, 36_000, "s")
PLAN_CURRENT_A = Range(0.1, 3.2, "A")
PLAN_SUPPLY_A = Range(0.1, 60, "A")
PLAN_HOTTEST_C = Range(40, 200, "degC")
SPRING = Range(1, 64, whole=True)
SEED = Range(0, 2**32 - 1, whole=True)
DRIVE_S = Range(120, 36_000, "s")
RECORD_HZ = Range(1, 50, "rows a second", whole=True)
RECORD_S = Range(0, 1e8, "s", above=True)
"""Three years, and not for ever: 'no end' is not a number."""
SCENARIO_S = Range(2, 1e6, "s")
FAN_PERCENT = Range(0, 100, "percent", whole=True)
FRAME_S = Range(0, 1e6, "s", above=True)
OFFSET_S = Range(-1e10, 1e10, "s")
LOG_TIME_S = Range(-1e11, 1e11, "s")
"""A log's clock: seconds since 1970 are in it, milliseconds since then are not."""
PICTURE_S = Range(-1e11, 1e11, "s")
REPLAY_SPEED = Range(0.1, 1000, "times real time")
DASHBOARD_HZ = Range(1, 20, "rows a second", whole=True)
WORKERS = Range(1, 1024, whole=True)
