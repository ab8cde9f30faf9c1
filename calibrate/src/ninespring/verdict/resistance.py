"""Resistance as a second witness: what v / i of every spring says of phases, temperature and contacts.

The fitted thermal model says how hot each spring is and what part of it is austenite; resistance is then linear in its own
numbers, each phase's resistance, its rise with temperature and a contact in series, and each is weighed by what it explains.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from .. import effects
from ..fit import statistics
from ..fit.problem import Problem
from ..fit.simulate import simulate_run
from ..fit.spec import Fit
from ..models import Model
from ..search.certainty import CERTAIN

DRIVEN_A = 0.2
"""Currents from which v / i is a measurement of resistance, not of the sensor's offset."""
REFERENCE_C = 20.0
"""Temperature of the declared resistances."""
SEEN = 30
"""Readings in each phase from which two resistances are told apart, and before and after a contact changed."""
BELIEVED_RISE = 0.001
"""Per K: what NiTi's resistance rises by, about, in either phase."""
SETTLED = 0.02
NEAR_S = 15.0
"""A reading counts where austenite moves by less than SETTLED within NEAR_S before and after."""
SMOOTHED = 5
"""Readings of a thermometer that are taken together for a spring's temperature."""
STEP_GRID = 24
"""Times of a run at which a contact may have changed."""
LEAST_NATS = 3.0
"""Evidence, after the price of numbers and of choosing, from which v / i names an effect: one in twenty."""
SMALLEST_RISE = 3e-4
"""Per K: a third of NiTi's usual rise; below it the steps of a board's voltage readings (4 mV of some 0.2 V) explain as much."""
SMALLEST_PHASE = 0.02
"""Difference between the phases, as a part of the resistance, that is told."""
SMALLEST_OHM = 0.002
"""A contact below this is no finding: wire and solder of any spring."""


@dataclass
class Readings:
    """v / i of all runs in rows: what was read, of which spring, at which phase and temperature."""

    ohm: np.ndarray
    spring: np.ndarray
    run: np.ndarray
    time_s: np.ndarray
    phase: np.ndarray
    over_k: np.ndarray
    noise: np.ndarray
    """Of each row, ohm."""


def readings(problem: Problem, fit: Fit) -> Readings | None:
    """Return the readings of runs whose currents and voltages are known; None where there are none."""
    parts = []
    for r, run in enumerate(problem.runs):
        if run.current_a is None or run.voltage_v is None:
            continue
        traced = _as_measured(problem, fit, r)
        driven = run.current_a > DRIVEN_A
        width = 1 + 2 * max(1, round(NEAR_S / float(np.median(np.diff(run.time_s)))))
        ohm = np.where(driven, run.voltage_v / np.where(driven, run.current_a, 1.0), np.nan)
        noise = statistics.noise_floor(ohm, run.starts)
        for k in range(run.springs):
            # on the way between the phases the model's part of austenite is no better than its temperature
            moving = maximum_filter1d(traced[:, k, 1], width) - minimum_filter1d(traced[:, k, 1], width) > SETTLED
            between = (traced[:, k, 1] > SETTLED) & (traced[:, k, 1] < 1.0 - SETTLED)
            here = np.flatnonzero(driven[:, k] & ~moving & ~between)
            if len(here) >= 20 and np.isfinite(noise[k]):
                n = len(here)
                columns = (ohm[here, k], np.full(n, k), np.full(n, r), run.time_s[here])
                # what a volt's and an ampere's last digit leave is noise as well
                sigma = np.full(n, max(noise[k], 1e-4 * float(np.median(ohm[here, k]))))
                parts.append((*columns, traced[here, k, 1], traced[here, k, 0] - REFERENCE_C, sigma))
    if not parts:
        return None
    return Readings(*(np.concatenate([part[j] for part in parts]) for j in range(7)))


