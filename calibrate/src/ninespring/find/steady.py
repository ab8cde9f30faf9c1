"""Steady tables (docs/files.md): which effect, with one number each, explains what a table shows."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.optimize import minimize_scalar

from ..export.settings import judged
from ..io import results
from ..io.logs import read_bytes, read_table, sha256_of
from ..io.statistics import rms
from ..model import effects, native
from ..model.effects import Effect
from ..model.models import Array, Model
from .search import TOLD_APART

KINDS = (("hold", "_c"), ("i", "_a"), ("t", "_c"))
"""Columns of each spring: held, driven, measured."""


@dataclass
class State:
    """One steady state: what is held, driven and measured, NaN where not."""

    case: str
    pitch_mm: float
    fan: float
    ambient_c: float
    hold_c: np.ndarray
    current_a: np.ndarray
    measured_c: np.ndarray


def is_steady(path: Path) -> bool:
    """Return whether a file is a steady table: it has no time_s but `case` or held temperatures."""
    for line in read_bytes(path)[:20000].decode("utf-8-sig", "replace").splitlines():
        if line.strip() and not line.startswith("#"):
            names = [n.strip() for n in line.split(",")]
            return "time_s" not in names and ("case" in names or any(n.startswith("hold") for n in names))
    return False


def read_steady(path: Path, springs: int = 9) -> list[State]:
    """Read a steady table; refused with file, line and column where it is wrong."""
    table = read_table(path, text_columns=("case",))
    kinds = {kind: [f"{kind}{k}{end}" for k in range(1, springs + 1)] for kind, end in KINDS}
    known = {"case", "pitch_mm", "fan", "ambient_c"}.union(*kinds.values())
    for name in table.names:
        if name not in known:
            said = "a steady table has case, pitch_mm, fan, ambient_c, hold1_c, i1_a, t1_c ..."
            raise table.refuse_header(f"unknown column '{name}': {said}", name)
    frame = table.frame
    hold, current, measured = (frame.reindex(columns=names).to_numpy(float) for names in kinds.values())
    for row, k in np.argwhere(np.isfinite(hold) & np.isfinite(current) & (current != 0)):
        said = f"spring {k + 1} has both a current and a prescribed temperature"
        raise table.refuse_cell(said, row, f"hold{k + 1}_c")

    def column(name: str, default: float) -> list[float]:
        return frame[name].tolist() if name in frame else [default] * len(frame)

    cases = map(str, frame["case"]) if "case" in frame else [f"row {row + 1}" for row in range(len(frame))]
    numbers = column("pitch_mm", math.nan), column("fan", 0.0), column("ambient_c", 20.0)
    states = [State(*one) for one in zip(cases, *numbers, hold, current, measured, strict=True)]
    if not np.isfinite(measured).any():
        raise table.refuse_header("no measured temperature (t1_c ...)")
    return states


def settle(
    array: Array, declared: Mapping[str, float], on: Mapping[str, Mapping[str, float]], state: State
) -> np.ndarray:
    """Return what the sensors show in a steady state, with effects on at these values."""
    plant = native.Plant(array.rows, array.cols)
    if math.isfinite(state.pitch_mm) and "orthogonal_w_per_k" not in declared:
        native.paper_configure(plant, state.pitch_mm)
    plant.set_all(declared)
    plant.set_effects(on)
    for values in on.values():
        plant.set_all(values)
    plant.set_ambient(state.ambient_c)
    plant.set_fan(state.fan)
    for k in range(array.springs):
        if math.isfinite(state.hold_c[k]):
            plant.drive(k, native.TEMPERATURE, state.hold_c[k])
        else:
            plant.drive(k, native.CURRENT, state.current_a[k] if math.isfinite(state.current_a[k]) else 0.0)
    plant.reset()
    plant.settle(1e6)
    return plant.measured_c()


def errors(
    array: Array, declared: Mapping[str, float], on: Mapping[str, Mapping[str, float]], states: list[State]
) -> np.ndarray:
    """Return measured minus model over everything measured, K."""
    out = []
    for state in states:
        try:
            shown = settle(array, declared, on, state)
        except native.NativeError:
            shown = np.full(array.springs, 1e3)
        seen = np.isfinite(state.measured_c)
        out.append((state.measured_c - shown)[seen])
    return np.concatenate(out)


def fit_one(
    array: Array, declared: Mapping[str, float], effect: Effect, states: list[State], watched: int
) -> tuple[float, dict[str, float]]:
    """Fit an effect's one number; return it and all that is set with it."""
    steady = effect.steady
    log = steady.low > 0 and steady.high / steady.low > 100
    inner = (math.log(steady.low), math.log(steady.high)) if log else (steady.low, steady.high)

    def cost(z: float) -> float:
        on = steady.sets(math.exp(z) if log else z, watched)
        return float((errors(array, declared, {effect.name: on}, states) ** 2).sum())

    grid = np.linspace(*inner, 25)
    values = [cost(z) for z in grid]
    k = int(np.argmin(values))
    found = minimize_scalar(cost, bounds=(grid[max(0, k - 1)], grid[min(24, k + 1)]), method="bounded")
    z = float(found.x) if found.fun < values[k] else float(grid[k])
    value = math.exp(z) if log else z
    return value, steady.sets(value, watched)


