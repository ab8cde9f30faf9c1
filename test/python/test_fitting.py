"""Fits: standard errors that cover, held-out blocks that are held out, starts whitened out, refusals survived."""

from __future__ import annotations

import copy
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made import searched
from ninespring.find import diagnosis, evidence
from ninespring.infer.declared import base_spec
from ninespring.infer.fit import Fit
from ninespring.infer.problem import FOLDS, Problem, fold_of_rows
from ninespring.infer.result import model_of, parameters_of
from ninespring.infer.scene import scene_of
from ninespring.io import statistics
from ninespring.io.logs import read_log
from ninespring.io.logs.run import Run
from ninespring.model import effects, native
from ninespring.model.models import Array, Model
from plants import a_plant, columns_of, levels, switched

TRUE = {
    "heat_capacity_j_per_k": 0.3,
    "loss_w_per_k": 0.0058,
    "loss_fan_w_per_k": 0.0113,
    "orthogonal_w_per_k": 0.000586,
}


def deviations(make_log, effect: dict, wanted: list[str], true: dict[str, float], seeds: range) -> np.ndarray:
    """Return (fitted - true) / standard error over seeds and numbers."""
    out = []
    for seed in seeds:
        run = read_log(make_log(f"c{seed}.csv", effect, seed=seed, seconds=400))
        _, fit, _ = diagnosis.fit_effects(Array(), [run], wanted)
        errors = fit.stderr()
        out += [(fit.value(key) - value) / errors[key] for key, value in true.items()]
    return np.array(out)


BOTH = {"sensor_lag": {"sensor_lag_s": 5.0}, "fan_wake": {"wake_w_per_k": 0.0015, "wake_direction": 1.0}}


@pytest.mark.parametrize(
    ("effects_on", "true", "logs"),
    [({}, TRUE, 16), (BOTH, {"sensor_lag_s": 5.0, "wake_w_per_k": 0.0015} | TRUE, 12)],
)
def test_the_95_percent_interval_covers_the_truth_95_times_in_100(
    make_log, effects_on: dict, true: dict, logs: int
) -> None:
    z = deviations(make_log, effects_on, list(effects_on), true, range(20, 20 + logs))
    inside = np.mean(np.abs(z) <= 1.96)
    # 64 or 72 numbers at 95 %: outside of 0.85 has a chance of 2 in 1000; wider or narrower errors miss the spread
    assert inside >= 0.85, f"{100 * inside:.0f} % of {len(z)}"
    assert 0.75 < np.sqrt(np.mean(z**2)) < 1.3, "the errors are too wide or too narrow"


def test_errors_grow_where_the_residual_remembers(make_log) -> None:
    def wander(columns: dict[str, np.ndarray]) -> None:
        rng = np.random.default_rng(5)
        for k in range(1, 10):
            slow = np.zeros(600)
            for row in range(1, 600):
                slow[row] = 0.98 * slow[row - 1] + rng.normal(0.0, 0.06)
            columns[f"t{k}_c"] = columns[f"t{k}_c"] + slow

    sizes = []
    for change in (None, wander):
        problem = Problem(Array(), [read_log(make_log(seed=4, change=change))])
        fit = problem.fit(base_spec(problem), errors=True)
        sizes.append(fit.stderr()["loss_w_per_k"])
    # 0.3 K white and 0.3 K that remembers 50 s: far more than the factor of 1.4 of the mere size
    assert sizes[1] > 2.5 * sizes[0]


def test_held_out_blocks_are_not_fitted(make_log) -> None:
    """A step that only the held-out block has cannot be known: its error must show whole."""
    run = read_log(make_log(seed=6, noise=0.05))
    at = fold_of_rows(run) == 2
    problem = Problem(Array(), [run])
    fit = problem.fit(base_spec(problem), errors=True)
    clean = problem.holdout_rmse(fit)
    assert clean == pytest.approx(0.05, rel=0.1)
    # a number that is free in one block only: fitted in sample, unknown when the block is left out
    drift = next(
        c for c in effects.candidates(scene_of(problem)) if c.effect == "ambient_drift" and c.variant == "free"
    )
    spec = fit.spec.with_effect("ambient_drift", drift.free, drift.fixed, "free")
    run.temperature_c[at] += 2.0
    freer = problem.fit(spec, fit.as_dict())
    left_in = statistics.rms(freer.residual)
    assert problem.holdout_rmse(freer) > 1.2 * left_in