def _as_measured(problem: Problem, fit: Fit, r: int) -> np.ndarray:
    """Return temperatures and austenite of a run, (rows, springs, 2), springs as hot as the thermometers say.

    What heat the model has wrong, as that of a contact which is measured with its spring, is in neither.
    """
    run = problem.runs[r]
    ambient = problem.ambient_of(r, fit.as_dict())
    traced = simulate_run(problem.plant_for(fit.spec, fit.values), run, ambient, {}, trace=True)
    left = pd.DataFrame(fit.residual[r]).rolling(SMOOTHED, center=True, min_periods=1).mean().fillna(0.0).to_numpy()
    hot = np.clip(traced[:, :, 0] + left, -60.0, 500.0)
    given = replace(run, mode="temperature", drive=hot, warm=False, starts=[0])
    return simulate_run(problem.plant_for(fit.spec, fit.values), given, ambient, {}, trace=True)


@dataclass
class _Linear:
    """A weighted linear fit."""

    names: list[str]
    values: np.ndarray
    covariance: np.ndarray
    chi2: float
    rest: np.ndarray


def _solve(read: Readings, columns: dict[str, np.ndarray]) -> _Linear:
    """Fit; rises with temperature are believed to be within BELIEVED_RISE beforehand."""
    matrix = np.column_stack(list(columns.values())) / read.noise[:, None]
    wanted = read.ohm / read.noise
    usual = BELIEVED_RISE * float(np.median(read.ohm))
    trust = np.array([1.0 / usual**2 if key.startswith("rise") else 0.0 for key in columns])
    scale = np.maximum(np.linalg.norm(matrix, axis=0), 1e-12)
    normal = (matrix / scale).T @ (matrix / scale) + np.diag(trust / scale**2)
    inverse = np.linalg.pinv(normal, rcond=1e-10)
    values = inverse @ ((matrix / scale).T @ wanted) / scale
    rest = wanted - matrix @ values
    chi2 = float(rest @ rest)
    spread = max(1.0, chi2 / max(1, len(rest) - len(values)))
    return _Linear(list(columns), values, inverse * spread / np.outer(scale, scale), chi2, rest)


def _nats(read: Readings, less: _Linear, more: _Linear) -> float:
    """Return by how much the larger model is likelier: half the difference of BIC, correlated rows counted for less."""
    rest = more.rest
    rho = float(rest[1:] @ rest[:-1] / max(1e-12, rest @ rest))
    n = len(rest) * max(0.02, (1.0 - max(0.0, rho)) / (1.0 + max(0.0, rho)))
    gained = 0.5 * n * math.log(max(less.chi2, 1e-9) / max(more.chi2, 1e-9))
    return gained - 0.5 * (len(more.values) - len(less.values)) * math.log(max(2.0, n))


def entry(found: dict[str, Any], fit: Fit, problem: Problem) -> dict[str, Any]:
    """Return an effect that v / i names as diagnosis.json lists it: the temperatures' errors stay as they are."""
    name, variant = found["name"], found.get("variant", "")
    return found | {
        "rmse_c": statistics.rms(fit.residual),
        "holdout_rmse_c": problem.holdout_rmse(fit),
        "on_chip": name in effects.ON_CHIP,
        "in_words": effects.IN_WORDS[name],
        "text": effects.sentence(name, found["parameters"], variant),
        "seen_by": "v / i",
    }


def into_model(model: Model, second: dict[str, Any] | None) -> None:
    """Put what v / i determined into a model, where both phases were seen: one without the other would be wrong.

    A contact that changed during a log is that day's: it is told, and left out.
    """
    named = {one["name"]: one["parameters"] for one in (second or {}).get("effects", [])}
    if "resistance_phase" not in named:
        return
    for effect in ("resistance_phase", "resistance_temperature"):
        for name, number in named.get(effect, {}).items():
            model.parameters[name], model.stderr[name] = number["value"], number["stderr"]
        if effect in named and effect not in model.effects:
            model.effects.append(effect)


