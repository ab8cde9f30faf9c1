"""What may act without a name in the library, and what a unit of it adds to the readings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate

import numpy as np
import pandas as pd

from ..infer.fit import Fit
from ..infer.heat import THIN, answers, power_of, step_answers, thin
from ..infer.problem import Problem
from ..io.logs.run import Run
from ..model.simulate import simulate_run
from .pursuit import steps_up

GRID_S = 15.0
"""Times at which something may begin or end."""
STEPS = 600
"""Of them at all springs together, at most: an array of many springs has a coarser grid."""
EDGES = 60
"""Of them in one run, at most."""
SHORTEST = 2
"""Of those times, how many anything lasts."""
EVERY = (1, 2, 4, 8)
"""Of those times, how many apart are those between which what comes and goes is straight: the fewer numbers, the cheaper."""
SMOOTHED = 5
"""Readings of a thermometer that are taken together."""
DELAYS_S = (10.0, 30.0, 90.0)
"""By which heat may come late."""
SHOWN = ("pickup", "mixing", "sensor", "reading", "share")
"""Kinds that are the thermometers' own: the springs are as they would be without."""


@dataclass(frozen=True)
class Cause:
    """One kind of unnamed cause at one place, and what a unit of it adds to the readings, thinned (samples, numbers)."""

    kind: str
    text: str
    profiles: tuple[np.ndarray | None, ...]
    """Per run (rows, springs): the heat of a unit, W, or what the thermometers show more, K; None: not in this run."""
    columns: np.ndarray
    edges: tuple[int, ...] = ()
    """Where given, the columns begin at one of these rows each and stay, the last is the end: a window is one less another."""

    bumps: tuple[tuple[int, int, int, int], ...] = ()
    """Where given, each column acts in one run about one row only, and less towards those before and after it, all of them
    together: it comes and goes."""

    @property
    def shown(self) -> bool:
        """Whether it is the thermometers that show it."""
        return self.kind in SHOWN

    @property
    def often(self) -> str:
        """The words for what acts for a while where it comes and goes all the time, in any run."""
        return f"{self.text.partition(', {}')[0]} again and again"

    @property
    def run(self) -> int:
        """Number of the run, the first, in which it acts."""
        return next(r for r, profile in enumerate(self.profiles) if profile is not None)

    @property
    def place(self) -> int:
        """The spring, from 0, at which alone it acts; -1 where at several."""
        acting = (profile.any(axis=0) for profile in self.profiles if profile is not None)
        there = {int(k) for springs in acting for k in np.flatnonzero(springs)}
        return there.pop() if len(there) == 1 else -1


def _delayed(power: np.ndarray, time_s: np.ndarray, delay_s: float) -> np.ndarray:
    step = float(np.median(np.diff(time_s)))
    keep = math.exp(-step / delay_s)
    # as scipy.signal.lfilter, which loads all of scipy.stats: a fifth of what every command that fits loads
    return np.array(list(accumulate((1.0 - keep) * power, lambda last, now: now + keep * last)))


def samples_of(problem: Problem) -> tuple[int, ...]:
    """Return the samples of each run: every THIN rows one of each spring."""
    return tuple(len(range(0, len(mask), THIN)) * mask.shape[1] for mask in problem.mask)


def thinned(problem: Problem, columns: np.ndarray) -> np.ndarray:
    """Return columns (count, n) with every THIN rows as one sample, unit noise kept: causes are slower than rows."""
    out = []
    for mask, part in zip(problem.mask, problem.by_run(columns), strict=True):
        whole = np.zeros((*mask.shape, columns.shape[1]))
        whole[mask] = part
        out.append(thin(whole))
    return np.concatenate(out)