@pytest.mark.parametrize("believed", [None, 0.003])
def test_held_out_errors_are_those_of_fits_to_the_rest(make_log, believed: float | None) -> None:
    """By slopes alone, and as if each fifth of the log had not been there; what is believed stands as firmly as it did."""
    run = read_log(make_log(seed=6, effects={"edge_loss": {"edge_loss_fraction": 0.2}}))
    problem = Problem(Array(), [run])
    spec = base_spec(problem)
    free = [replace(f, prior=believed or f.prior) if f.key == "loss_w_per_k" else f for f in spec.free]
    spec = replace(spec, free=tuple(free))
    problem.learn_starts(spec, [free.start for free in spec.free])
    fit = problem.fit(spec)
    at, squares = fold_of_rows(run), 0.0
    for fold in range(FOLDS):
        rest = replace(run, temperature_c=np.where((at == fold)[:, None], np.nan, run.temperature_c))
        without = Problem(Array(), [rest])
        without.noise = problem.noise
        without.learn_starts(spec, [free.start for free in spec.free])
        again = without.fit(spec, fit.as_dict())
        # from the first readings of the whole log, which the first block has
        left = problem.residuals(problem.predictions(spec, again.values))[0]
        squares += float(np.nansum(left[at == fold] ** 2))
    refitted = math.sqrt(squares / problem.count)
    assert problem.holdout_rmse(fit) == pytest.approx(refitted, rel=0.01)
    assert refitted > 1.01 * statistics.rms(fit.residual)


def test_every_row_is_in_one_fold_and_folds_are_alike(make_log) -> None:
    for seconds in (120, 600, 900):
        run = read_log(make_log(f"{seconds}.csv", seconds=seconds))
        counts = np.bincount(fold_of_rows(run), minlength=FOLDS)
        assert counts.sum() == seconds and len(counts) == FOLDS
        assert counts.min() >= 0.5 * counts.max()


def test_a_wrong_first_reading_is_kept_out_of_the_fit(make_log) -> None:
    def off(columns: dict[str, np.ndarray]) -> None:
        columns["t1_c"] = columns["t1_c"].copy()
        columns["t1_c"][0] += 4.0

    true = read_log(make_log("a.csv", seed=8))
    wrong = read_log(make_log("b.csv", seed=8, change=off))
    values = [searched(run).base for run in (true, wrong)]
    errors = values[0].stderr()
    for key, one in values[0].as_dict().items():
        assert abs(one - values[1].value(key)) < errors[key], key


def test_values_that_the_plant_refuses_are_merely_bad(make_log) -> None:
    problem = Problem(Array(), [read_log(make_log(seconds=120))])
    spec = base_spec(problem)
    values = [f.start for f in spec.free]
    values[0] = -1.0
    assert np.all(problem.simulate(spec, values, 0) == 1e3)


def test_bounds_hold_and_are_reported(make_log) -> None:
    problem = Problem(Array(), [read_log(make_log(effects={"edge_loss": {"edge_loss_fraction": -0.2}}))])
    spec = base_spec(problem)
    side = next(c for c in effects.candidates(scene_of(problem)) if c.variant == "per free side")
    spec = spec.with_effect(side.effect, side.free, (), side.variant)
    fit = problem.fit(spec)
    low = next(f.low for f in side.free)
    assert fit.value("edge_loss_fraction") >= low
    assert ("edge_loss_fraction" in fit.at_bounds()) == (fit.value("edge_loss_fraction") < low + 2e-3)
    fit.values[-1] = low
    assert fit.at_bounds() == ["edge_loss_fraction"]


def test_springs_start_where_the_sensors_would_show_the_first_row() -> None:
    numbers = {"sensor_gain": 1.2, "sensor_offset_k": 1.5, "optical_share": 0.6, "optical_width": 0.3}
    plant = a_plant((1, 2), ["sensor_gain", "optical_mixing"], numbers)
    plant.start_from_measured(np.array([40.0, math.nan]))
    assert plant.measured_c()[0] == pytest.approx(40.0, abs=0.001)
    assert plant.temperature_c()[1] == 20.0