def witness(problem: Problem, fit: Fit) -> dict[str, Any] | None:
    """Return what v / i says: its error before and after, the effects it names, their numbers; None without v and i."""
    read = readings(problem, fit)
    if read is None:
        return None
    austenite = int((read.phase > 0.5).sum())
    two_phases = SEEN <= austenite <= len(read.ohm) - SEEN
    # every spring has a resistance of its own: wires differ; what is shared is how it changes
    own = {f"own {k}": (read.spring == k).astype(float) for k in sorted({int(one) for one in read.spring})}
    columns = own
    model = first = _solve(read, columns)
    found: list[dict[str, Any]] = []

    def named(name: str, nats: float, chosen_from: int, parameters: dict[str, Any], variant: str = "") -> None:
        """Write down an effect; certain or probable by the evidence that is left after the price of choosing."""
        net = nats - math.log(max(1, chosen_from))
        probability = 1.0 / (1.0 + math.exp(-min(net, 50.0)))
        certainty = "certain" if probability >= CERTAIN else "probable"
        one = {"name": name, "evidence": nats, "parameters": parameters, "probability": probability}
        found.append(one | {"certainty": certainty} | ({"variant": variant} if variant else {}))

    def combined(parts: dict[str, float]) -> dict[str, Any]:
        """Return a sum of fitted numbers as one, with its error."""
        weights = np.array([parts.get(key, 0.0) for key in model.names])
        error = float(np.sqrt(max(0.0, weights @ model.covariance @ weights)))
        return {"value": float(weights @ model.values), "stderr": error, "unit": "ohm"}

    mean = {key: 1.0 / len(own) for key in own}
    alike = _solve(read, own | ({"phase": read.phase} if two_phases else {})).values[: len(own)]
    # a longer wire has more of everything: what is shared counts in proportion to a spring's own resistance
    share = (alike / alike.mean())[np.searchsorted(sorted({int(one) for one in read.spring}), read.spring)]
    if two_phases:
        trial = _solve(read, columns | {"phase": read.phase * share})
        nats = _nats(read, model, trial)
        if nats > LEAST_NATS:
            columns, model = columns | {"phase": read.phase * share}, trial
    resistances = {"resistance_martensite_ohm": mean}
    if "phase" in columns:
        resistances["resistance_austenite_ohm"] = mean | {"phase": 1.0}
    phase_nats = _nats(read, first, model)
    over_k = read.over_k * share
    rising = {"rise martensite": over_k * (1.0 - read.phase), "rise austenite": over_k * read.phase}
    if not two_phases:
        rising = {"rise martensite": over_k}
    trial = _solve(read, columns | rising)
    rise_nats = _nats(read, model, trial)
    if rise_nats > LEAST_NATS:
        columns, model = columns | rising, trial
    if "phase" in columns and "rise martensite" in columns:
        # each beside the other: what one explains alone the other may explain as well
        phase_nats = _nats(read, _solve(read, {k: v for k, v in columns.items() if k != "phase"}), model)
        if phase_nats <= LEAST_NATS:
            columns = {k: v for k, v in columns.items() if k != "phase"}
            model = _solve(read, columns)
            rise_nats = _nats(read, first, model)
    change = model.values[model.names.index("phase")] if "phase" in columns else 0.0
    if "phase" in columns and abs(change) > SMALLEST_PHASE * float(np.median(read.ohm)):
        named("resistance_phase", phase_nats, 1, {key: combined(parts) for key, parts in resistances.items()})
    if "rise martensite" in columns:
        rises = {}
        for key in rising:
            name = f"resistance_{key.removeprefix('rise ')}_rise_per_k"
            base, slope = (
                combined(resistances.get(f"resistance_{key.removeprefix('rise ')}_ohm", mean)),
                combined({key: 1.0}),
            )
            shares = {"value": slope["value"] / base["value"], "stderr": slope["stderr"] / base["value"], "unit": "1/K"}
            rises[name] = shares
        if max(abs(one["value"]) for one in rises.values()) > SMALLEST_RISE:
            named("resistance_temperature", rise_nats, 1, rises)
    model, changed = _contacts(read, columns, model)
    for k, when, nats, size, error, tried in changed:
        text = f"spring {k + 1}, from {when[1]:.0f} s of run {when[0] + 1}"
        parameters = {f"contact_ohm[{k + 1}]": {"value": size, "stderr": error, "unit": "ohm"}}
        named("contact_resistance", nats, tried, parameters, text)
    typical = float(np.sqrt(np.mean(read.noise**2)))
    count = len(read.ohm)
    return {
        "rows": count,
        "noise_ohm": typical,
        "before_ohm": float(np.sqrt(np.mean((first.rest * read.noise) ** 2))),
        "after_ohm": float(np.sqrt(np.mean((model.rest * read.noise) ** 2))),
        "effects": found,
        "parameters": {key: combined(parts) for key, parts in resistances.items()},
    }