@dataclass
class _Tried:
    """An effect tried on a steady table: what is told of it, all that its number sets, what it leaves, K."""

    told: results.SteadyCandidate
    sets: dict[str, float] = field(default_factory=dict)
    left: np.ndarray = field(default_factory=lambda: np.empty(0))

    def parameters(self) -> results.Parameters:
        """Return its number, and what is set with it."""
        told = self.told
        number = results.Number(value=told.value, stderr=told.stderr, unit=told.unit)
        if told.at_bound:
            number.note = "at its bound"
        out = {told.parameter: number}
        for name, value in self.sets.items():
            if name != told.parameter:
                unit = native.parameter_table()[name].unit
                out[name] = results.Number(value=value, stderr=None, unit=unit, note="set with it, not fitted")
        return out


def _tried(
    array: Array, declared: Mapping[str, float], effect: Effect, states: list[State], watched: int, before: np.ndarray
) -> _Tried:
    """Fit an effect's one number to all states, and to all but each in turn; its error by the slope at what was found."""
    name, steady = effect.name, effect.steady
    if steady is None:
        note = "cannot show in a steady state of given temperatures"
        rmse = rms([before])
        return _Tried(results.SteadyCandidate(name=name, rmse_c=rmse, holdout_rmse_c=rmse, note=note))
    value, on = fit_one(array, declared, effect, states, watched)
    left = errors(array, declared, {name: on}, states)
    held = []
    for k in range(len(states)):
        _, other = fit_one(array, declared, effect, states[:k] + states[k + 1 :], watched)
        held.append(errors(array, declared, {name: other}, [states[k]]))
    low, high = steady.low, steady.high
    at = min(high, value + max(1e-6, 1e-3 * (high - low)))
    slope = (errors(array, declared, {name: steady.sets(at, watched)}, states) - left) / max(1e-12, at - value)
    spread = math.sqrt(float((left**2).sum()) / max(1, len(left) - 1))
    n, steep = len(left), float(np.linalg.norm(slope))
    gained = math.log(max(float((before**2).sum()), 1e-9) / max(float((left**2).sum()), 1e-9))
    told = results.SteadyCandidate(
        name=name,
        parameter=steady.key(watched),
        value=value,
        stderr=spread / steep if steep > 0 else None,
        unit=native.parameter_table()[steady.number].unit,
        rmse_c=rms([left]),
        holdout_rmse_c=rms(held),
        evidence=0.5 * n * gained - 0.5 * math.log(n),
        at_bound=bool(value - low < 1e-3 * (high - low) or high - value < 1e-3 * (high - low)),
        note="changes nothing here" if np.abs(left - before).max() < 1e-6 else steady.against,
    )
    return _Tried(told, on, left)


def diagnose_states(
    array: Array, declared: Mapping[str, float], states: list[State], progress: Callable[[str], None] = lambda t: None
) -> results.SteadyDiagnosis:
    """Try every effect with one number on steady states; return a result of the diagnosis' shape.

    The declared model stays frozen. Held out: one state after the other.
    """
    before = errors(array, declared, {}, states)
    seen = [(state, int(k)) for state in states for k in np.flatnonzero(np.isfinite(state.measured_c))]
    watched = seen[0][1]
    tried = []
    for effect in effects.library():
        progress(f"fitting {effect.name}")
        tried.append(_tried(array, declared, effect, states, watched, before))
    tried.sort(key=lambda one: one.told.holdout_rmse_c)
    rmse = rms([before])
    useful = [one for one in tried if (one.told.evidence or 0.0) > 2.0 and one.told.holdout_rmse_c < 0.7 * rmse]
    best = useful[0] if useful else None
    after_c, holdout_c = (best.told.rmse_c, best.told.holdout_rmse_c) if best else (rmse, rmse)
    note = f"{len(before)} numbers: no noise can be estimated; 1 degC is assumed (the table gives whole degrees)"
    cases = [
        results.Case(
            case=state.case if len(seen) == len(states) else f"{state.case}, spring {k + 1}",
            measured_c=float(state.measured_c[k]),
            before_c=float(state.measured_c[k] - left),
        )
        for (state, k), left in zip(seen, before, strict=True)
    ]
    for case, left in zip(cases, best.left if best else (), strict=bool(best)):
        case.after_c = case.measured_c - float(left)
    return results.SteadyDiagnosis(
        logs=[],
        baseline=results.Baseline(rmse_c=rmse, holdout_rmse_c=rmse, noise_c=1.0),
        effects=[_adopted(best)] if best else [],
        rivals=[
            _rival(array, declared, states[0], best, one)
            for one in useful[1:]
            if best.told.evidence - one.told.evidence < TOLD_APART
        ],
        after=results.After(rmse_c=after_c, holdout_rmse_c=holdout_c),
        unexplained=bool(after_c > 3.0),
        residual=results.Residual(autocorrelation_lag1=0.0, depends_on=[], note=note),
        candidates=[one.told for one in tried],
        cases=cases,
        identifiability=results.Identifiability(not_identifiable=[], at_bounds=[], correlated=[]),
        warnings=[],
    )


