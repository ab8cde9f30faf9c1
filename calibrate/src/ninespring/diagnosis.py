"""The diagnosis: fit what is declared, look at what is left, find what is missing, say what cannot be told apart."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib import resources
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
from threadpoolctl import threadpool_limits

from . import __version__, effects, experiments, native, plausibility, search, statistics
from .fitting import FOLDS, Fit, Problem, Spec, fold_of_rows
from .logs import Run
from .models import Array, Model

SCHEMA = "ninespring.diagnosis/1"
DRIFT_LEFT_OUT = (
    "the ambient drifted during the runs that this was fitted to. The drift belongs to those runs: it is in "
    "diagnosis.json, not in this model, and no prediction has it"
)
"""Why a model.toml is without a drift of several knots: no other log has it, and a log's own is no prediction."""


@dataclass
class Diagnosis:
    """Everything a diagnosis found: the result for programs and what the report draws."""

    result: dict[str, Any]
    model: Model
    problem: Problem
    baseline: Fit
    final: Fit
    contenders: list[dict[str, Any]] = field(default_factory=list)


def declared_from_model(model: Model) -> tuple[Array, dict[str, float]]:
    """Return a model's array and parameters as declared values."""
    return model.array, dict(model.parameters)


def prepare(array: Array, runs: Sequence[Run], declared: Mapping[str, float] | None = None) -> Problem:
    """Return the problem of these runs, condensed where they are long."""
    from .logs import condense

    share = max(600, 6000 // max(1, len(runs)))
    return Problem(array, [condense(run, share) for run in runs], declared)


def first_fit(problem: Problem, spec: Spec) -> Fit:
    """Fit the declared model: once, then starts projected out and spikes left out, then again."""
    fit = problem.fit(spec, tolerance=1e-3)
    if problem.mask_spikes(fit.residual):
        fit = problem.fit(spec, fit.as_dict(), tolerance=1e-3)
    problem.learn_starts(fit.spec, fit.values)
    noise = [statistics.noise_floor(left, run.starts) for left, run in zip(fit.residual, problem.runs, strict=True)]
    problem.noise = [np.fmin(a, b) for a, b in zip(problem.noise, noise, strict=True)]
    problem._tidy_noise()
    return problem.fit(spec, fit.as_dict(), tolerance=1e-5, errors=True)


def holdout_rmse(problem: Problem, fit: Fit) -> float:
    """Return the rms error, degC, on blocks held out of the fit, one fold after the other."""
    return problem.holdout_rmse(fit)


def parameters_of(problem: Problem, fit: Fit, effect: str | None = None) -> dict[str, Any]:
    """Return numbers with standard errors and units; of one effect, or those of the declared model."""
    errors = fit.stderr()
    bounds = set(fit.at_bounds())
    out: dict[str, Any] = {}
    for free, value in zip(fit.spec.free, fit.values, strict=True):
        if free.effect != effect:
            continue
        error = errors[free.key]
        entry: dict[str, Any] = {
            "value": float(value),
            "stderr": float(error) if math.isfinite(error) else None,
            "unit": free.unit,
        }
        if free.key in fit.stuck:
            entry["note"] = "the data cannot fix it: held"
        elif free.key in bounds:
            entry["note"] = "at its bound"
        out[free.key] = entry
    return out


def _finish(problem: Problem, fit: Fit) -> Fit:
    if fit.covariance is None:
        again = problem.fit(fit.spec, fit.as_dict(), tolerance=1e-6, errors=True)
        return again if again.chi2 <= fit.chi2 * (1 + 1e-6) else fit
    return fit


def in_order(found: search.Search, base: Fit, final: Fit, adopted: Sequence[str]) -> list[tuple[str, Fit]]:
    """Return adopted effects, the one that explains most first, each with the fit of all up to it."""
    out: list[tuple[str, Fit]] = []
    rest = list(adopted)
    while rest:
        options = []
        for effect in rest:
            spec = final.spec
            for other in rest:
                if other != effect:
                    spec = spec.without(other)
            key = found.key(spec)
            if len(rest) == 1:
                fit = final
            elif key in found.fits:
                fit = found.fits[key]
            else:
                fit = found.fits[key] = found.problem.fit(spec, final.as_dict(), tolerance=1e-3, max_steps=14)
            options.append((fit.sse, effect, fit))
        _, effect, fit = min(options, key=lambda one: one[0])
        rest.remove(effect)
        out.append((effect, fit))
    return out


def variant_of(fit: Fit, effect: str) -> str:
    """Return which variant of an effect a fit has."""
    return dict(fit.spec.variant).get(effect, "")


def diagnose(
    array: Array,
    runs: Sequence[Run],
    *,
    model: Model | None = None,
    frozen: bool = False,
    progress: Callable[[str], None] = lambda text: None,
) -> Diagnosis:
    """Diagnose logs. `model` gives declared values and effects already on; `frozen` keeps them as they are."""
    # Simulations run in threads of their own: a linear algebra that starts more only gets in their way.
    with threadpool_limits(1):
        return _diagnose(array, runs, model, frozen, progress)


def with_effects_of(spec: Spec, model: Model, known: Sequence[effects.Candidate], frozen: bool) -> Spec:
    """Return the spec with a model's effects on, each in the variant that the model's parameters speak of.

    Its numbers start at the model's values; where frozen they stay there.
    """
    given = model.parameters

    def matches(one: effects.Candidate) -> int:
        numbers = sum(name in given for free in one.free for name in free.names)
        return numbers + sum(1 if given.get(name) == value else -1 for name, value in one.fixed if name in given)

    for effect in model.effects:
        if effect in spec.plant_effects:
            continue
        options = [c for c in known if c.effect == effect]
        if frozen or not options:
            spec = spec.with_effect(effect, (), (), max(options, key=matches).variant if options else "")
            continue
        one = max(options, key=matches)
        free = [replace(f, start=next((given[n] for n in f.names if n in given), f.start)) for f in one.free]
        spec = spec.with_effect(effect, free, one.fixed, one.variant, one.also_on)
    return spec


def _diagnose(
    array: Array, runs: Sequence[Run], model: Model | None, frozen: bool, progress: Callable[[str], None]
) -> Diagnosis:
    begun = time.monotonic()
    declared = dict(model.parameters) if model else {}
    problem = prepare(model.array if model else array, runs, declared)
    progress("fitting what is declared")
    spec = effects.base_spec(problem, frozen)
    known = effects.candidates(problem)
    if model:
        spec = with_effects_of(spec, model, known, frozen)
    base = first_fit(problem, spec)
    found = search.Search(problem, [c for c in known if c.effect not in spec.effects], base, progress)
    final, without, contenders = found.run()
    progress("held-out blocks")
    final = _finish(problem, final)
    left_over = search.unexplained(problem, final)
    if left_over and without:
        # Structure remains: keep only what explains most of what was there.
        kept, without, rest = found.settle(final, search.MIN_SHARE_UNEXPLAINED, grow=False)
        explained = (base.sse - kept.sse) / base.count
        if explained < search.MIN_TOTAL_UNEXPLAINED * search.excess(problem, base):
            kept, without, rest = base, {}, []
        if kept is not final:
            final, contenders = _finish(problem, kept), rest
        left_over = search.unexplained(problem, final)
    adopted = [e for e in final.spec.effects if e not in base.spec.effects]
    strength = {e: search.log_evidence(problem, final, without[e]) for e in adopted}
    base_out, final_out = holdout_rmse(problem, base), holdout_rmse(problem, final)

    listed = []
    steps = in_order(found, base, final, adopted)
    adopted = [effect for effect, _ in steps]
    for effect, growing in steps:
        entry = {
            "name": effect,
            "rmse_c": statistics.rms(growing.residual),
            "holdout_rmse_c": holdout_rmse(problem, growing),
            "evidence": strength[effect],
            "parameters": parameters_of(problem, final, effect),
            "on_chip": effect in effects.ON_CHIP,
            "in_words": effects.IN_WORDS[effect],
        }
        if variant := variant_of(final, effect):
            entry["variant"] = variant
        if effect in effects.WHY_NOT_ON_CHIP:
            entry["why_not_on_chip"] = effects.WHY_NOT_ON_CHIP[effect]
        listed.append(entry)

    rivals, seen = [], set()
    for instead, other in sorted(contenders, key=lambda one: one[1].chi2):
        extra = [e for e in other.spec.effects if e not in final.spec.effects]
        if instead not in adopted or not extra or (instead, extra[0]) in seen:
            continue
        apart = search.difference(problem, final, other)
        ahead = search.log_evidence(problem, final, other)
        if ahead >= search.TOLD_APART and apart >= search.EQUIVALENT:
            continue
        seen.add((instead, extra[0]))
        progress(f"how to tell {extra[0]} from {instead}")
        trial = experiments.separate(problem, final, other)
        other = _finish(problem, other)
        rivals.append(
            {
                "instead_of": instead,
                "name": extra[0],
                "variant": variant_of(other, extra[0]),
                "rmse_c": statistics.rms(other.residual),
                "holdout_rmse_c": holdout_rmse(problem, other),
                "evidence": ahead,
                "predictions_differ_c": apart * problem.noise_c,
                "parameters": parameters_of(problem, other, extra[0]),
                "separating_experiment": trial.text,
                "experiment": trial.as_dict(),
            }
        )

    candidates = []
    for key, fit in found.fits.items():
        candidates.append(
            {
                "effects": [f"{e} ({v})" if v else e for e, v in key],
                "rmse_c": statistics.rms(fit.residual),
                "evidence_over_baseline": search.log_evidence(problem, fit, base),
                "adopted": fit.spec.variant == final.spec.variant,
            }
        )
    candidates.sort(key=lambda one: -one["evidence_over_baseline"])
    rho = statistics.autocorrelation([r / n for r, n in zip(final.residual, problem.noise, strict=True)], 1)
    depends, note = depends_on(problem, final)
    warnings = [f"{Path(run.name).name}: {text}" for run in problem.runs for text in run.notes]
    if any(free.knot is not None for free in final.spec.free):
        warnings.append(f"model.toml: {DRIFT_LEFT_OUT}; log ambient_c to have it predicted")
    warnings += plausibility.swapped(problem.runs)
    warnings += [text for run in problem.runs for text in plausibility.undriven_but_hottest(run)]
    if left_over:
        warnings += plausibility.shifted_clock(problem, (base,) if final is base else (base, final))
    if left_over:
        note = ("structure well above the noise remains that no effect of the library explains. " + note).strip()
    else:
        note = note or "white at the noise floor"
    result: dict[str, Any] = {
        "schema": SCHEMA,
        "tool": f"ninespring {__version__}",
        "logs": [{"file": Path(r.name).name, "sha256": r.sha256, "rows": len(r.time_s)} for r in runs],
        "baseline": {
            "rmse_c": statistics.rms(base.residual),
            "holdout_rmse_c": base_out,
            "noise_c": problem.noise_c,
            "parameters": parameters_of(problem, base),
            "effects": list(base.spec.effects),
        },
        "effects": listed,
        "rivals": rivals,
        "after": {
            "rmse_c": statistics.rms(final.residual),
            "holdout_rmse_c": final_out,
            "parameters": parameters_of(problem, final),
        },
        "unexplained": bool(left_over),
        "residual": {
            "autocorrelation_lag1": float(np.clip(rho[1], -1.0, 1.0)),
            "structure_c": math.sqrt(search.excess(problem, final)) * problem.noise_c,
            "rmse_per_spring_c": [_finite(v) for v in _per_spring(final.residual)],
            "noise_per_spring_c": [
                _finite(v) for v in np.sqrt(np.nanmean(np.square(np.asarray(problem.noise)), axis=0))
            ],
            "depends_on": depends,
            "note": note,
        },
        "candidates": candidates[:40],
        "identifiability": {
            "not_identifiable": sorted(set(final.stuck)),
            "at_bounds": final.at_bounds(),
            "correlated": [{"a": a, "b": b, "correlation": r} for a, b, r in final.correlations()],
        },
        "warnings": warnings,
        "seconds": round(time.monotonic() - begun, 2),
        "simulations": problem.simulations,
    }
    made = model_of(problem, final, runs, result)
    validate(result)
    return Diagnosis(result, made, problem, base, final, contenders=[])


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _per_spring(residual: Sequence[np.ndarray]) -> np.ndarray:
    total = sum(np.nansum(r**2, axis=0) for r in residual)
    count = sum(np.isfinite(r).sum(axis=0) for r in residual)
    return np.sqrt(np.where(count > 0, total / np.maximum(count, 1), np.nan))


def model_of(problem: Problem, fit: Fit, runs: Sequence[Run], result: Mapping[str, Any] | None = None) -> Model:
    """Return the model.toml of a fit: declared, fixed and fitted numbers, effects, provenance."""
    table = native.parameter_table()
    model = Model(problem.array)
    model.effects = [e for e in fit.spec.plant_effects if e in native.effect_names()]
    model.parameters = dict(problem.declared) | {k: v for k, v in fit.spec.fixed}
    errors = fit.stderr()
    for free, value in zip(fit.spec.free, fit.values, strict=True):
        for name in free.names:
            if name.partition("[")[0] in table:
                model.parameters[name] = float(value)
                if math.isfinite(errors[free.key]):
                    model.stderr[name] = errors[free.key]
    constants = [fit.value(f.key) for f in fit.spec.free if f.key.startswith("ambient_c@")]
    if constants:
        model.parameters["ambient_c"] = float(np.mean(constants))
    drifts = [k for k, f in enumerate(fit.spec.free) if f.knot is not None]
    if drifts:
        # A drift of these very runs has no place in a model of the array.
        model.effects.remove("ambient_drift")
        for name in ("ambient_amplitude_k", "ambient_ramp_k_per_h"):
            model.parameters.pop(name, None)
    on = set(model.effects)
    model.parameters = {
        k: v
        for k, v in model.parameters.items()
        if table[k.partition("[")[0]].effect is None or table[k.partition("[")[0]].effect in on
    }
    model.stderr = {k: v for k, v in model.stderr.items() if k in model.parameters}
    model.provenance = {
        "logs": [{"file": Path(run.name).name, "sha256": run.sha256} for run in runs],
        "rmse_after_c": statistics.rms(fit.residual),
    }
    if result:
        model.provenance["rmse_before_c"] = result["baseline"]["rmse_c"]
    if drifts:
        model.provenance["note"] = DRIFT_LEFT_OUT
    return model


def schema() -> dict[str, Any]:
    """Return the JSON schema of diagnosis.json."""
    return json.loads((resources.files("ninespring") / "diagnosis.schema.json").read_text("utf-8"))


def validate(result: Mapping[str, Any]) -> None:
    """Check a result against the schema."""
    jsonschema.validate(result, schema())


WHITE = 0.2
"""Structure, rms in units of the noise, below which a residual is called white."""


def depends_on(problem: Problem, fit: Fit) -> tuple[list[str], str]:
    """Return what the residual depends on, strongest first, and a sentence; nothing where it is white."""
    structure = search.excess(problem, fit)
    width = 10
    blocks, owners, times, runs_of = [], [], [], []
    residual = problem.without_starts(fit.residual)
    for r, (run, left, noise) in enumerate(zip(problem.runs, residual, problem.noise, strict=True)):
        mean, _, begins = statistics.block_means(left / noise, width, run.starts)
        blocks.append(mean)
        times.append(run.time_s[begins])
        owners.append(begins)
        runs_of.append(r)
    if structure < WHITE**2:
        return [], ""
    out: list[tuple[float, str]] = []
    per_spring = np.nanmean([np.nanmean(b**2, axis=0) - 1.0 / width for b in blocks], axis=0)
    share = np.maximum(per_spring, 0) / max(1e-12, float(np.nansum(np.maximum(per_spring, 0))))
    spread = 1.0 / len(share)
    for k in np.argsort(-share)[:2]:
        if share[k] > max(2.0 * spread, 0.3) and len(share) > 1:
            out.append((float(share[k]), f"spring {k + 1} ({100 * share[k]:.0f} % of the structure)"))
    series: dict[str, list[np.ndarray]] = {}
    for r, run in enumerate(problem.runs):
        drive = np.add.reduceat(run.drive, owners[r], axis=0) / width
        fan = np.add.reduceat(run.fan, owners[r]) / width
        for j in range(run.springs):
            series.setdefault(f"drive of spring {j + 1}", []).append(drive[:, j])
        series.setdefault("total drive", []).append(drive.sum(axis=1))
        series.setdefault("fan", []).append(fan)
        series.setdefault("time", []).append(times[r] - times[r].mean())
    largest = max(1e-12, float(np.nanmax(np.nanmean([np.nanmean(b**2, axis=0) for b in blocks], axis=0))))
    for name, parts in series.items():
        best = (0.0, 0.0, 0, -1)
        if all(np.ptp(p) < 1e-12 for p in parts):
            continue
        for lag in (0, 1, 2, 3, 6, 12) if name != "time" else (0,):
            for k in range(problem.runs[0].springs):
                x, y = [], []
                for p, b in zip(parts, blocks, strict=True):
                    x.append(p[: len(p) - lag] - p.mean())
                    y.append(b[lag:, k])
                xs, ys = np.concatenate(x), np.concatenate(y)
                good = np.isfinite(ys)
                if good.sum() < 10 or np.std(xs[good]) < 1e-12 or np.std(ys[good]) < 1e-12:
                    continue
                rho = float(np.corrcoef(xs[good], ys[good])[0, 1])
                # a spring that shows little counts for little, however well it correlates
                weight = abs(rho) * min(1.0, math.sqrt(float(np.nanmean(ys**2)) / largest))
                if weight > best[0]:
                    best = (weight, rho, lag, k)
        if best[0] > 0.3:
            step = float(np.median(np.diff(problem.runs[0].time_s))) * width
            lag_text = f", {best[2] * step:.0f} s later" if best[2] else ""
            out.append((best[0], f"{name} (seen at spring {best[3] + 1}{lag_text}, r = {best[1]:+.2f})"))
    together = [np.nanmean(b, axis=1) for b in blocks]
    common = np.mean([np.nanmean(t**2) for t in together]) / max(1e-12, np.mean([np.nanmean(b**2) for b in blocks]))
    if common > 0.4 and problem.runs[0].springs > 2:
        out.append((float(common), f"all springs move together ({100 * common:.0f} % of it is common)"))
    worst = max(
        (
            (float(np.nanmean(b[i] ** 2)), r, float(times[r][i]))
            for r, b in enumerate(blocks)
            for i in range(len(b))
            if np.isfinite(b[i]).any()
        ),
        default=(0.0, 0, 0.0),
    )
    for r, (run, left, noise) in enumerate(zip(problem.runs, residual, problem.noise, strict=True)):
        first = run.time_s <= run.time_s[0] + 0.1 * run.duration_s
        size = np.nan_to_num(left / noise) ** 2
        begins_badly = float(size[first].sum()) / max(1e-12, float(size.sum()))
        if begins_badly > 0.25:
            out.append(
                (
                    begins_badly,
                    f"the start of run {r + 1} ({100 * begins_badly:.0f} % of what is left is in its first "
                    f"{0.1 * run.duration_s:.0f} s: its state or its first inputs are not as logged)",
                )
            )
    typical = np.mean([np.nanmean(b**2) for b in blocks])
    if worst[0] > 8 * typical:
        out.append((0.3, f"time: most at {worst[2]:.0f} s of run {worst[1] + 1}"))
    out.sort(key=lambda one: -one[0])
    names = [text for _, text in out[:6]]
    return names, ("It depends on " + "; ".join(names) + "." if names else "No single input goes with it.")


def fit_effects(
    array: Array, runs: Sequence[Run], wanted: Sequence[str], progress: Callable[[str], None] = lambda text: None
) -> tuple[Problem, Fit, Fit]:
    """Fit the declared model with the effects named; return the problem, the fit and the declared model's fit."""
    with threadpool_limits(1):
        problem = prepare(array, runs)
        known = effects.candidates(problem)
        base = first_fit(problem, effects.base_spec(problem))
        found = search.Search(problem, known, base, progress)
        fit = base
        for effect in wanted:
            screen = found.screen(fit)
            options = [k for k, c in enumerate(screen.candidates) if c.effect == effect]
            if not options:
                from .errors import InputError

                raise InputError(f"{effect} cannot show in these logs: nothing in them depends on it")
            best = max(options, key=lambda k: screen.forecast([k])[0])
            progress(f"fitting {effect}")
            fit = found.refit(fit, [screen.candidates[best]], [screen.forecast([best])[1].get(best, 1.0)])
        return problem, _finish(problem, fit), base


def plant_of(model: Model) -> native.Plant:
    """Return the plant that a model.toml describes."""
    from .fitting import array_parameters

    plant = native.Plant(model.array.rows, model.array.cols)
    plant.set_all(array_parameters(model.array))
    plant.set_effects(model.effects)
    plant.set_all(model.parameters)
    return plant


def predict(model: Model, run: Run, chip: bool = False) -> np.ndarray:
    """Return what the sensors should show, (rows, springs), degC; `chip`: by the on-chip model, seen by the same sensors."""
    from .fitting import simulate_run

    plant = plant_of(model)
    shown = simulate_run(plant, run, run.ambient_c, {})
    if not chip:
        return shown
    # What lag, gain and mixing of the sensors add is the plant's: the chip has none of them.
    plant = plant_of(model)
    plant.set_effects([e for e in model.effects if e not in effects.MEASUREMENT])
    seen_by = shown - simulate_run(plant, run, run.ambient_c, {})
    ambient = run.ambient_c if run.ambient_c is not None else np.full(len(run.time_s), plant.get("ambient_c"))
    power = run.drive
    if run.mode == "current":
        power = run.drive**2 * plant.get("resistance_ohm")
    elif run.mode == "command":
        power = run.drive * np.array([plant.get(f"command_power_w[{k + 1}]") for k in range(run.springs)])
    out = np.empty_like(run.temperature_c)
    for begin, end in zip(run.starts, [*run.starts[1:], len(run.time_s)], strict=True):
        part = slice(begin, end)
        before = out[begin - 1] if begin else np.full(run.springs, ambient[0])
        first = np.where(np.isfinite(run.temperature_c[begin]), run.temperature_c[begin], before)
        if end - begin == 1:
            out[part] = first
            continue
        out[part] = native.chip_simulate(plant, run.time_s[part], power[part], run.fan[part], ambient[part], first)
    return out + seen_by


def chip_settings(model: Model) -> tuple[str, str]:
    """Return console lines `$name=value` of a model, and what was left out and why."""
    return native.chip_export(plant_of(model))


def surrogate(problem: Problem, fit: Fit) -> dict[str, Any]:
    """Return how far an empirical model of the residual would get. Not physics; it is never exported.

    Ridge regression of each spring's residual on every drive, filtered with time constants of 3 to 300 s, on
    the fan and on time; the strength of the ridge and the error by held-out fifths of the runs.
    """
    from scipy.signal import lfilter

    tables = []
    for run in problem.runs:
        step = float(np.median(np.diff(run.time_s)))
        columns = [np.ones(len(run.time_s)), run.fan, run.time_s / 1000.0]
        for tau in (3.0, 10.0, 30.0, 100.0, 300.0):
            keep = math.exp(-step / tau)
            for k in range(run.springs):
                columns.append(lfilter([1 - keep], [1, -keep], run.drive[:, k]))
        tables.append(np.column_stack(columns))
    x = np.concatenate(tables)
    x = (x - x.mean(axis=0)) / np.where(x.std(axis=0) > 0, x.std(axis=0), 1.0)
    x[:, 0] = 1.0
    y = np.concatenate(fit.residual)
    folds = np.concatenate([fold_of_rows(run) for run in problem.runs])
    best: tuple[float, float] | None = None
    for strength in (0.1, 1.0, 10.0, 100.0, 1e3, 1e4):
        total, count = 0.0, 0
        for fold in range(FOLDS):
            for k in range(y.shape[1]):
                good = np.isfinite(y[:, k])
                train, test = good & (folds != fold), good & (folds == fold)
                if not train.any() or not test.any():
                    continue
                a = x[train]
                weights = np.linalg.solve(a.T @ a + strength * np.eye(a.shape[1]), a.T @ y[train, k])
                total += float(((y[test, k] - x[test] @ weights) ** 2).sum())
                count += int(test.sum())
        error = math.sqrt(total / max(1, count))
        if best is None or error < best[0]:
            best = (error, strength)
    assert best is not None
    return {
        "empirical": True,
        "what": "ridge regression of the residual on filtered drives, fan and time: no physics, not exported",
        "holdout_before_c": statistics.rms(fit.residual),
        "holdout_after_c": best[0],
        "ridge": best[1],
    }
