"""One log, checked: what every fit starts from."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np

from .branch import hotter_before

DriveMode = Literal["power", "current", "command", "temperature"]
"""`temperature`: of no log, but as a simulation is driven that only follows it."""
SENSORS = ("camera", "thermocouple", "thermistor", "resistance", "semiconductor")
"""What measures temperatures: the first sees more than one spring, the others touch each its own."""


@dataclass
class Run:
    """One log, checked. Arrays have one row per time (n) and one column per spring (k)."""

    name: str
    sha256: str
    time_s: np.ndarray
    mode: DriveMode
    drive: np.ndarray
    """(n, k): W, A or 0..1 by `mode`; row r holds until time r + 1."""
    temperature_c: np.ndarray
    """(n, k), NaN where not measured or not trusted."""
    fan: np.ndarray
    ambient_c: np.ndarray | None
    """(n,) or None where the log has none."""
    room_told: bool = False
    """`ambient_c` is where a model has the room, not where it was logged."""
    current_a: np.ndarray | None = None
    voltage_v: np.ndarray | None = None
    layers: int = 1
    """2: the first half of the springs is the elongation layer, the other the stiffness layer below it."""
    load_n: np.ndarray | None = None
    """(n, k), N, or None where the log has none; row r holds until time r + 1."""
    notes: list[str] = field(default_factory=list)
    sensor: str = ""
    """One of SENSORS, where the log says which."""
    step_v: float = 0.0
    """By which voltages step, V: a board's sensors, or the last digit that was written; 0: by nothing that counts."""
    warm: bool = False
    """The run begins warm and steady: hidden heat is in balance with the first inputs."""
    around_share: float = 1.0
    """Where springs begin warm: what air, plate and holders have of that, 1: as much as beside springs that had long been so warm."""
    starts: list[int] = field(default_factory=lambda: [0])
    """Rows at which a simulation starts again from the measured temperatures (the first; after gaps)."""
    hotter: np.ndarray | None = None
    """(starts, k): which springs come down from austenite at each of them (`branch`); None: nobody looked."""

    rounding_c: np.ndarray | None = None
    """(k,): what the thermometers' steps leave in a reading as it was logged, rms, where they hide its noise."""

    def __repr__(self) -> str:
        measured = int(np.isfinite(self.temperature_c).any(axis=0).sum())
        return (
            f"<run {Path(self.name).name}: {len(self.time_s)} rows, {self.duration_s:.0f} s, {self.springs} springs by "
            f"{self.mode}, {measured} measured>"
        )

    @property
    def springs(self) -> int:
        """Number of springs."""
        return self.temperature_c.shape[1]

    @property
    def duration_s(self) -> float:
        """From the first row to the last, s."""
        return float(self.time_s[-1] - self.time_s[0])

    def part(self, rows: slice | np.ndarray) -> Run:
        """Return some rows on end, a slice or a mask, as a run of its own; v and i are left out."""
        ambient, load = self.ambient_c, self.load_n
        out = replace(
            self,
            time_s=self.time_s[rows],
            drive=np.ascontiguousarray(self.drive[rows]),
            temperature_c=self.temperature_c[rows].copy(),
            fan=self.fan[rows],
            ambient_c=None if ambient is None else ambient[rows],
            current_a=None if self.current_a is None else self.current_a[rows],
            voltage_v=None if self.voltage_v is None else self.voltage_v[rows],
            load_n=None if load is None else load[rows],
            starts=[0],
        )
        first = int(np.arange(len(self.time_s))[rows][0])
        if self.hotter is not None:
            known = first in self.starts  # by all of the log, and by what does not count after a gap
            out.hotter = self.hotter[[self.starts.index(first)]] if known else hotter_before(out)
        out.current_a = out.voltage_v = None
        return out