def _contacts(
    read: Readings, columns: dict[str, np.ndarray], model: _Linear
) -> tuple[_Linear, list[tuple[int, tuple[int, float], float, float, float, int]]]:
    """Add contacts that get worse (or better) at some time, while they earn their price.

    What a contact always had is in its spring's own resistance: v / i alone cannot tell wire from clamp.
    """

    def later(k: int, r: int, at: float) -> np.ndarray:
        """Return where a spring's contact is as it is since a time of a run."""
        since = (read.run > r) | ((read.run == r) & (read.time_s >= at))
        return ((read.spring == k) & since).astype(float)

    options: dict[tuple[int, int, float], np.ndarray] = {}
    grid: dict[int, float] = {}
    springs = sorted({int(k) for k in read.spring})
    for k in springs:
        for r in sorted({int(one) for one in read.run[read.spring == k]}):
            times = read.time_s[(read.spring == k) & (read.run == r)]
            grid[r] = max(grid.get(r, 0.0), float(times[-1] - times[0]) / (STEP_GRID + 1))
            for at in np.linspace(times[0], times[-1], STEP_GRID + 2)[1:-1]:
                options[k, r, float(at)] = later(k, r, float(at))

    own = np.bincount(read.spring.astype(int))

    def gain(k: int, column: np.ndarray, q: np.ndarray) -> float:
        # a few readings, as those of the moment in which a spring is switched on, are no contact that stays
        if min(column.sum(), own[k] - column.sum()) < SEEN:
            return 0.0
        vector = column / read.noise
        vector = vector - q @ (q.T @ vector)
        power = float(vector @ vector)
        return float(vector @ model.rest) ** 2 / power if power > 1e-9 else 0.0

    tried, out = max(1, len(options)), []
    while options and len(out) < len(springs):
        q = np.linalg.qr(np.column_stack(list(columns.values())) / read.noise[:, None])[0]
        k, r, near = max(options, key=lambda one: gain(one[0], options[one], q))
        finer = np.linspace(near - grid[r], near + grid[r], 2 * STEP_GRID + 1)
        at = float(max(finer, key=lambda one: gain(k, later(k, r, float(one)), q)))
        name = f"contact {k} {r} {at}"
        trial = _solve(read, columns | {name: later(k, r, at)})
        nats = _nats(read, model, trial)
        size, error = float(trial.values[-1]), math.sqrt(float(trial.covariance[-1, -1]))
        if nats < math.log(tried) + LEAST_NATS or abs(size) < max(SMALLEST_OHM, 3.0 * error):
            break
        columns, model = columns | {name: later(k, r, at)}, trial
        out.append((k, (r, at), nats, size, error, tried))
        # a change that takes a while is one change
        options = {key: one for key, one in options.items() if key[:2] != (k, r) or abs(key[2] - at) > 2.5 * grid[r]}
    return model, out