def _adopted(one: _Tried) -> results.Effect:
    return results.Effect(
        name=one.told.name,
        rmse_c=one.told.rmse_c,
        holdout_rmse_c=one.told.holdout_rmse_c,
        evidence=one.told.evidence,
        parameters=one.parameters(),
        on_chip=one.told.name in effects.ON_CHIP,
        in_words=effects.IN_WORDS[one.told.name],
    )


def _rival(array: Array, declared: Mapping[str, float], like: State, best: _Tried, one: _Tried) -> results.Rival:
    return results.Rival(
        instead_of=best.told.name,
        name=one.told.name,
        rmse_c=one.told.rmse_c,
        holdout_rmse_c=one.told.holdout_rmse_c,
        evidence=best.told.evidence - one.told.evidence,
        parameters=one.parameters(),
        separating_experiment=separate(array, declared, like, best, one),
        against=one.told.note,
    )


def separate(array: Array, declared: Mapping[str, float], like: State, a: _Tried, b: _Tried) -> str:
    """Return the steady or cooling experiment in which two fitted effects differ most, computed with both."""
    n, cols = array.springs, array.cols
    best: tuple[float, str] = (-1.0, "")
    hot = float(np.nanmax(like.hold_c)) if np.isfinite(like.hold_c).any() else 99.0
    patterns = {
        "spring 1 alone": [0],
        f"spring {n // 2 + 1} alone": [n // 2],
        "the first column": [k for k in range(n) if k % cols == 0],
        "all but the centre": [k for k in range(n) if k != n // 2],
    }
    for words, held in patterns.items():
        for fan in (0.0, 1.0):
            hold = np.full(n, math.nan)
            hold[held] = hot
            state = State("", like.pitch_mm, fan, like.ambient_c, hold, np.full(n, math.nan), np.full(n, math.nan))
            shown = [settle(array, declared, {one.told.name: one.sets}, state) for one in (a, b)]
            apart = np.abs(shown[0] - shown[1])
            k = int(np.argmax(apart))
            if apart[k] > best[0]:
                best = (
                    float(apart[k]),
                    f"hold {words} at {hot:.0f} degC {'with' if fan else 'without'} the fan until steady (15 min); watch "
                    f"spring {k + 1}: {a.told.name} says {shown[0][k]:.1f}, {b.told.name} {shown[1][k]:.1f} degC, "
                    f"{apart[k]:.1f} apart",
                )
    return best[1]


def diagnose_table(
    path: Path, model: Model | None, array: Array, frozen: bool, progress: Callable[[str], None]
) -> tuple[results.SteadyDiagnosis, Model]:
    """Diagnose a steady table by the declared (frozen) model; without one, by the paper's."""
    array.one_layer("diagnose knows")
    states = read_steady(path, array.springs)
    declared = dict(model.parameters) if model else {}
    told = diagnose_states(array, declared, states, progress)
    told.logs = [results.Read(file=path.name, sha256=sha256_of(path), rows=len(states))]
    if not frozen and model is None:
        told.warnings.append("no --model: the paper's declared model (docs/physics.md) was taken, frozen")
    made = model_after(told, model, array)
    judged(told.effects, made)
    results.checked(told)
    return told, made


def model_after(told: results.SteadyDiagnosis, model: Model | None, array: Array) -> Model:
    """Return the model with the adopted effect."""
    out = Model(array)
    out.effects = [one.name for one in told.effects]
    if model:
        out.parameters = dict(model.parameters)
        out.effects = [*model.effects, *(e for e in out.effects if e not in model.effects)]
    for effect in told.effects:
        for name, one in effect.parameters.items():
            out.parameters[name] = one.value
            if one.stderr is not None:
                out.stderr[name] = one.stderr
    out.provenance = {
        "rmse_before_c": told.baseline.rmse_c,
        "rmse_after_c": told.after.rmse_c,
        "logs": [results.plain(one) for one in told.logs],
    }
    return out