def test_a_number_that_explains_nothing_costs(make_log) -> None:
    found = searched(read_log(make_log(seed=2)))
    lag = next(c for c in found.candidates if c.effect == "sensor_lag")
    spare = found.refit(found.base, [lag], [0.1])
    assert (
        evidence.log_evidence(found.problem, spare, found.base) < -3.0
    )  # half the logarithm of 5400 samples, less what it found


def test_a_thermometer_that_wanders_says_less_of_what_is_slow_than_of_what_is_quick(make_log) -> None:
    """Of two causes that leave as much behind, the quick one is clear where the slow one is the thermometer's own way."""
    found = searched(read_log(make_log(seed=2)))
    problem, base = found.problem, found.base
    rows = len(problem.runs[0].time_s)
    rng = np.random.default_rng(3)
    wander = 0.3 * np.cumsum(rng.standard_normal((rows, 9)), axis=0)
    time_s = np.arange(rows)[:, None]

    def evidence_for(signal: np.ndarray) -> float:
        fits = [copy.copy(base), copy.copy(base)]
        for fit, left in zip(fits, (wander, wander + signal), strict=True):
            fit.residual, fit.factor, fit.colour = [left], math.nan, None
            fit.chi2 = fit.sse = problem.plain(fit.residual)
        fits[1].chi2 = fits[1].sse = 1.05 * fits[0].chi2
        return evidence.log_evidence(problem, fits[0], fits[1])

    slow, quick = np.sin(2 * np.pi * time_s / 1200.0), np.sin(2 * np.pi * time_s / 12.0)
    assert evidence_for(np.broadcast_to(quick, wander.shape)) > 5.0 * abs(
        evidence_for(np.broadcast_to(slow, wander.shape))
    )


def test_only_what_the_noise_of_a_first_reading_leaves_is_taken_away(make_log) -> None:
    found = searched(read_log(make_log(seed=9)))
    problem, fit = found.problem, found.base
    response = problem.simulate(fit.spec, fit.values, 0, np.eye(9)[3]) - problem.simulate(fit.spec, fit.values, 0)
    rest = problem.without_errors(fit.residual)[0]
    for off, left in ((0.6, 0.0), (6.0, 6.0 - 0.9)):  # K: twice the noise, twenty times the noise
        moved = problem.without_errors([fit.residual[0] + off * response])[0]
        apart = np.nansum((moved - rest) * response) / np.nansum(response**2)
        assert apart == pytest.approx(left, abs=0.45)
    untouched = fit.residual[0][300:] - rest[300:]
    assert np.nanmax(np.abs(untouched)) < 0.03


def test_what_rounding_of_voltages_leaves_is_no_structure_and_heat_beside_it_is(make_log) -> None:
    """Voltages that step by 4 mV, or have two digits, tell the power to 1 % or so: the same error as long as a current stays the same."""
    plant = native.Plant(3, 3)

    def logged(name: str, head: str, step_v: float, to_spring_9: float = 0.0) -> Run:
        def change(columns: dict[str, np.ndarray]) -> None:
            power = np.column_stack([columns[f"i{k}_a"] * columns[f"v{k}_v"] for k in range(1, 10)])
            shown = []
            for share in (0.0, to_spring_9):
                plant.reset()
                given = power + share * np.outer(power[:, 0], np.arange(9) == 8)
                time_s = np.arange(float(len(power)))
                shown.append(plant.simulate(time_s, native.POWER, given, columns["fan"], columns["ambient_c"]))
            for k in range(1, 10):
                columns[f"t{k}_c"] = columns[f"t{k}_c"] + (shown[1] - shown[0])[:, k - 1]
                if step_v:
                    columns[f"v{k}_v"] = step_v * np.round(columns[f"v{k}_v"] / step_v)

        path = make_log(name, seconds=900, noise=0.1, change=change)
        path.write_text(head + path.read_text())
        return read_log(path)

    def left_over(run: Run) -> tuple[bool, Fit]:
        problem, fit, _ = diagnosis.fit_effects(Array(), [run], [])
        share.append(statistics.rms(problem.without_errors(fit.residual)) / statistics.rms(fit.residual))
        return evidence.unexplained(problem, fit), fit

    share: list[float] = []
    of_a_board = "# version: ninespring 0.1.0 mega2560, sensors integer\n"
    board, by_board = left_over(logged("board.csv", of_a_board, 4e-3))
    assert not board
    left_over(logged("meter.csv", "", 1e-2))
    assert share[-1] < 0.6
    assert left_over(logged("heated.csv", of_a_board, 4e-3, 0.03))[0]
    # the numbers are known as well as the power is
    fine, by_fine = left_over(logged("fine.csv", "", 0.0))
    off = np.log(by_board.value("loss_w_per_k") / plant.get("loss_w_per_k"))
    at = [free.key for free in by_board.spec.free].index("loss_w_per_k")
    few, many = (np.sqrt(one.covariance[at, at]) for one in (by_fine, by_board))
    assert not fine and many > 1.5 * few and abs(off) < 3.0 * many < 0.01