def column_of(
    problem: Problem, fit: Fit, cause: Cause, typical_w: float, begin: int = 0, end: int | None = None
) -> np.ndarray:
    """Return what a unit of a cause, from one row to another, adds to the readings of all runs, (count, numbers)."""
    if cause.bumps:
        columns = np.column_stack([_bumps(problem, fit, cause, r, typical_w) for r in range(len(problem.runs))])
        # there all the time it would be a declared number that is off: that is left to the number, which nothing held else
        return _coming_and_going(columns, _declared_slopes(problem, fit))
    fields = []
    for r, (run, profile) in enumerate(zip(problem.runs, cause.profiles, strict=True)):
        if profile is None:
            fields.append(np.zeros_like(run.temperature_c))
            continue
        within = np.zeros_like(profile)
        within[begin:end] = profile[begin:end]
        fields.append(within if cause.shown else answers(problem, fit, r, [within], typical_w)[0])
    return np.concatenate(problem.scaled(fields))[:, None]


def _coming_and_going(columns: np.ndarray, beside: np.ndarray | None = None) -> np.ndarray:
    """Return columns of bumps (readings, bumps) less what all of them at once add, and what is beside it: a cause that comes and
    goes is there all the time by no part.

    All at once lose heat as the readings have it, and the declared loss as the model has it. The difference of both is what is
    left to explain, and explains it, whatever acts: a model that is led by its own readings.
    """
    whole = columns.sum(axis=1, keepdims=True)
    basis = np.linalg.qr(whole if beside is None else np.column_stack([beside, whole]))[0]
    return columns - basis @ (basis.T @ columns)


def _declared_slopes(problem: Problem, fit: Fit) -> np.ndarray:
    """Return what the declared numbers move of the readings, nothing taken out, (count, numbers)."""
    taken, problem.unnamed = problem.unnamed, None
    numbers = [k for k, free in enumerate(fit.spec.free) if free.effect is None]
    slopes = problem.slopes(fit, numbers)
    problem.unnamed = taken
    return slopes[:, np.linalg.norm(slopes, axis=0) > 1e-6]


def bump(first: int, top: int, last: int, rows: int) -> np.ndarray:
    """Return the part of a cause that comes and goes in each row, (rows, 1): straight up to all of it, and down again."""
    row = np.arange(rows)
    return np.clip(np.minimum((row - first) / (top - first), (last - row) / (last - top)), 0.0, 1.0)[:, None]


def _bumps(problem: Problem, fit: Fit, cause: Cause, r: int, typical_w: float) -> np.ndarray:
    """Return what the bumps of a cause in one run add to the readings of all, (count, bumps)."""
    profile, bumps = cause.profiles[r], [one[1:] for one in cause.bumps if one[0] == r]
    if profile is None or not bumps:
        return np.zeros((problem.count, 0))
    shown = answers(problem, fit, r, [bump(*one, len(profile)) * profile for one in bumps], typical_w)
    out = np.zeros((problem.count, len(bumps)))
    problem.by_run(out)[r][:] = np.column_stack([(field / problem.noise[r])[problem.mask[r]] for field in shown])
    return out


def typical_power(problem: Problem, fit: Fit) -> float:
    """Return the mean power of a spring while it is driven, W."""
    powers = np.concatenate([power_of(problem, fit, r) for r in range(len(problem.runs))])
    return float(powers[powers > 0].mean()) if (powers > 0).any() else 1.0


