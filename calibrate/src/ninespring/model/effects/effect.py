"""What an effect is to the diagnosis: the ways it can be there, its numbers, bounds, sizes to try. Data, no search."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from ...io.results import Parameters
from .. import native
from ..spec import AROUND, AROUND_SHARE, Free, Spec


@dataclass(frozen=True)
class Candidate:
    """One way an effect can be there: its free numbers, what is fixed with it, sizes to probe and start at."""

    variant: str
    """Which spring, direction, ...; empty where there is one way only."""
    free: tuple[Free, ...]
    probes: tuple[Mapping[str, float], ...]
    """Values at which its direction is simulated for the forecast (one direction each)."""
    effect: str = ""
    """Its effect's name; the library fills it in."""
    fixed: tuple[tuple[str, float], ...] = ()
    signed: bool = False
    """Whether minus its direction is physical too."""
    most: float = 3.0
    """How many times its probe size a forecast may use."""
    more_starts: tuple[Mapping[str, float], ...] = ()
    mirror: Callable[[Mapping[str, float], Callable[[str], float]], Mapping[str, float]] | None = None
    """Where else a fit's numbers (those not free as declared) explain nearly the same: a fit that has come to one begins at the other, too."""
    also_on: tuple[str, ...] = ()
    """Further effects of the plant that carry it."""
    neutral: float = 0.0
    """The value of its (one) number at which it does nothing."""
    flexible: bool = False
    """Follows anything slow: it must beat a physical cause clearly."""
    alternatives: bool = False
    """Its probes are places to start from, not directions to be combined: the best one counts."""
    law: bool = False
    """One of the laws that its effect's number may be of: what is on or off may not tell them apart, and all are fitted."""
    slow_node: bool = False
    """A slow cause that a flexible one hides: tried in its place whatever the forecast says."""

    def added_to(self, spec: Spec) -> Spec:
        """Return a model with this effect on."""
        return spec.with_effect(self.effect, self.free, self.fixed, self.variant, self.also_on)

    def start_at(self, size: float, probe: int = 0) -> dict[str, float]:
        """Return starting values for a forecast size (1: as probed)."""
        out = dict(self.probes[probe])
        if len(self.free) == 1 or self.alternatives:
            one = self.free[0]
            value = self.neutral + size * (out[one.key] - self.neutral)
            if one.log:
                value = max(value, out[one.key] * 0.05)
            out[one.key] = min(one.high, max(one.low, value))
        return out


def one_number(number: Free, probe: float, variant: str = "", **more: Any) -> Candidate:
    """Return a way to be there that has one number, probed at this value; `more`: what else a candidate says."""
    return Candidate(variant, (number,), ({number.key: probe},), **more)


@dataclass(frozen=True)
class Steady:
    """The one number that a steady table of given temperatures can fix, and what is set with it."""

    number: str
    low: float
    high: float
    also: Mapping[str, float] = field(default_factory=dict)
    follows: Mapping[str, float] = field(default_factory=dict)
    """Numbers that are this share of the fitted one."""
    of_one_spring: bool = False
    """The number is the watched spring's own."""
    against: str = ""
    """What speaks against it in a table of the paper's kind."""

    def key(self, watched: int) -> str:
        """Return the parameter that the number is, of the watched spring (from 0) where it is one of a spring's own."""
        return f"{self.number}[{watched + 1}]" if self.of_one_spring else self.number

    def sets(self, value: float, watched: int) -> dict[str, float]:
        """Return all that the number sets; of a number per spring only the watched one's is meant."""
        follow = {name: share * value for name, share in self.follows.items()}
        return dict(self.also) | {self.key(watched): value} | follow


