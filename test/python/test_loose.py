"""What a thermometer reads while it is loose counts nowhere: not in a number, not in an error, not against a name."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from ninespring.find import diagnosis, loose, search
from ninespring.find.evidence import likelihood
from ninespring.infer.declared import base_spec
from ninespring.infer.fit import Fit
from ninespring.infer.likelihood import Colour
from ninespring.infer.predict import predict
from ninespring.infer.problem import Problem
from ninespring.infer.scene import scene_of
from ninespring.io import statistics
from ninespring.io.logs import read_log
from ninespring.io.logs.run import Run
from ninespring.model import effects
from ninespring.model.models import Array

TWO = Array(1, 2)
COMES = 413
"""Row at which the thermometer comes loose: on no grid."""


def two_springs(
    path: Path, seed: int, shows: float = 1.0, drive: float = 1.0, holder_w_per_k: float = 0.003, late_s: float = 0.0
) -> Run:
    """Return 800 s of two springs, by other equations than the plant's: from COMES on thermometer 2 shows a part of its spring's
    rise, or spring 2 is given a part of what was logged."""
    rng, rows, room = np.random.default_rng(seed), 800, 20.0
    amperes = np.zeros((rows, 2))
    for k in range(2):
        at = 20
        while at < rows:
            held = int(rng.integers(40, 120))
            amperes[at : at + held, k] = rng.choice([0.0, 1.0, 1.4])
            at += held
    springs, held_c, shown = np.full(2, room), np.full(2, room), np.full(2, room)
    lines = ["time_s,i1_a,i2_a,v1_v,v2_v,t1_c,t2_c,ambient_c"]
    for row in range(rows):
        seen = springs.copy()
        given = amperes[row] ** 2 * 0.219
        if row >= COMES:
            seen[1] = room + shows * (seen[1] - room)
            given[1] *= drive
        shown = seen if late_s == 0.0 else shown + (seen - shown) * -math.expm1(-1.0 / late_s)
        values = [row, *amperes[row], *(0.219 * amperes[row]), *(shown + rng.normal(0.0, 0.1, 2)), room]
        lines.append(",".join(f"{one:.6g}" for one in values))
        for _ in range(10):
            lost = 0.006 * (springs - room) + 0.0006 * (springs - springs[::-1]) + holder_w_per_k * (springs - held_c)
            springs, held_c = (
                springs + 0.1 * (given - lost) / 0.3,
                held_c + 0.1 * holder_w_per_k * (springs - held_c) / 0.4,
            )
    path.write_text("\n".join(lines) + "\n")
    return read_log(path)


def fitted(runs: list[Run]) -> tuple[Problem, Fit]:
    """Return the problem of some runs and the declared model fitted to them, with its slopes."""
    problem = Problem(TWO, runs)
    return problem, diagnosis.first_fit(problem, base_spec(problem))


def test_what_a_loose_thermometer_reads_spoils_nothing(tmp_path: Path) -> None:
    runs = [two_springs(tmp_path / "1.csv", 1), two_springs(tmp_path / "2.csv", 2, shows=0.4)]
    found = diagnosis.diagnose(TWO, runs)
    (cause,) = found.told.unnamed
    assert f"thermometer 2 shows less of its spring's rise, {COMES} to 799 s of run 2: 60" in cause.text
    assert "left out" in cause.text and cause.size == pytest.approx(-0.6, abs=0.01)
    assert found.effects == ["holder_mass"] and not found.told.unexplained and not found.told.doubts
    assert found.told.after.rmse_c < 0.12 and found.told.unseen.rmse_c < 0.15
    other = two_springs(tmp_path / "3.csv", 3)
    assert statistics.rms([other.temperature_c - predict(found.model, other)]) < 0.15


@pytest.mark.parametrize("late_s", [0.0, 9.0])
def test_it_is_found_where_it_steps_and_before_noise_that_lasts(tmp_path: Path, late_s: float) -> None:
    """One thermometer that steps once is no noise; a window whose end is a grid step beside that step has two of them, and is less
    likely than noise."""
    runs = [
        two_springs(tmp_path / f"{seed}.csv", seed, shows, holder_w_per_k=0.0, late_s=late_s)
        for seed, shows in ((1, 1.0), (2, 0.5))
    ]
    problem, fit = fitted(runs)
    one = loose.find(problem, fit)
    assert one is not None and (one.run, one.spring, one.kind) == (1, 1, "share")
    assert abs(one.rows[0] - COMES) <= 1 + late_s and one.rows[1] == 800
    assert one.out_s[0] < COMES < one.out_s[0] + 40.0 and one.out_s[1] == math.inf
    assert problem.unnamed is None and problem.colour is None
    less = one.without(runs[1])
    assert np.isnan(less.temperature_c[COMES:, 1]).all() and np.isfinite(less.temperature_c[:380]).all()
    assert np.isfinite(less.temperature_c[:, 0]).all() and np.isfinite(runs[1].temperature_c).all()


def test_heat_that_bends_is_no_step_however_fine_the_thermometer() -> None:
    """What another law of a phase change leaves for half a minute, and as large a jump."""
    time_s, noise = 2.0 * np.arange(200.0), np.random.default_rng(7).normal(0.0, 0.04, (200, 1))
    window = ((time_s >= 130.0) & (time_s < 170.0))[:, None].astype(float)
    problem: Any = SimpleNamespace(
        runs=[SimpleNamespace(time_s=time_s)],
        mask=[np.ones((200, 1), dtype=bool)],
        noise=[np.array([0.04])],
        least=1.0,
        evaluate=lambda fit: fit,
        without_errors=lambda residual: residual,
    )
    one = loose.Loose(0, 0, "sensor", (65, 85), window, (130.0, 170.0), (130.0, 170.0))
    nats = []
    for shape in (np.exp(-(((time_s - 150.0) / 20.0) ** 2))[:, None], window):
        fit: Any = SimpleNamespace(residual=[shape + noise])
        nats.append(loose._nats_of_steps(problem, fit, one))
    assert nats[0] < 3.0 and nats[1] > 30.0


def test_a_drive_that_changes_is_no_thermometer(tmp_path: Path) -> None:
    runs = [two_springs(tmp_path / f"{n}.csv", n, drive=drive, holder_w_per_k=0.0) for n, drive in ((1, 1.0), (2, 0.5))]
    assert loose.find(*fitted(runs)) is None


def test_nothing_is_loose_where_a_name_is_missing(tmp_path: Path) -> None:
    assert loose.find(*fitted([two_springs(tmp_path / f"{n}.csv", n) for n in (1, 2)])) is None


@pytest.mark.parametrize("shows", [0.5, 1.0])
def test_what_a_model_that_never_saw_it_has_right_counts_again(tmp_path: Path, shows: float) -> None:
    runs = [two_springs(tmp_path / f"{n}.csv", n, part, holder_w_per_k=0.0) for n, part in ((1, 1.0), (2, shows))]
    profile = np.zeros((800, 2))
    one = loose.Loose(1, 1, "share", (COMES, 800), profile, (float(COMES), 799.0), (400.0, math.inf))
    problem, fit = fitted([runs[0], one.without(runs[1])])
    seen = loose.seen_by(problem, runs, fit, one)
    assert (seen is None) == (shows == 1.0)
    if seen is not None:
        assert seen.size == pytest.approx(-0.5, abs=0.01) and 0.0 < seen.error < 0.01


def wandering(tmp_path: Path) -> tuple[Problem, Fit, Fit]:
    """Return a problem in which much is left, taken for noise that lasts, the declared model fitted so, and by least squares."""
    problem, plain = fitted([two_springs(tmp_path / "1.csv", 1), two_springs(tmp_path / "2.csv", 2, drive=0.6)])
    likelihood(problem, plain)
    problem.take_for(plain.colour)
    return problem, problem.fit(plain.spec, plain.as_dict(), tolerance=1e-5, errors=True), plain


def test_a_log_is_told_of_by_the_model_that_is_given(tmp_path: Path) -> None:
    """What lasts was taken for noise in what was found: its errors are not those of the declared model that is given instead."""
    problem, lasting, plain = wandering(tmp_path)
    found = search.Search(problem, effects.candidates(scene_of(problem)), lasting)
    case = diagnosis._Case(problem=problem, search=found, declared=plain, final=lasting, without={})
    judged_by: Any = SimpleNamespace(refitted=lambda again, _: again.base, instead=plain)
    case.instead = plain
    given, after = diagnosis._the_given(case, judged_by)
    assert given is plain and after.rmse_c == statistics.rms(plain.residual) < statistics.rms(lasting.residual)
    assert problem.colour is None and case.final is not given


def test_the_error_held_out_is_the_models_whatever_lasts(tmp_path: Path) -> None:
    """No smoother takes from it what the readings before and after tell: they are told when a log is read, not when a run is predicted."""
    problem, lasting, plain = wandering(tmp_path)
    assert isinstance(problem.colour, Colour)
    assert problem.holdout_rmse(lasting) > 0.95 * statistics.rms(lasting.residual)
    problem.take_for(None)
    assert problem.holdout_rmse(plain) > 0.95 * statistics.rms(plain.residual)


def test_a_number_has_the_error_that_was_computed_or_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A second fit that is no better leaves the first, with errors of its own; how firmly a number was held is none."""
    problem, plain = fitted([two_springs(tmp_path / "1.csv", 1)])
    bare = problem.fit(plain.spec, plain.as_dict())
    assert bare.covariance is None
    fit = Problem.fit

    def worse(self: Problem, *args: Any, **more: Any) -> Fit:
        out = fit(self, *args, **more)
        out.chi2 *= 1.01
        return out

    monkeypatch.setattr(Problem, "fit", worse)
    told = diagnosis._finish(problem, bare)
    assert told.values.tolist() == bare.values.tolist() and bare.covariance is None
    assert told.stderr()["loss_w_per_k"] == pytest.approx(plain.stderr()["loss_w_per_k"], rel=0.05)
    monkeypatch.undo()
    assert diagnosis.with_everything(problem, bare, replace(plain, sse=math.inf)).covariance is None


@pytest.mark.parametrize(("minutes", "is_loose"), [(0.0, True), (1.0, False)])
def test_what_comes_within_a_minute_is_no_step(tmp_path: Path, minutes: float, is_loose: bool) -> None:
    """Heat that wanders makes a thermometer's share of what the model has, too, and evenly: 1.3 % of a board's was told as a loose one."""
    runs = [two_springs(tmp_path / f"{seed}.csv", seed, holder_w_per_k=0.0) for seed in (11, 1)]
    share = np.interp(
        np.arange(800.0), [COMES - 0.5 - 30.0 * minutes, COMES - 0.5 + 30.0 * minutes + 1e-9], [1.0, 0.97]
    )
    runs[1].temperature_c[:, 1] = 20.0 + share * (runs[1].temperature_c[:, 1] - 20.0)
    found = loose.find(*fitted(runs))
    assert (found is not None) is is_loose