def library(problem: Problem, fit: Fit) -> list[Cause]:
    """Return every unnamed cause, simulated around a fit."""
    typical = typical_power(problem, fit)
    profiles: dict[tuple[str, str], list[np.ndarray | None]] = {}
    columns: dict[tuple[str, str], list[np.ndarray]] = {}
    windows: list[Cause] = []
    for r, run in enumerate(problem.runs):
        power, by_key = power_of(problem, fit, r), fit.as_dict()
        plant = problem.plant_for(fit.spec, fit.values, r)
        ambient = problem.ambient_of(r, by_key)
        shown = simulate_run(plant, problem.begun(r, by_key), ambient)
        around = np.full(len(run.time_s), plant.get("ambient_c")) if ambient is None else ambient
        rise = shown - around[:, None]
        # where something unknown acts, the readings know better than the fit how warm the springs are
        read = pd.DataFrame(run.temperature_c).rolling(SMOOTHED, center=True, min_periods=1).mean().to_numpy()
        shown = np.where(np.isfinite(read), read, shown)
        over = shown - around[:, None]
        still, blown = plant.get("loss_w_per_k"), plant.get("loss_fan_w_per_k")
        loss_w_per_k = still + run.fan * (blown - still)
        lost = over * loss_w_per_k[:, None]
        acting = _everywhere(problem, run, power, shown, over, lost)
        heating = [key for key in acting if key[0] not in SHOWN]
        moved = dict(zip(heating, answers(problem, fit, r, [acting[key] for key in heating], typical), strict=True))
        for key, profile in acting.items():
            nothing = [np.zeros((one, 1), dtype=np.float32) for one in samples_of(problem)]
            profiles.setdefault(key, [None] * len(problem.runs))[r] = profile
            scaled = np.where(problem.mask[r], moved.get(key, profile) / problem.noise[r], 0.0)
            columns.setdefault(key, nothing)[r] = thin(scaled[:, :, None])
        windows += _windows(problem, fit, r, power, lost, rise, loss_w_per_k, typical)
    everywhere = [Cause(*key, tuple(profiles[key]), np.concatenate(parts)) for key, parts in columns.items()]
    return everywhere + windows + [one for every in EVERY for one in _often(windows, every)]


def _often(windows: Sequence[Cause], every: int) -> list[Cause]:
    """Return what comes and goes all the time: bumps at every so many edges of the windows of one kind and place in all runs."""
    together: dict[tuple[str, str], list[Cause]] = {}
    for one in windows:
        if not one.shown:
            together.setdefault((one.kind, one.often), []).append(one)
    out = []
    for (kind, text), parts in together.items():
        bumps, columns = [], []
        for one in parts:
            run = one.run
            profile = one.profiles[run]
            tops = [*one.edges[:-1:every], one.edges[-1]]
            times = [2 * tops[0] - tops[1], *tops, 2 * tops[-1] - tops[-2]]
            about = list(zip(times, times[1:], times[2:], strict=False))
            bumps += [(run, *times) for times in about]
            # what acts from each edge to the next, as much of it as the bump is there
            between = one.columns - np.column_stack([one.columns[:, 1:], np.zeros(len(one.columns))])
            whole = np.column_stack([bump(*times, len(profile)) for times in about])
            part = np.add.reduceat(whole, one.edges[:-1], axis=0) / np.diff(one.edges)[:, None]
            columns.append(between @ part)
        of_runs = zip(*(part.profiles for part in parts), strict=True)
        merged = [next((one for one in profiles if one is not None), None) for profiles in of_runs]
        thin_columns = _coming_and_going(np.column_stack(columns)).astype(np.float32)
        out.append(Cause(kind, text, tuple(merged), thin_columns, bumps=tuple(bumps)))
    return out


def only(k: int, values: np.ndarray, springs: int) -> np.ndarray:
    """Return values (rows,) at one spring, 0 at all others, (rows, springs)."""
    out = np.zeros((len(values), springs))
    out[:, k] = values
    return out


