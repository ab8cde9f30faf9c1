"""`ninespring fit`."""

from __future__ import annotations

from pathlib import Path

import click

from ..errors import InputError
from ..export.settings import left_out
from ..find import board_alone, diagnosis, doubt, steady
from ..infer import from_resistance
from ..infer.fit import Fit
from ..infer.problem import Problem
from ..infer.result import parameters_of
from ..io import results
from ..io.logs import Run
from ..io.statistics import rms
from ..model import effects
from ..model.models import Array, Model, check_effects, model_text
from .console import (
    ARRAY,
    FILE,
    JSON,
    array_and_runs,
    beside,
    command,
    logs_of,
    model_and_array,
    notes,
    notes_of,
    output,
    print_parameters,
    working,
    write,
)

TOLD = 0.1
"""Correlations below this are not told ..."""
MOST_TOLD = 8
"""... and so many are printed."""


@command("""\b
Examples:
  ninespring fit run1.csv run2.csv -o model.toml
  ninespring fit --effects latent_heat,shared_air run1.csv -o model.toml
  ninespring fit --model declared.toml run1.csv -o model.toml
""")
@click.argument("logs", nargs=-1, required=True, type=FILE)
@ARRAY
@click.option("--model", "model_path", type=FILE, help="model.toml: declared values and effects already on")
@click.option("--effects", default="", help="effects to switch on and fit, comma-separated")
@output("model.toml to write")
@JSON
def fit(
    logs: tuple[Path, ...],
    array_path: Path | None,
    model_path: Path | None,
    effects: str,
    output: Path,
    json_path: Path | None,
) -> None:
    """Fit the declared model, with the effects named, to logs.

    Logs of a board alone, currents and voltages without any temperature, are fitted to v / i: each spring's transformation
    is a fixed point of its temperature, and effects of the array that it shows are looked for and named. Errors are root mean squares in K (of v / i: in mohm); numbers are in J/K, W/K, J, s as the table says. Held out: on blocks of two and a
    half minutes that the numbers were not fitted to.
    """
    wanted = list(dict.fromkeys(e.strip() for e in effects.split(",") if e.strip()))
    check_effects(wanted)
    for path in logs:
        if steady.is_steady(path):
            raise InputError("a steady table: `ninespring diagnose` fits it, effect by effect", path, 1)
    declared, array = model_and_array(model_path, array_path)
    array, runs = array_and_runs(array, logs)
    notes_of(runs)
    if from_resistance.has_none(runs):
        if wanted or declared:
            raise InputError(
                "without a thermometer the effects are looked for: leave --effects and --model out", logs[0]
            )
        _fit_from_resistance(array, runs, output, json_path)
        return
    with working("fitting") as say:
        problem, chosen, base = diagnosis.fit_effects(array, runs, wanted, say, declared)
        say("held-out blocks")
        held = problem.holdout_rmse(chosen)
        say("what v / i says")
        second = diagnosis.by_resistance(problem, chosen, wanted)
        say("is the log to be doubted?")
        model, suspect = doubt.model_of_fit(problem, chosen, runs, second)
    before, after = rms(base.residual), rms(chosen.residual)
    model.provenance["rmse_before_c"] = before
    errors = {"rmse_before_c": before, "rmse_c": after, "holdout_rmse_c": held, "noise_c": problem.noise_c}
    result = _result(problem, chosen, runs, suspect, errors)
    for one in second.effects if second else ():
        result.effects.append(one.name)
        result.parameters |= one.parameters
    notes("", suspect)
    _write(model, result, output, json_path)
    model.name = "model.toml" if str(output) == "-" else str(output)
    beside(output).print(f"error {after:.3f} K, held out {held:.3f} K, noise {problem.noise_c:.3f} K -> {output}")
    for effect, why in left_out(model).items():
        beside(output).print(f"{effect}: not for the chip: {why}")


def _result(
    problem: Problem, found: Fit, runs: list[Run], warnings: list[str], errors: dict[str, float]
) -> results.Fit:
    """Return a fit's numbers, each with the interval in which it lies in 95 of 100 cases, and its errors."""
    numbers = {k: v for e in (None, *found.spec.effects) for k, v in parameters_of(problem, found, e).items()}
    for name, ends in found.intervals().items():
        numbers[name].interval_95 = ends
    return results.Fit(
        logs=logs_of(runs),
        **dict.fromkeys(("rmse_before_c", "rmse_c", "holdout_rmse_c", "noise_c")) | errors,
        effects=list(found.spec.effects),
        parameters=numbers,
        correlations=[results.Correlation(a=a, b=b, correlation=value) for a, b, value in found.correlations(TOLD)],
        not_identifiable=sorted(found.stuck),
        at_bounds=found.at_bounds(),
        warnings=warnings,
    )


def _write(model: Model, result: results.Fit, output: Path, json_path: Path | None) -> None:
    """Write a fit, and print its numbers, and which numbers' errors go together, strongest first: all of those are in --json."""
    write({output: model_text(model), json_path: results.checked(result)})
    said, found = beside(output), result.correlations
    print_parameters(said, result.parameters)
    if not found:
        return
    said.print(f"errors that go together, of {len(found)} pairs beyond {TOLD:g} (--json has all):")
    for one in found[:MOST_TOLD]:
        said.print(f"  {one.correlation:+.2f}  {one.a}, {one.b}")


def _fit_from_resistance(array: Array, runs: list[Run], output: Path, json_path: Path | None) -> None:
    with working("fitting v / i") as say:
        problem, found, first = from_resistance.fit(array, runs)
        found, witnesses = board_alone.with_effects(problem, found, say)
    model = from_resistance.model_of_fit(problem, found)
    errors = {"rmse_before_v": rms(first.residual), "rmse_v": rms(found.residual), "noise_v": problem.noise_c}
    result = _result(problem, found, runs, [from_resistance.SCALE], {name: 1e-3 * one for name, one in errors.items()})
    _write(model, result, output, json_path)
    beside(output).print(
        f"no thermometer: fitted to v / i, error {1e3 * result.rmse_before_v:.1f} mV as declared, "
        f"{1e3 * result.rmse_v:.1f} fitted, readings are good for {1e3 * result.noise_v:.1f} -> {output}"
    )
    for name, one in witnesses.items():
        said = effects.sentence(name, parameters_of(problem, found, name), dict(found.spec.variant)[name])
        beside(output).print(f"{said} ({100 * one.probability():.0f} %)")
    notes("", [from_resistance.SCALE])