@pytest.mark.parametrize(("share", "told"), [(6e-4, False), (0.02, True)])
def test_of_an_exact_log_a_thousandth_of_the_rise_is_no_structure(tmp_path: Path, share: float, told: bool) -> None:
    """Somebody's own simulation, without noise: the drive of one spring also heats another, by so little or by more."""
    time_s = np.arange(600.0)
    power = 0.35 * switched(np.random.default_rng(6), 600, 0.0, 0.5, 1.0)[:, :4]
    plant = a_plant((2, 2))
    nothing = np.zeros(600), np.full(600, 20.0)
    shown = plant.simulate(time_s, native.POWER, power + share * np.outer(power[:, 0], [0, 0, 0, 1]), *nothing)
    columns = columns_of(i=power / 0.25, v=np.where(power > 0.0, 0.25, 0.0), t=shown)
    path = tmp_path / "exact.csv"
    head = ",".join(["time_s", *columns, "ambient_c"])
    table = np.column_stack([time_s, *columns.values(), nothing[1]])
    np.savetxt(path, table, "%.9f", delimiter=",", header=head, comments="")
    problem, fit, _ = diagnosis.fit_effects(Array(2, 2), [read_log(path)], [])
    assert evidence.unexplained(problem, fit) == told


def test_what_heaters_of_unknown_power_radiate_is_not_held_to_black_springs() -> None:
    """Commands tell watts in proportion to a declared heat capacity: as black as a declared surface of springs is no bound of heaters, and at
    it a power law, which still air is, would be called certain instead."""
    numbers = {"heat_capacity_j_per_k": 1.0, "loss_w_per_k": 0.004, "surface_mm2": 900.0, "emissivity": 1.0}
    plant = a_plant((1, 2), ["radiation"], numbers | {"command_power_w": 0.6, "ambient_c": 20.0})
    rng = np.random.default_rng(4)
    command = np.repeat(levels(rng), 2, axis=0)
    time_s, still, room_c = np.arange(1200.0), np.zeros(1200), np.full(1200, 20.0)
    shown = plant.simulate(time_s, native.COMMAND, command, still, room_c) + rng.normal(0.0, 0.1, command.shape)
    run = Run("run", "", time_s, "command", command, shown, still, room_c)
    declared = Model(Array(1, 2), parameters={"heat_capacity_j_per_k": 1.0, "loss_w_per_k": 0.01})
    problem, fit, _ = diagnosis.fit_effects(Array(1, 2), [run], ["radiation"], model=declared)
    _, other, _ = diagnosis.fit_effects(Array(1, 2), [run], ["natural_convection"], model=declared)
    assert evidence.log_evidence(problem, fit, other) > 10.0
    model = model_of(problem, fit, problem.runs)
    assert model.parameters["emissivity"] * model.parameters["surface_mm2"] == pytest.approx(900.0, rel=0.05)
    assert not fit.at_bounds()
    said = effects.sentence("radiation", parameters_of(problem, fit, "radiation"), "")
    assert said.startswith("Heat radiates away as from ")
