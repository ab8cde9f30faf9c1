"""One likelihood: what a model leaves is whitened as a filter does, and every reading counts for what it is worth."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from ninespring.infer import room
from ninespring.infer.likelihood import BROKEN, Colour, Rows, Weighed, fitted
from ninespring.infer.predict import in_its_room
from ninespring.io import statistics
from ninespring.io.logs.run import Run
from ninespring.model import native
from ninespring.model.models import Array, Model
from ninespring.model.simulate import simulate_run


def lasting(rng: np.random.Generator, rows: int, columns: int, sigma: float, time_s: float) -> np.ndarray:
    """Return errors that fade with a time constant, a row a second, (rows, columns)."""
    keep, out = math.exp(-1.0 / time_s), np.empty((rows, columns))
    out[0] = sigma * rng.standard_normal(columns)
    for row in range(1, rows):
        out[row] = keep * out[row - 1] + sigma * math.sqrt(1.0 - keep**2) * rng.standard_normal(columns)
    return out


def test_the_filter_is_the_gaussian_of_its_covariance() -> None:
    rng = np.random.default_rng(1)
    time_s = np.cumsum(rng.uniform(0.5, 4.0, 40))
    mask = np.ones((40, 1), dtype=bool)
    mask[[7, 8, 20]] = False
    rows = Rows.of(time_s, [0, 25], mask)
    colour = Colour((4.0, 0.5), (4.0, 0.5), (10.0, 900.0))
    vector = rng.standard_normal((37, 1))
    white, logarithms = rows.whitened(vector, colour)
    at = time_s[mask[:, 0]]
    apart = np.abs(at[:, None] - at[None, :])
    covariance = sum(v * np.exp(-apart / t) for v, t in zip(colour.apart, colour.time_s, strict=True))
    piece = np.flatnonzero(mask[:, 0]) >= 25
    covariance = np.where(piece[:, None] == piece[None, :], covariance, 0.0) + np.eye(37)
    assert float(white[:, 0] @ white[:, 0]) == pytest.approx(
        float(vector[:, 0] @ np.linalg.solve(covariance, vector[:, 0])), rel=1e-9
    )
    assert logarithms == pytest.approx(0.5 * np.linalg.slogdet(covariance)[1], rel=1e-9)
    assert rows.step_s[25] == BROKEN


def test_what_all_thermometers_share_is_told_from_what_each_has() -> None:
    rng = np.random.default_rng(2)
    rows, springs = 1500, 9
    shared = lasting(rng, rows, 1, 1.0, 100.0)
    readings = shared + rng.standard_normal((rows, springs))
    walk = Rows.of(np.arange(float(rows)), [0], np.ones((rows, springs), dtype=bool))
    colour, nats = fitted([walk], [readings.ravel()])
    assert sum(colour.together) > 0.4 * springs  # a mean of nine has nine times one's
    assert sum(colour.apart) < 0.05 and colour.white == pytest.approx(1.0, abs=0.1)
    alone = -0.5 * readings.size * (math.log(np.mean(readings**2)) + 1.0)
    assert nats > alone + 1000.0


def test_white_noise_stays_white() -> None:
    rng = np.random.default_rng(3)
    walk = Rows.of(np.arange(900.0), [0], np.ones((900, 3), dtype=bool))
    readings = 1.1 * rng.standard_normal((900, 3))
    colour, nats = fitted([walk], [readings.ravel()])
    assert nats == pytest.approx(-0.5 * readings.size * (math.log(np.mean(readings**2)) + 1.0), abs=3.0)
    assert colour.share < 0.05


def test_evidence_counts_a_reading_for_what_it_is_worth() -> None:
    """A ramp taken out of errors that wander for minutes: a third of their squares, and next to no evidence."""
    rng = np.random.default_rng(4)
    time_s = np.arange(900.0)
    walk = Rows.of(time_s, [0], np.ones((900, 1), dtype=bool))
    gained = []
    for _ in range(10):
        left = 3.0 * lasting(rng, 900, 1, 1.0, 300.0)[:, 0] + rng.standard_normal(900)
        ramp = np.column_stack([np.ones(900), time_s])
        less = left - ramp @ np.linalg.lstsq(ramp, left, rcond=None)[0]
        gained.append(fitted([walk], [less])[1] - fitted([walk], [left])[1])
        counted_alone = 450.0 * math.log(float(left @ left) / float(less @ less))
        assert gained[-1] < 0.1 * max(60.0, counted_alone)
    assert np.median(gained) < 4.0


def test_what_is_finer_than_the_least_noise_is_no_evidence() -> None:
    """What a model leaves of an exact log is smooth, and small: half of it is nothing worth."""
    walk = Rows.of(np.arange(900.0), [0], np.ones((900, 2), dtype=bool))
    left = 0.05 * np.sin(np.arange(1800.0) / 130.0)
    exact, bounded = ([fitted([walk], [part * left], least)[1] for part in (0.5, 1.0)] for least in (0.0, 1.0))
    assert exact[0] - exact[1] > 500.0
    assert abs(bounded[0] - bounded[1]) < 3.0
    assert fitted([walk], [left], 1.0)[0].white == 1.0


def test_steps_of_a_thermometer_are_its_noise() -> None:
    slow = 20.0 + 30.0 * (1.0 - np.exp(-np.arange(900.0) / 200.0))
    stepped = (np.round(slow / 0.32) * 0.32)[:, None]
    assert statistics.noise_floor(stepped)[0] < 0.01
    assert statistics.rounding(stepped)[0] == pytest.approx(0.32 / math.sqrt(12.0), rel=0.01)
    fine = slow[:, None] + np.random.default_rng(5).normal(0.0, 0.3, (900, 1))
    assert statistics.rounding(np.round(fine / 0.0625) * 0.0625)[0] == 0.0


def one_run(room_c: float, first_c: float, u: float = 0.5) -> Run:
    """Return two minutes of one node that loses to its room with 180 s, read in steps of 0.1 K."""
    time_s = np.arange(120.0)
    shown = room_c + 80.0 * u + (first_c - room_c - 80.0 * u) * np.exp(-time_s / 180.0)
    shown = np.round(shown[:, None] / 0.1) * 0.1
    return Run("one", "", time_s, "command", np.full((120, 1), u), shown, np.zeros(120), None)


@pytest.mark.parametrize("room_c", [16.0, 20.0, 25.0])
def test_the_first_minute_tells_a_room(room_c: float) -> None:
    run = one_run(room_c, room_c)

    def shows(part: Run, ambient_c: float, offset: np.ndarray) -> np.ndarray:
        since = part.time_s[:, None]
        warm = part.temperature_c[0] + offset
        end = ambient_c + 80.0 * part.drive[0]
        return end + (warm - end) * np.exp(-since / 180.0)

    value, sigma = room.of_run(run, room.guessed(run, 20.5, (0.0, 0.4)), shows, 1.0 / 180.0)
    assert value == pytest.approx(room_c, abs=0.6) and sigma < 0.4
    # of one run before it nothing is known but its room
    value, sigma = room.of_run(run, room.guessed(run, 20.5, None), shows, 1.0 / 180.0)
    assert abs(value - room_c) < abs(20.5 - room_c) + 0.5 and sigma < room.ROOMS_K


def test_what_is_only_heated_does_not_begin_colder_than_its_room() -> None:
    run = one_run(20.0, 20.0)
    run.temperature_c[1:] += 4.0  # thermometers that show the drive itself

    def shows(part: Run, ambient_c: float, offset: np.ndarray) -> np.ndarray:
        warm = part.temperature_c[0] + offset
        end = ambient_c + 80.0 * part.drive[0]
        return end + (warm - end) * np.exp(-part.time_s[:, None] / 180.0)

    assert room.first_c(run) == pytest.approx(20.0, abs=0.1), "what the first row shows, nothing has heated yet"
    value, _ = room.of_run(run, room.guessed(run, 30.0, None), shows, 1.0 / 180.0)
    assert value == pytest.approx(room.first_c(run) + 2.0 * room.MOVES_K)
    run.temperature_c[:2] = np.nan
    assert room.first_c(run) == pytest.approx(24.0, abs=1.0), (
        "of a logger that has read nothing yet, the first that it read"
    )


def test_a_first_minute_counts_as_far_as_those_of_the_fitted_runs_told_their_rooms() -> None:
    """A model without the lag of its thermometers has springs warm at once: what warms later is taken for a colder room."""
    plain = native.Plant(1, 1)
    plain.set("command_power_w[1]", 1.0)
    lags = plain.copy()
    lags.set_effects(["sensor_lag"])
    lags.set("sensor_lag_s", 20.0)
    rooms = (19.0, 21.0, 23.0, 25.0)
    runs = [one_run(at, at) for at in rooms]
    for run, at in zip(runs, rooms, strict=True):
        run.temperature_c[:] = simulate_run(lags.copy(), run, np.full(len(run.time_s), at))
    known = room.Rooms.of(runs[:3], rooms[:3], plain)
    trusting = replace(known, misses_k=0.0).told(runs[3], plain)
    value, sigma, _ = known.told(runs[3], plain)
    assert abs(value - 25.0) < 2.0 * sigma < 3.0 and 25.0 - trusting[0] > 5.0 * trusting[1]
    assert room.Rooms.of(runs[:3], rooms[:3], lags).misses_k < 0.3 < 2.0 < known.misses_k


def test_what_a_fit_does_not_know_of_its_numbers_is_not_taken_for_a_room() -> None:
    """A run that begins warm, its drive a fifth stronger by the model than it was: what does not come of that is the drive's or the room's."""
    plant = native.Plant(1, 1)
    plant.set_all({"heat_capacity_j_per_k": 2.25, "loss_w_per_k": 0.0125, "command_power_w[1]": 1.2})
    run = one_run(20.0, 45.0)
    sure, unsure = (room.Rooms(20.0, errors=one) for one in ({}, {"command_power_w[1]": 0.2, "sensor_lag_s": 1.0}))
    value, sigma, _ = sure.told(run, plant)
    assert value < 17.0 and sigma < 2.5
    value, sigma, _ = unsure.told(run, plant)
    assert value == pytest.approx(20.0, abs=1.0) and sigma > 2.5


def test_a_run_that_began_warm_is_not_taken_for_one_at_rest() -> None:
    def nothing(part: Run, ambient_c: float, offset: np.ndarray) -> np.ndarray:
        """A plant that a room does not change: the first minute says nothing."""
        return part.temperature_c + offset

    warm, cold = one_run(20.0, 45.0, 0.0), one_run(22.0, 22.0, 0.0)
    value, sigma = room.of_run(warm, room.guessed(warm, 20.5, (0.5, 0.4)), nothing, 1.0 / 180.0)
    assert value == pytest.approx(20.5, abs=0.1) and sigma > 2.0
    value, sigma = room.of_run(cold, room.guessed(cold, 20.5, (0.0, 0.4)), nothing, 1.0 / 180.0)
    assert value == pytest.approx(22.0, abs=0.3) and sigma < 1.0


def test_rooms_that_were_alike_tell_more_than_what_a_run_begins_at() -> None:
    """They were so though their runs began as far apart as a board cools from run to run."""
    tells_nothing = native.Plant(1, 1)
    tells_nothing.set_all({"heat_capacity_j_per_k": 2.0, "loss_w_per_k": 1e-5})
    runs, next_one = [one_run(at, at, 0.0) for at in (25.0, 27.0, 30.0)], one_run(21.5, 21.5, 0.0)

    def told(*rooms: float) -> float:
        return room.Rooms.of(runs, rooms, tells_nothing).told(next_one, tells_nothing)[0]

    assert told(23.9, 24.0, 24.1) > 22.9
    assert told(20.0, 24.0, 28.0) < 22.0
    assert room.spread_k([24.0]) == pytest.approx(room.ROOMS_K), "of one room that is all that is known"


def test_a_run_whose_thermometers_are_apart_did_not_begin_as_those_at_rest() -> None:
    """Its coldest is no warmer than a room, and may yet have been driven: what the first minute says decides."""

    def told(apart_k: float) -> float:
        run = one_run(24.0, 24.0, 0.0)
        run = replace(run, temperature_c=np.column_stack([run.temperature_c, run.temperature_c + apart_k]))
        parts = [one.with_told(21.5, 1.0) for one in room.guessed(run, 20.5, (0.0, 0.3))]
        return room._moments(parts)[0]

    assert told(8.0) < 22.6 < 23.2 < told(0.5)


def test_runs_that_began_at_rest_say_that_another_does() -> None:
    runs = [one_run(at, at, 0.0) for at in (18.0, 21.0, 23.0)]
    over = room.over_first(runs, [18.1, 21.1, 23.1])
    assert over is not None and over[0] == pytest.approx(0.1, abs=0.06) and over[1] < 0.5
    assert room.over_first(runs[:1], [18.0]) is None


def test_weighing_is_whitening_with_its_slopes() -> None:
    rng = np.random.default_rng(7)
    time_s = np.cumsum(rng.uniform(0.5, 4.0, 60))
    mask = rng.random((60, 3)) < 0.9
    walks = [Rows.of(time_s, [0, 25], np.ones((60, 3), dtype=bool)), Rows.of(time_s, [0], mask)]
    vectors = [rng.standard_normal(walk.mask.sum()) for walk in walks]
    weighed = Weighed(walks, vectors)
    z = np.log([5.0, 2.0, 9.0, 0.5, 8.0, 900.0])
    size = np.exp(z)
    colour = Colour((size[0], size[1]), (size[2], size[3]), (size[4], size[5]))
    white = [walk.whitened(vector[:, None], colour) for walk, vector in zip(walks, vectors, strict=True)]
    loss, slope, squares = weighed.at(z)
    assert squares == pytest.approx(sum(float(np.vdot(one, one)) for one, _ in white), rel=1e-9)
    assert loss == pytest.approx(weighed.loss(squares, sum(one for _, one in white)), rel=1e-9)
    moved = [weighed.at(z + 1e-5 * one)[0] - weighed.at(z - 1e-5 * one)[0] for one in np.eye(6)]
    assert slope == pytest.approx(np.array(moved) / 2e-5, rel=1e-4, abs=1e-4)


@pytest.mark.parametrize("seed", range(6))
def test_the_likeliest_errors_are_found_on_whichever_hill_they_are(seed: int) -> None:
    """A flicker of seconds on what lasts for ten minutes, and all of it near the largest: one time constant fits half of each."""
    rng = np.random.default_rng([8, seed])
    rows, quick_s = 2500, (3.5, 20.0)[seed % 2]
    together = lasting(rng, rows, 1, 20.0, 650.0) + lasting(rng, rows, 1, 1.5, quick_s)
    apart = lasting(rng, rows, 2, 12.0, 650.0) + lasting(rng, rows, 2, 2.5, quick_s)
    readings = together + apart + rng.standard_normal((rows, 2))
    walk = Rows.of(np.arange(float(rows)), [0], np.ones((rows, 2), dtype=bool))
    _, nats = fitted([walk], [readings.ravel()])
    weighed = Weighed([walk], [readings.ravel()])
    truth = np.log([2.5**2, 144.0, 2.5**2 + 2 * 1.5**2, 144.0 + 800.0, quick_s, 650.0])
    assert nats > -weighed.at(truth)[0] - 0.5 * readings.size - 0.01


def test_a_run_that_was_heated_before_says_nothing_of_its_room() -> None:
    """It begins with its springs apart, far hotter than another does, or driven and steady."""
    cold = one_run(22.0, 22.0, 0.0)
    cold = replace(cold, temperature_c=np.column_stack([cold.temperature_c, cold.temperature_c]))
    apart, hot = (replace(cold, temperature_c=cold.temperature_c + up) for up in (np.array([0.0, 6.0]), 18.0))
    near = replace(cold, temperature_c=cold.temperature_c + np.array([0.8, 2.0]))
    runs = [cold, near, apart, hot, replace(cold, warm=True)]
    assert room.rested(runs) == [True, True, False, False, False]
    assert room.rested(runs[:1]) == [False], "one run alone may have begun as no other does"
    assert room.rested([cold, apart]) == [True, False], "it did not where the others began warmer"
    colder = replace(apart, temperature_c=apart.temperature_c - 3.0)
    assert room.rested([cold, colder]) == [False, False], "a room is no warmer than what is in it"
    assert room.over_first([cold, apart], [22.5, 10.0]) == pytest.approx((0.5, room.MOVES_K * math.sqrt(2.0)))
    assert room.rested([hot, replace(hot, temperature_c=hot.temperature_c + 1.0)]) == [False, False], (
        "no room is so hot"
    )
    assert room.over_first(runs, [22.1, 22.9, 10.0, 10.0, 10.0]) == pytest.approx((0.1, 0.3 * math.sqrt(1.5)), abs=0.01)


@pytest.mark.parametrize(("above_k", "rests"), [(5.0, True), (8.0, False)])
def test_a_thermometer_alone_is_together_with_itself_however_it_was_warmed(above_k: float, rests: bool) -> None:
    alone = [one_run(21.0, 21.0, 0.0), one_run(21.0 + above_k, 21.0 + above_k, 0.0)]
    both = [replace(one, temperature_c=np.column_stack([one.temperature_c, one.temperature_c])) for one in alone]
    assert room.rested(alone) == [True, rests]
    assert room.rested(both) == [True, True]


def test_how_far_above_its_room_a_run_begins_that_was_heated_before_is_its_own() -> None:
    """That others began so says little of one that begins at rest: it is not so much warmer than its room."""
    runs = [one_run(28.0, 28.0, 0.0), one_run(28.2, 28.2, 0.0)]
    assert room.over_first(runs, [26.0, 26.2]) == pytest.approx((-2.0, 2.0 * math.sqrt(1.5)), abs=0.05)
    assert room.over_first(runs, [30.0, 30.2]) == pytest.approx((2.0, 0.3 * math.sqrt(1.5)), abs=0.05)


def test_a_fit_looks_for_a_room_where_its_run_began_or_where_others_were() -> None:
    runs = [one_run(at, at, 0.0) for at in (18.0, 24.0, 45.0)]
    bounds = room.believed(runs)
    assert bounds[:2] == [pytest.approx((at - 2.0, at + 2.0), abs=0.01) for at in (18.0, 24.0)]
    assert bounds[2] == pytest.approx((12.0, 30.0), abs=0.01)
    assert room.believed(runs[:1]) == [(-math.inf, pytest.approx(18.0 + room.TOGETHER_K, abs=0.01))]


def test_a_room_that_was_beside_its_log_is_so_in_another_run() -> None:
    fitted_k = {"ambient_offset_k@1": 2.9, "ambient_offset_k@2": 3.1, "run_sensor_offset_k@1": 0.5, "ambient_c@3": 20.0}
    assert room.over_logged_k(fitted_k, {}) == pytest.approx(3.5, rel=0.01)
    assert room.over_logged_k({"ambient_c@1": 20.0}, {}) is None
    model = Model(Array(1, 1))
    model.provenance = {"room_over_logged_k": 2.5, "room_over_logged_s": 3600.0}
    run = replace(one_run(23.0, 23.0), ambient_c=np.full(120, 20.0))
    there = in_its_room(model, run)
    assert there.ambient_c is not None and there.ambient_c == pytest.approx(22.5)
    assert there.notes[-1].endswith("it was in what the model was fitted to") and in_its_room(model, there) is there
    assert "2.5 K warmer than ambient_c" in there.notes[-1] and in_its_room(Model(Array(1, 1)), run) is run


def test_of_a_room_beside_its_log_no_more_is_carried_than_runs_agree_on_and_readings_fix() -> None:
    def carried(values: list[float], error_k: float = 0.0) -> float | None:
        named = {f"ambient_offset_k@{r + 1}": value for r, value in enumerate(values)}
        return room.over_logged_k(named, dict.fromkeys(named, error_k))

    assert carried([3.0, 3.0, 3.0]) == pytest.approx(3.0)
    assert carried([2.0, 4.0, 3.0]) == pytest.approx(3.0 * 9.0 / (9.0 + 1.0 / 3.0))
    assert carried([3.0, -2.0, 1.0]) is None, "they do not agree"
    assert carried([3.0], 0.5) == pytest.approx(3.0 * 9.0 / 9.25) and carried([3.0], 3.5) is None
    assert room.over_logged_k({"ambient_offset_k": 3.0}, {"ambient_offset_k": math.inf}) is None, "nothing shows it"


def test_a_room_beside_its_log_in_short_runs_is_not_so_for_good() -> None:
    """Runs of two minutes beside a plate that takes ten to be as warm as its room; a run that goes on for as long as that."""
    model = Model(Array(1, 1))
    model.effects = ["plate_conduction"]
    model.parameters = {"loss_w_per_k": 0.003, "heat_capacity_j_per_k": 0.3, "plate_loss_w_per_k": 0.0}
    model.parameters["plate_heat_capacity_j_per_k"] = 1.5
    model.provenance = {"room_over_logged_k": 3.0, "room_over_logged_s": 120.0}
    run = one_run(23.0, 23.0)
    run = replace(run, time_s=np.arange(120.0) * 5.0, ambient_c=np.full(120, 20.0))
    there = in_its_room(model, run)
    assert there.ambient_c is not None
    beside_k = there.ambient_c - 20.0
    assert beside_k[run.time_s <= 120.0] == pytest.approx(3.0), "for as long as it was seen it is the same"
    seen = 1.0 - math.exp(-120.0 / 600.0)
    assert beside_k[-1] == pytest.approx(3.0 * (seen + (1.0 - seen) * 120.0 / 595.0))
    assert "at the end, as those runs took 120 s" in there.notes[-1]
    model.provenance["room_over_logged_s"] = 3600.0
    there = in_its_room(model, run)
    assert there.ambient_c is not None and there.ambient_c == pytest.approx(23.0), "they were long enough to settle"


def test_what_a_room_explains_is_taken_out_as_far_as_it_is_unknown() -> None:
    moves, other = 1.0 - np.exp(-np.arange(600.0) / 200.0), 0.2 * np.sin(np.arange(600.0) / 10.0)
    off = 2.0 * moves + other
    assert room.without(off, moves, 3.0, 10.0) == pytest.approx(other, abs=0.05)
    assert room.without(off, moves, 0.01, 10.0) == pytest.approx(off, abs=0.05)
    assert room.without(other, 0.0 * moves, 3.0, 10.0) == pytest.approx(other)