@dataclass(frozen=True)
class Scene:
    """What logs could show: the array, how it was driven, how hot and how long."""

    rows: int
    cols: int
    modes: frozenset[str]
    fan_seen: bool
    fan_between: bool
    """It also blew at a part of its command."""
    hottest_c: float
    step_s: float
    duration_s: float
    knots: Mapping[str, tuple[int, ...]]
    """Per kind of drift, how many knots each run has."""
    declared: Callable[[str], float]
    """What the declared array has for a parameter of the plant."""
    runs: int = 1
    ambient_logged: bool = False
    """In every run."""
    begins_k: float | None = None
    """By how much a run alone that begins at rest does so above its logged room, K."""
    load_moves: bool = False
    """A load was logged, and was not always the same."""
    camera: bool = True
    """What shows the temperatures may see more than one spring at once."""
    reads_ohm: bool = False
    """The readings are the springs' own resistances."""
    warm: tuple[int, ...] = ()
    """Runs that begin with springs that were heated before: what is around them was heated for as long as nobody saw."""

    @property
    def springs(self) -> int:
        """Number of springs."""
        return self.rows * self.cols

    @property
    def plane(self) -> bool:
        """Whether springs have diagonal neighbours."""
        return min(self.rows, self.cols) > 1

    @property
    def transforms(self) -> bool:
        """Whether the hottest spring comes near the declared transformation."""
        return self.hottest_c > self.declared("austenite_start_c") - 8.0


Numbers = Mapping[str, tuple[float, float | None]]
"""Values with standard errors, by name."""


@dataclass(frozen=True)
class Effect:
    """One effect: its name in the table of effects, and the ways it can be there."""

    name: str
    candidates: Callable[[Scene], Iterator[Candidate]]
    steady: Steady | None = None
    says: Callable[[Numbers, str], str] | None = None
    """What was found in one sentence: of the numbers' values with errors, and the variant."""

    def sentence(self, parameters: Parameters, variant: str) -> str:
        """Return what was found, in words and sizes."""
        numbers = {name: (one.value, one.stderr) for name, one in parameters.items()}
        if self.says:
            return self.says(numbers, variant)
        sizes = [sized(value, error, parameters[name].unit) for name, (value, error) in numbers.items()]
        return (
            f"{self.name.replace('_', ' ').capitalize()}{f' ({variant})' if variant else ''}: {', '.join(sizes[:3])}."
        )

    def candidates_for(self, scene: Scene) -> list[Candidate]:
        """Return the ways it could be there, its name filled in; what keeps heat has how much of it each warm run began with, too."""
        warm = scene.warm if self.name in AROUND else ()
        begun = [
            Free(f"{AROUND_SHARE}@{r + 1}", 1.0, 0.0, 1.0, "1", run=r, scale=0.5, prior=1.0, ends=True) for r in warm
        ]
        cold = ({free.key: 0.0 for free in begun},) if begun else ()
        return [
            replace(
                one,
                effect=self.name,
                free=tuple(replace(f, effect=self.name) for f in (*one.free, *begun)),
                more_starts=(*one.more_starts, *cold),
            )
            for one in self.candidates(scene)
        ]


def sized(value: float, error: float | None, unit: str = "", factor: float = 1.0) -> str:
    """Return a number with its error, as many digits as the error leaves."""
    value, error = value * factor, None if error is None else error * factor
    unit = "" if unit in ("", "1") else f" {unit}"
    if error is None or not error or error > abs(value):
        return f"{value:.2g}{unit}" + (" (hardly determined alone)" if error else "")
    order = math.floor(math.log10(error))
    digits = max(0, min(6, -order + (error / 10.0**order < 2.0)))
    return f"{value:.{digits}f}{unit} (+-{error:.{digits}f})"


def says(words: str, name: str, unit: str = "", factor: float = 1.0) -> Callable[[Numbers, str], str]:
    """Return what says a finding of one number in words, `{}` for its size and `{variant}` for its variant."""
    return lambda numbers, variant: words.format(sized(*numbers[name], unit, factor), variant=variant)


def percent(value: float, error: float | None, more: str = "more", less: str = "less") -> str:
    """Return a ratio as so many percent more or less."""
    size, bracket, rest = sized(abs(value - 1.0), error, factor=100.0).partition(" (")
    return f"{size} % {more if value > 1 else less}{bracket}{rest}"


def positive(name: str, low: float, high: float, start: float) -> Free:
    """Return a positive number fitted in its logarithm."""
    return Free(name, start, low, high, native.parameter_table()[name.partition("[")[0]].unit, (name,), True)


def linear(name: str, low: float, high: float, start: float, scale: float) -> Free:
    """Return a number fitted as it is; `scale` is a change that matters."""
    unit = native.parameter_table()[name.partition("[")[0]].unit
    return Free(name, start, low, high, unit, (name,), False, scale=scale)