def _everywhere(
    problem: Problem, run: Run, power: np.ndarray, shown: np.ndarray, over: np.ndarray, lost: np.ndarray
) -> dict[tuple[str, str], np.ndarray]:
    """Return, per kind and words, what acts all the time: heat (rows, springs), W, or what thermometers show, K."""
    springs, (rows, cols) = run.springs, (problem.array.rows, problem.array.cols)
    place = [divmod(k, cols) for k in range(springs)]
    ramp = (run.time_s - run.time_s[0]) / max(1.0, run.duration_s)
    out: dict[tuple[str, str], np.ndarray] = {}
    for j in range(springs):
        for k in range(springs):
            apart = max(abs(a - b) for a, b in zip(place[j], place[k], strict=True))
            if j == k or (springs > 16 and apart > 2):
                continue
            out["crosstalk", f"the drive of spring {j + 1} also heats spring {k + 1}"] = only(k, power[:, j], springs)
            seen = only(k, shown[:, j] - shown[:, k], springs)
            out["mixing", f"thermometer {k + 1} also sees spring {j + 1}"] = seen
            if j < k and apart > 1:
                flow = over[:, j] - over[:, k]
                text = f"springs {j + 1} and {k + 1} are joined, though no neighbours"
                out["bridge", text] = only(k, flow, springs) - only(j, flow, springs)
    for words, step in (("above", (1, 0)), ("below", (-1, 0)), ("to the left", (0, 1)), ("to the right", (0, -1))):
        warmed = np.zeros_like(power)
        for k, (row, col) in enumerate(place):
            beside = (row - step[0], col - step[1])
            if 0 <= beside[0] < rows and 0 <= beside[1] < cols:
                warmed[:, k] = np.maximum(over[:, beside[0] * cols + beside[1]], 0.0)
        if warmed.any():
            out["plume", f"each spring is warmed by the one {words}"] = warmed
            if run.fan.any():
                still = (1.0 - run.fan)[:, None]
                out["plume", f"each spring is warmed by the one {words}, without the fan"] = warmed * still
    for delay_s in DELAYS_S:
        out["delay", f"a part of the heat comes {delay_s:g} s late"] = _delayed(power, run.time_s, delay_s) - power
    out["trend", "all losses change over the run"] = -lost * ramp[:, None]
    out["trend", "all drives change over the run"] = power * ramp[:, None]
    amperes = np.sqrt(np.maximum(power, 0.0) / max(1e-12, float(power.mean())))
    out["pickup", "each thermometer shows its spring's current"] = amperes
    out["pickup", "each thermometer shows its spring's power"] = power / max(1e-12, float(power.mean()))
    for k in range(springs):
        out["trend", f"the loss of spring {k + 1} changes over the run"] = only(k, -lost[:, k] * ramp, springs)
        out["trend", f"the drive of spring {k + 1} changes over the run"] = only(k, power[:, k] * ramp, springs)
        out["reading", f"thermometer {k + 1} drifts"] = only(k, ramp, springs)
        out["heat", f"spring {k + 1} is given heat all the time"] = only(k, np.ones_like(ramp), springs)
        if springs > 1:
            out["pickup", f"thermometer {k + 1} shows its spring's current"] = only(k, amperes[:, k], springs)
    return out


