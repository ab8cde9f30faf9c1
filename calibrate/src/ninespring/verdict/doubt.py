"""What a log does not determine although it was fitted, and what makes the log itself doubtful: `export` leaves both out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .. import native, tables
from ..export.settings import KNOWN
from ..fit import statistics
from ..fit.problem import Problem
from ..fit.spec import Fit
from ..logs.run import Run
from ..models import Model
from . import plausibility
from .result import as_shown, model_of

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


def impossible(second: Mapping[str, Any] | None) -> list[str]:
    """Return a warning where what v / i says of the phases is nothing that a spring can have, beside these temperatures."""
    table = native.parameter_table()
    numbers = {
        name: one["value"]
        for effect in (second or {}).get("effects", [])
        if effect["name"] != "contact_resistance"  # its is a change
        for name, one in effect["parameters"].items()
    }
    wrong = [n for n, value in numbers.items() if not table[n].minimum <= value <= table[n].maximum]
    return [
        f"v / i does not go with the temperatures ({name} would be {numbers[name]:.3g} {table[name].unit}): nothing is made of it"
        for name in wrong[:1]
    ]


def scale_of_power(problem: Problem) -> str:
    """Return what the scale of all powers rests on where no run has measured any, in words; '' where one has."""
    modes = {run.mode for run in problem.runs}
    if "power" in modes:
        return ""
    if "current" in modes:
        ohm = problem.base_value("resistance_martensite_ohm")
        return f"no voltages were logged: it is known in proportion to the declared {ohm:g} ohm only"
    return "no currents were logged: it is known in proportion to the declared heat capacity only"


def about_power(problem: Problem) -> list[str]:
    """Return a warning where no run has measured any power."""
    if not (why := scale_of_power(problem)):
        return []
    what, rest = why.split(": it is ")
    return [f"{what}: what is in W, J or ohm is {rest}, and is not exported"]


def _of_springs(problem: Problem, fit: Fit) -> dict[str, str]:
    """Return numbers of single springs beside which too much is left unexplained to know them, and that in words."""
    out = {}
    left = left_per_spring(problem, fit)
    own = [(free, name) for free in fit.spec.free for name in free.names if free.effect and "[" in name]
    for effect in dict.fromkeys(free.effect for free, _ in own):
        bare = fit.spec.without(effect)
        shown = problem.predictions(bare, [fit.value(free.key) for free in bare.free])
        parts = zip(problem.runs, fit.residual, shown, strict=True)
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
    if why := scale_of_power(problem):
        table = native.parameter_table()
        for name in model.stderr:
            known = table[name.partition("[")[0]]
            if known.unit.split("/")[0] in POWER_UNITS or known.name == "emissivity":
                model.kept[name] = why
    model.kept |= {name: why for name, why in _of_springs(problem, fit).items() if name in model.parameters}


def model_of_fit(problem: Problem, fit: Fit, runs: Sequence[Run]) -> tuple[Model, list[str]]:
    """Return the model.toml of a fit that no search made, and what is to be said of its log."""
    doubts = plausibility.swapped(runs) + [text for run in runs for text in plausibility.undriven_but_hottest(run)]
    if statistics.rms(fit.residual) > 1.5 * problem.noise_c:
        doubts += plausibility.shifted_clock(problem, (fit,))
    doubts = doubts or misfit(problem, fit)
    model = model_of(problem, fit, as_shown(problem, fit))
    into_model(model, problem, fit, doubts)
    return model, doubts + about_power(problem)
