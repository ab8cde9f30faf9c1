"""What a model is to a fit: effects on, fixed values, free numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

RUN_DRIVE, RUN_AMBIENT, RUN_SENSOR = RUNS_OWN = ("run_drive_gain", "run_ambient_offset", "run_sensor_offset")
"""What may be a run's own (effects/runs_differ.py): of the measurement, unknown to the plant."""
DRIVE_GAIN, AMBIENT_OFFSET, SENSOR_OFFSET = "drive_gain", "ambient_offset_k", "run_sensor_offset_k"
"""Their numbers, by run: `drive_gain@1`."""
AROUND = "shared_air", "plate_conduction", "holder_mass"
"""Effects that keep heat around the springs ..."""
AROUND_SHARE = "around_share"
"""... and as what part of the springs' own warmth they had as a run began warm, by run: `around_share@1`."""
Values = Sequence[float] | np.ndarray
"""Values of a spec's free numbers, in their order and units."""


@dataclass(frozen=True)
class Free:
    """One free number of a fit.

    `names` are the plant's parameters that take its value. `ambient` numbers set a run's ambient instead: a constant, or
    a hat function of time around `knot` of the run's knots.
    """

    key: str
    start: float
    low: float
    high: float
    unit: str
    names: tuple[str, ...] = ()
    log: bool = False
    run: int | None = None
    knot: int | None = None
    effect: str | None = None
    scale: float = 1.0
    """A change that matters, in its unit (linear numbers only)."""
    shifts: tuple[tuple[str, float], ...] = ()
    """Parameters of the plant to which it is added, times a weight, instead of being their value."""
    prior: float | None = None
    """Standard deviation, in the inner coordinate, of what is believed of it before: about its start."""
    absent: float | None = None
    """Value that it has where its effect is not there, if what is believed speaks against that, too."""
    ends: bool = False
    """Its bounds are the ends of what there is (none, all): a number that lies there is as good as any."""

    @property
    def trust(self) -> float:
        """Return the inverse of `prior`, 0 where nothing is believed."""
        return 1.0 / self.prior if self.prior else 0.0

    def inner(self, value: float) -> float:
        """Map to the coordinate the optimiser works in."""
        return math.log(value) if self.log else value / self.scale

    def outer(self, z: float) -> float:
        """Map back."""
        value = math.exp(min(z, math.log(self.high))) if self.log else z * self.scale
        return min(self.high, max(self.low, value))

    @property
    def slope_step(self) -> float:
        """Step of a finite difference in the inner coordinate."""
        return 0.01 if self.log else 0.02


@dataclass(frozen=True)
class Spec:
    """What a model is: effects on, values fixed, numbers free."""

    effects: tuple[str, ...] = ()
    fixed: tuple[tuple[str, float], ...] = ()
    free: tuple[Free, ...] = ()
    variant: tuple[tuple[str, str], ...] = ()
    """Per effect, which variant (spring, direction, ...)."""

    also_on: tuple[tuple[str, str], ...] = ()
    """(effect, effect of the plant that is on with it)."""

    def with_effect(
        self,
        effect: str,
        free: Iterable[Free],
        fixed: Iterable[tuple[str, float]],
        variant: str,
        also_on: Iterable[str] = (),
    ) -> Spec:
        """Return the spec with one more effect on."""
        return Spec(
            (*self.effects, effect),
            tuple((dict(self.fixed) | dict(fixed)).items()),
            (*self.free, *(one for one in free if one.key not in {f.key for f in self.free})),
            (*self.variant, (effect, variant)),
            (*self.also_on, *((effect, other) for other in also_on)),
        )

    def settings(self, values: Iterable[float], declared: Callable[[str], float]) -> dict[str, float]:
        """Return what free numbers with these values make of the plant's parameters."""
        out: dict[str, float] = {}
        for free, value in zip(self.free, values, strict=True):
            out |= dict.fromkeys(free.names, float(value))
            for name, weight in free.shifts:
                out[name] = out.get(name, declared(name)) + weight * float(value)
        return out

    @property
    def plant_effects(self) -> tuple[str, ...]:
        """Effects to switch on in the plant."""
        on = dict.fromkeys((*self.effects, *(other for _, other in self.also_on)))
        return tuple(effect for effect in on if effect not in RUNS_OWN)

    def without(self, effect: str) -> Spec:
        """Return the spec without an effect (its fixed values stay: they count only while it is on)."""
        return replace(
            self,
            effects=tuple(e for e in self.effects if e != effect),
            free=tuple(f for f in self.free if f.effect != effect),
            variant=tuple(v for v in self.variant if v[0] != effect),
            also_on=tuple(v for v in self.also_on if v[0] != effect),
        )
