"""What a log does not determine although it was fitted, and what makes the log itself doubtful: `export` leaves both out."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..export.settings import KNOWN
from ..infer.fit import Fit
from ..infer.problem import Problem
from ..infer.result import as_shown, model_of
from ..io import statistics
from ..io.logs.run import Run
from ..model import native, tables
from ..model.models import Model
from . import plausibility, resistance
from .resistance import Second

POWER_UNITS = ("W", "J", "ohm")
"""Of numbers that are known no better than the power of the springs."""


def per_spring(residual: Sequence[np.ndarray]) -> np.ndarray:
    """Return the rms of each spring over all runs, (springs,)."""
    return np.array([statistics.rms([run[:, k] for run in residual]) for k in range(residual[0].shape[1])])


def left_per_spring(problem: Problem, fit: Fit) -> np.ndarray:
    """Return what a fit leaves of each spring beyond the noise, degC rms (springs,); NaN where nothing was measured."""
    noise = np.sqrt(np.mean(np.square(problem.noise), axis=0))
    return np.sqrt(np.maximum(0.0, per_spring(fit.residual) ** 2 - noise**2))


def misfit(problem: Problem, fit: Fit) -> list[str]:
    """Return a doubt where the model misses springs by more than a board could stand.

    That is the margin which an unsure board keeps above the transformation: three times the rms are to stay within it.
    """
    margin = tables.settings()["unsure_margin_k"].default
    left = left_per_spring(problem, fit)
    wrong = [f"{k + 1}" for k in np.flatnonzero(3.0 * left > margin)]
    if not wrong:
        return []
    springs = f"spring{'s' * (len(wrong) > 1)} {', '.join(wrong)}"
    return [
        f"{np.nanmax(left):.1f} K rms of what {springs} showed is explained by nothing, and three times of that is beyond the "
        f"margin of {margin:g} K that a board keeps: correct the log, or leave out what is wrong, and diagnose again"
    ]


def impossible(second: Second | None) -> list[str]:
    """Return a warning where what v / i says of the phases is nothing that a spring can have, beside these temperatures."""
    table = native.parameter_table()
    numbers = {
        name: one.value
        for effect in (second.effects if second else ())
        if effect.name != "contact_resistance"  # its is a change
        for name, one in effect.parameters.items()
    }
    wrong = [n for n, value in numbers.items() if not table[n].minimum <= value <= table[n].maximum]
    return [
        f"v / i does not go with the temperatures ({name} would be {numbers[name]:.3g} {table[name].unit}): nothing is made of it"
        for name in wrong[:1]
    ]


def scale_of_power(problem: Problem) -> tuple[str, str] | None:
    """Return what is missing where no run has measured any power, and what the scale of all powers is, in words."""
    modes = {run.mode for run in problem.runs}
    if "power" in modes:
        return None
    if "current" in modes:
        ohm = problem.base_value("resistance_martensite_ohm")
        return "no voltages were logged", f"known in proportion to the declared {ohm:g} ohm only"
    return "no currents were logged", "known in proportion to the declared heat capacity only"


def about_power(problem: Problem) -> list[str]:
    """Return a warning where no run has measured any power."""
    if not (scale := scale_of_power(problem)):
        return []
    return [f"{scale[0]}: what is in W, J or ohm is {scale[1]}, and is not exported"]


def of_rooms(problem: Problem, fit: Fit) -> list[str]:
    """Return a warning for each run whose room would be further than its beginning, or its coldest thermometer, lets it be."""
    return [
        f"{Path(problem.runs[free.run].name).name}: no ambient_c, and its room comes to lie at a bound, {fit.value(free.key):.1f} degC: "
        "what the model lacks, or how the run began, would have it beyond; log ambient_c"
        for free in fit.spec.free
        if free.run is not None and free.key.startswith("ambient_c@") and free.key in fit.at_bounds()
    ]


def never_driven(problem: Problem) -> list[str]:
    """Return a warning for each spring of which nothing but commands is logged, and none in any run."""
    driven = np.any([np.any(run.drive > 0, axis=0) for run in problem.runs], axis=0)
    if any(run.mode != "command" for run in problem.runs):
        return []
    declared_w = problem.base_value("command_power_w")
    return [
        f"spring {k + 1} is driven in none of these logs: what a command gives it is not known, and where one drives it `predict` "
        f"takes {declared_w:g} W for the whole of it, as declared; log a run that drives it"
        for k in np.flatnonzero(~driven)
    ]


def not_logged(problem: Problem, fit: Fit) -> list[str]:
    """Return what is to be said of a fit because something was not logged."""
    return of_rooms(problem, fit) + about_power(problem) + never_driven(problem)


def _of_springs(problem: Problem, fit: Fit) -> dict[str, str]:
    """Return numbers of single springs beside which too much is left unexplained to know them, and that in words."""
    out = {}
    left = left_per_spring(problem, fit)
    own = [(free, name) for free in fit.spec.free for name in free.names if free.effect and "[" in name]
    for effect in dict.fromkeys(free.effect for free, _ in own):
        parts = zip(problem.runs, fit.residual, problem.predictions_without(fit, effect), strict=True)
        signal = per_spring([run.temperature_c - rest - less for run, rest, less in parts])
        for name in (name for free, name in own if free.effect == effect):
            k = int(name.partition("[")[2].rstrip("]")) - 1
            if left[k] > KNOWN * signal[k]:
                out[name] = (
                    f"{left[k]:.1f} K rms of spring {k + 1} are unexplained, beside {signal[k]:.1f} K that it explains"
                )
    return out


def into_model(model: Model, problem: Problem, fit: Fit, doubts: Sequence[str]) -> None:
    """Put into a model what `export` must know of its log: why it is doubted, and which numbers are kept as the chip has them."""
    if doubts:
        model.provenance["doubts"] = list(doubts)
    if scale := scale_of_power(problem):
        table = native.parameter_table()
        for name in model.stderr:
            known = table[name.partition("[")[0]]
            if known.unit.split("/")[0] in POWER_UNITS or known.name in ("emissivity", "surface_mm2"):
                model.kept[name] = f"{scale[0]}: it is {scale[1]}"
    model.kept |= {name: why for name, why in _of_springs(problem, fit).items() if name in model.parameters}


def of_log(
    problem: Problem, runs: Sequence[Run], swapped: Sequence[str], fits: Sequence[Fit], left_over: bool
) -> list[str]:
    """Return why a log is to be doubted, beside `swapped` columns.

    Where structure is left another clock is tried with each of the fits, the last of which is the answer.
    """
    doubts = [*swapped, *(text for run in runs for text in plausibility.undriven_but_hottest(run))]
    if left_over:
        doubts += plausibility.shifted_clock(problem, fits)
    return doubts or misfit(problem, fits[-1])


def model_of_fit(
    problem: Problem, fit: Fit, runs: Sequence[Run], second: Second | None = None
) -> tuple[Model, list[str]]:
    """Return the model.toml of a fit that no search made, with what v / i says beside it, and what is to be said of its log."""
    left_over = statistics.rms(fit.residual) > 1.5 * problem.noise_c
    doubts = of_log(problem, runs, plausibility.swapped(runs), (fit,), left_over)
    model = model_of(problem, fit, as_shown(problem, fit))
    resistance.into_model(model, second)
    into_model(model, problem, fit, doubts)
    return model, doubts + not_logged(problem, fit)