@dataclass(frozen=True)
class Stepwise:
    """What may begin and end at some rows of one run, as columns of all readings."""

    run: int
    runs: int
    mask: np.ndarray
    noise: np.ndarray
    edges: np.ndarray
    ends: tuple[int, ...]
    samples: tuple[int, ...]

    @staticmethod
    def of(problem: Problem, r: int, most: int | None = None) -> Stepwise | None:
        """Return it for one run, at so many edges at `most`; None where that has too few rows."""
        run = problem.runs[r]
        rows, springs = run.temperature_c.shape
        step = float(np.median(np.diff(run.time_s)))
        grid = max(1, round(GRID_S / step), -(-rows // (most or min(EDGES, max(8, STEPS // springs)))))
        edges = np.arange(0, rows, grid)
        if len(edges) < 4:
            return None
        ends = (*(int(edge) for edge in edges), rows)
        return Stepwise(r, len(problem.runs), problem.mask[r], problem.noise[r], edges, ends, samples_of(problem))

    def thinned(self, block: np.ndarray) -> np.ndarray:
        """Return fields (edges, rows, springs), K, as columns (samples, edges)."""
        return thin(np.moveaxis(np.where(self.mask, block / self.noise, 0.0), 0, 2))

    def cause(self, kind: str, text: str, profile: np.ndarray, block: np.ndarray) -> Cause:
        """Return the cause of such columns."""
        columns = np.zeros((sum(self.samples), len(self.edges)), dtype=np.float32)
        begin = sum(self.samples[: self.run])
        columns[begin : begin + self.samples[self.run]] = block
        profiles: list[np.ndarray | None] = [None] * self.runs
        profiles[self.run] = profile
        return Cause(kind, f"{text}, {{}} of run {self.run + 1}", tuple(profiles), columns, self.ends)

    def of_thermometer(self, k: int, rise: np.ndarray) -> list[Cause]:
        """Return what one thermometer may show: so much more, or a part more of its spring's rise (rows, springs) by the fit."""
        rows, springs = self.mask.shape
        jumps = steps_up(self.edges, rows, springs, k)
        text = f"thermometer {k + 1} shows more of its spring's rise"
        # of the fit's own rise: a part of the readings would explain all that they show
        return [
            self.cause("sensor", f"thermometer {k + 1} jumps", only(k, np.ones(rows), springs), self.thinned(jumps)),
            self.cause("share", text, only(k, rise[:, k], springs), self.thinned(jumps * rise)),
        ]


def of_thermometers(problem: Problem, fit: Fit) -> list[Cause]:
    """Return what single thermometers may show that their springs do not, in a window of one run: a simulation a run."""
    out = []
    for r, run in enumerate(problem.runs):
        if (into := Stepwise.of(problem, r)) is not None:
            rise = risen(problem, fit, r)
            out += [one for k in range(run.springs) for one in into.of_thermometer(k, rise)]
    return out


def risen(problem: Problem, fit: Fit, r: int) -> np.ndarray:
    """Return by how much a fit has the springs of a run above what is around them, (rows, springs), K."""
    plant = problem.plant_for(fit.spec, fit.values, r)
    ambient = problem.ambient_of(r, fit.as_dict())
    around = np.full(len(problem.runs[r].time_s), plant.get("ambient_c")) if ambient is None else ambient
    return simulate_run(plant, problem.runs[r], ambient) - around[:, None]


def _windows(
    problem: Problem,
    fit: Fit,
    r: int,
    power: np.ndarray,
    lost: np.ndarray,
    rise: np.ndarray,
    loss_w_per_k: np.ndarray,
    typical_w: float,
) -> list[Cause]:
    """Return what may begin and end in one run: heat, drives, losses and thermometers, each in steps at the edges."""
    into = Stepwise.of(problem, r)
    if into is None:
        return []
    edges, ends, cause = into.edges, into.ends, into.cause
    rows, springs = rise.shape
    # what follows from them is linear: of half a day one is twenty megabytes, thinned three
    answer = step_answers(problem, fit, r, edges, typical_w)
    steps = [into.thinned(answer.pop(("heat", k))) for k in range(springs)]

    def shaped(k: int, heat: np.ndarray) -> np.ndarray:
        """Return the answers to a heat of spring k that begins at each edge, from those to constant heat between edges."""
        mean = np.add.reduceat(heat, edges) / np.diff(ends)
        between = steps[k] - np.pad(steps[k][:, 1:], ((0, 0), (0, 1)))
        return np.cumsum((mean * between)[:, ::-1], axis=1)[:, ::-1]

    out = []
    everything_lost, everything_driven, warmer = (np.zeros(steps[0].shape) for _ in range(3))
    one = np.ones(rows)
    for k in range(springs):
        everything_lost += shaped(k, -lost[:, k])
        warmer += shaped(k, loss_w_per_k)
        driven = shaped(k, power[:, k])
        everything_driven += driven
        out.append(cause("contact", f"the drive of spring {k + 1} changes", only(k, power[:, k], springs), driven))
        out.append(cause("heat", f"spring {k + 1} is given heat", only(k, one, springs), steps[k]))
        out += into.of_thermometer(k, rise)
    out.append(cause("gust", "all losses change", -lost, everything_lost))
    out.append(cause("surroundings", "the surroundings are warmer", np.outer(loss_w_per_k, np.ones(springs)), warmer))
    if springs > 1:
        every = steps_up(edges, rows, springs, slice(None))
        out.append(cause("sensor", "all thermometers jump", np.ones((rows, springs)), into.thinned(every)))
        out.append(cause("supply", "all drives change", power, everything_driven))
    return out
