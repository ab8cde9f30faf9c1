"""How a run began, as far as nobody logged it: what is around springs that were hot, and what phase they are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from ninespring.find import doubt, unseen
from ninespring.find.diagnosis import fit_effects
from ninespring.infer import predict as prediction
from ninespring.infer import room
from ninespring.infer.problem import Problem
from ninespring.infer.scene import scene_of
from ninespring.io.logs import log_text, read_log
from ninespring.io.logs.run import Run
from ninespring.model import effects, native
from ninespring.model.models import Array, Model
from ninespring.model.simulate import settles_s, simulate_run
from plants import a_plant

ROWS, ROOM_C, HELD_W = 900, 20.0, 0.35
PLATE = {"plate_coupling_w_per_k": 0.004, "plate_heat_capacity_j_per_k": 40.0, "plate_loss_w_per_k": 0.02}


def cooling(around: dict[str, dict[str, float]]) -> tuple[Model, Run]:
    """Return two springs that were held hot for long and cool as their log begins, one of them driven again later."""
    model = Model(Array(1, 2))
    model.effects = list(around)
    model.parameters = {name: one for each in around.values() for name, one in each.items()} | {"ambient_c": ROOM_C}
    plant = prediction.plant_of(model)
    plant.reset()
    for k in range(2):
        plant.drive(k, native.POWER, HELD_W)
    plant.settle(1e6)
    drive = np.zeros((ROWS, 2))
    drive[400:700, 0] = HELD_W
    time_s = np.arange(float(len(drive)))
    shown = plant.simulate(time_s, native.POWER, drive, np.zeros(len(drive)), np.full(len(drive), ROOM_C))
    return model, Run("run", "", time_s, "power", drive, shown, np.zeros(ROWS), np.full(ROWS, ROOM_C))


def beside_cold(model: Model, run: Run) -> np.ndarray:
    """Return what a run's springs would show with no heat around them as it begins, (rows, springs)."""
    plant = prediction.plant_of(model)
    plant.reset()
    plant.start_from_measured(run.temperature_c[0])
    return plant.simulate(run.time_s, native.POWER, run.drive, run.fan, run.ambient_c)


@pytest.mark.parametrize(
    "around",
    [
        {"shared_air": {"air_heat_capacity_j_per_k": 40.0, "air_exchange_w_per_k": 0.02}},
        {"plate_conduction": PLATE},
        {"holder_mass": {"holder_coupling_w_per_k": 0.004, "holder_heat_capacity_j_per_k": 2.0}},
    ],
    ids=["air", "plate", "holders"],
)
def test_what_is_around_springs_that_begin_hot_is_warm(around: dict[str, dict[str, float]]) -> None:
    model, run = cooling(around)
    assert np.abs(run.temperature_c - prediction.predict(model, run)).max() < 0.05
    # with no heat around them at first they would be colder for minutes
    assert np.abs(run.temperature_c - beside_cold(model, run)).max() > 1.5


def test_holders_keep_an_array_warm_for_as_long_as_they_hold_heat() -> None:
    model = Model(Array(1, 2))
    model.parameters = {"loss_w_per_k": 0.006}
    plain_s = settles_s(prediction.plant_of(model), 2)
    model.effects = ["holder_mass"]
    model.parameters |= {"holder_heat_capacity_j_per_k": 0.6}
    assert settles_s(prediction.plant_of(model), 2) == pytest.approx(plain_s + 0.6 / 0.006)


@pytest.mark.parametrize(
    ("effect", "kept"),
    [
        ("shared_air", {"air_heat_capacity_j_per_k": 1e4, "air_exchange_w_per_k": 1e-4}),
        (
            "plate_conduction",
            PLATE | {"plate_coupling_w_per_k": 1e-3, "plate_heat_capacity_j_per_k": 2e3, "plate_loss_w_per_k": 1e-5},
        ),
    ],
    ids=["air", "plate"],
)
def test_what_holds_heat_for_weeks_is_in_balance_with_springs_that_begin_hot(
    effect: str, kept: dict[str, float]
) -> None:
    """A fit may take a box or a plate for one that loses next to nothing: to run it to its balance took a minute a fit, and it had not
    come there after twelve days."""
    model, run = cooling({"shared_air": {"air_heat_capacity_j_per_k": 40.0, "air_exchange_w_per_k": 1.0}})
    model.effects = [effect]
    model.parameters = {"ambient_c": ROOM_C} | kept
    plant = prediction.plant_of(model)
    begun_c = run.temperature_c[0] - ROOM_C
    shown = simulate_run(plant.copy(), run, run.ambient_c)[:400] - ROOM_C
    if effect == "shared_air":  # which is as warm as they are, and all that they lose heat to
        assert np.abs(shown - begun_c).max() < 0.02 * begun_c.max()
    else:  # and they come to rest where it keeps them, against the room
        lost, led = plant.get("loss_w_per_k"), kept["plate_coupling_w_per_k"]
        rest = begun_c.mean() * led / (led + lost)
        assert shown[-1] == pytest.approx([rest, rest], rel=0.02)


FULL_W = 0.9
MARTENSITE_OHM, AUSTENITE_OHM = 0.175, 0.219
FROM_S = 20
ROW = np.arange(900)


def cut(path: Path, full_s: int, after_w: float, keep: np.ndarray, with_ohm: bool = True) -> float:
    """Return how far a prediction is off at worst where a log is what is kept of a wire's that is heated so long, then less, later again."""
    model = Model(Array(1, 1))
    model.effects = ["latent_heat", "resistance_phase"]
    model.parameters = {"latent_heat_j": 8.0, "ambient_c": ROOM_C}
    power = np.where(
        (ROW >= FROM_S) & (full_s + FROM_S > ROW) | (ROW >= 600), FULL_W, np.where(ROW < FROM_S, 0.0, after_w)
    )
    plant = prediction.plant_of(model)
    plant.reset()
    air = np.full(len(ROW), ROOM_C)
    traced = plant.trace(ROW * 1.0, native.POWER, power[:, None], np.zeros(len(ROW)), air)[:, 0]
    ohm = MARTENSITE_OHM + traced[:, 1] * (AUSTENITE_OHM - MARTENSITE_OHM)
    current = np.sqrt(power / ohm)
    columns = {"i1_a": current} | ({"v1_v": current * ohm} if with_ohm else {})
    columns |= {"t1_c": traced[:, 0] + np.random.default_rng(1).normal(0.0, 0.05, len(ROW)), "ambient_c": air}
    path.write_text(log_text(1.0 * ROW[keep], {name: one[keep] for name, one in columns.items()}))
    return float(np.abs(prediction.predict(model, read_log(path, 1)) - traced[keep, :1]).max())


@pytest.mark.parametrize(
    ("full_s", "after_w", "keep"),
    [
        pytest.param(60, 0.0, ROW >= 100, id="cools from austenite"),
        pytest.param(60, 0.2, ROW >= 120, id="is driven too little to stay austenite"),
        pytest.param(60, 0.0, (ROW < 10) | (ROW >= 100), id="cools after a gap in which it was hot"),
        pytest.param(31, 0.2, ROW >= 53, id="falls back before it transforms: v and i say so"),
        pytest.param(60, 0.2, ROW >= 60, id="is being heated"),
        pytest.param(33, 0.0, (ROW < 54) | (ROW >= 70), id="was cold enough before the gap"),
    ],
)
def test_a_spring_begins_on_the_branch_that_it_comes_from(
    tmp_path: Path, full_s: int, after_w: float, keep: np.ndarray
) -> None:
    assert cut(tmp_path / "cut.csv", full_s, after_w, keep) < 1.0


@pytest.mark.parametrize(
    ("full_s", "from_s"), [(60, 100), (32, 46)], ids=["nothing drives it", "it is heated, and soon no more"]
)
def test_a_spring_begins_on_its_branch_without_v_and_i_too(tmp_path: Path, full_s: int, from_s: int) -> None:
    assert cut(tmp_path / "cut.csv", full_s, 0.0, from_s <= ROW, with_ohm=False) < 1.0


def test_what_is_tried_on_the_way_to_a_start_leaves_no_phase() -> None:
    """A thermometer that shows too much: where it seems to be the spring would be austenite."""
    plant = a_plant((1, 1), {"sensor_gain": {"sensor_gain": 1.3}})
    plant.start_from_measured(np.array([104.0]))
    assert plant.measured_c()[0] == pytest.approx(104.0, abs=0.001)
    assert plant.austenite()[0] == 0.0


def test_a_log_alone_that_begins_at_rest_begins_at_its_room_whatever_its_model_lacks() -> None:
    """Free, its room stands in for the latent heat that is not declared: 34 degC."""
    time_s = np.arange(200.0)
    drive = np.where((time_s >= 20.0) & (time_s < 50.0) | (time_s > 60.0), FULL_W, 0.0)[:, None]
    plant = a_plant((1, 1), {"latent_heat": {"latent_heat_j": 8.0}}, {"ambient_c": ROOM_C})
    shown = plant.simulate(time_s, native.POWER, drive, np.zeros(200), np.full(200, ROOM_C))
    shown += np.random.default_rng(1).normal(0.0, 0.1, shown.shape)
    run = Run("run", "", time_s, "power", drive, shown, np.zeros(200), None)
    assert fit_effects(Array(1, 1), [run], [])[1].value("ambient_c@1") == pytest.approx(ROOM_C, abs=1.0)


def alike(start_c: float, seed: int, heats: bool = True) -> Run:
    """Return two springs that begin together, nothing driven for two minutes, in a room that nobody logged."""
    rng = np.random.default_rng(seed)
    rows = 600
    drive = np.zeros((rows, 2))
    for k in range(2):
        for at in range(120 + 20 * k, rows if heats else 0, 90):
            drive[at : at + int(rng.integers(30, 80)), k] = rng.uniform(0.2, 0.4)
    plant = native.Plant(1, 2)
    plant.set_all({"loss_w_per_k": 0.006, "orthogonal_w_per_k": 0.0006})
    plant.set_ambient(ROOM_C)
    plant.reset()
    for k in range(2):
        plant.set_temperature(k, start_c)
    time_s = np.arange(float(rows))
    shown = plant.simulate(time_s, native.POWER, drive, np.zeros(rows), np.full(rows, ROOM_C))
    return Run("run", "", time_s, "power", drive, shown + rng.normal(0.0, 0.1, shown.shape), np.zeros(rows), None)


def test_runs_that_begin_warm_and_cool_are_in_the_room_to_which_they_do() -> None:
    """All springs alike, and below 35 degC, as at rest: their first minutes' means were taken for rooms of 25 degC."""
    _, found, _ = fit_effects(Array(1, 2), [alike(33.0, 1), alike(32.0, 2)], [])
    assert [found.value(f"ambient_c@{r}") for r in (1, 2)] == pytest.approx([ROOM_C, ROOM_C], abs=0.1)
    assert found.value("loss_w_per_k") == pytest.approx(0.006, rel=0.02)


def test_a_room_is_looked_for_no_higher_than_a_thermometer_falls() -> None:
    warm, rests = alike(33.0, 1), alike(ROOM_C, 2)
    for bound in room.believed([warm, warm]):
        assert bound[0] == -np.inf and ROOM_C + 2.0 < bound[1] < ROOM_C + 2.0 * room.TOGETHER_K
    colder = replace(warm, temperature_c=warm.temperature_c - 8.0)
    assert room.believed([rests, rests, colder])[2][1] < ROOM_C, "colder than the others' rooms say"


@pytest.mark.parametrize(
    ("change", "moves"),
    [
        (lambda s: 0.0 * s, False),
        (lambda s: -0.3 * s / 60.0, False),
        (lambda s: -1.5 * s / 60.0, True),
        (lambda s: 1.5 * s / 60.0, True),
        (lambda s: np.where(s > 300.0, -5.0, 0.0), True),
        (lambda s: np.where(s > 300.0, -3.0, 0.0), False),
    ],
    ids=["rests", "as its room", "falls", "rises", "falls later", "as a room in that time"],
)
def test_a_run_is_at_rest_where_it_moves_no_faster_than_noise_and_rooms(
    change: Callable[[np.ndarray], np.ndarray], moves: bool
) -> None:
    run = alike(ROOM_C, 3, heats=False)
    one = replace(run, temperature_c=run.temperature_c + change(run.time_s)[:, None])
    assert room.moves(one) is moves
    assert room.rested([one, one]) == [not moves] * 2
    assert (room.rests_alone([one]) is None) is moves
    assert (room.above_logged(replace(one, ambient_c=np.full(len(run.time_s), ROOM_C))) is None) is moves


def test_one_thermometer_of_three_that_comes_loose_is_no_run_that_cools() -> None:
    run = alike(ROOM_C, 3, heats=False)
    three = np.column_stack([run.temperature_c, run.temperature_c[:, 0] - np.where(run.time_s > 30.0, 9.0, 0.0)])
    assert not room.moves(replace(run, temperature_c=three, drive=run.drive[:, [0, 1, 1]]))


def test_a_run_that_cools_in_its_first_minute_is_not_told_to_begin_as_those_at_rest() -> None:
    over = (0.0, 0.3)
    assert len(room.guessed(alike(ROOM_C, 1), ROOM_C, over)) == 2
    (one,) = room.guessed(alike(28.0, 1), ROOM_C, over)
    assert (one.room_c, one.sigma_k) == (ROOM_C, room.ROOMS_K)


def test_where_others_were_warmed_together_a_run_as_warm_is_not_at_rest() -> None:
    """That it hardly moves in the seconds before it is driven says little: rooms of two days are not so far apart."""
    warm, short = alike(32.0, 1), alike(32.0, 2)
    short.drive[3:] = 0.3
    short.temperature_c[:] = 32.0 + np.random.default_rng(1).normal(0.0, 0.1, short.temperature_c.shape)
    assert room.rested([short, short]) == [True, True]
    assert room.rested([warm, short]) == [False, False]


def test_what_is_around_springs_that_were_warmed_shortly_before_is_told_by_the_run() -> None:
    """A minute of heat warms no plate: one as warm as beside springs held so for long is not what the readings show."""
    model, run = cooling({"plate_conduction": PLATE})
    shown = beside_cold(model, run)
    rng = np.random.default_rng(1)
    fresh = replace(run, temperature_c=shown + rng.normal(0.0, 0.05, shown.shape))
    soaked = replace(run, temperature_c=run.temperature_c + rng.normal(0.0, 0.05, shown.shape))
    _, found, _ = fit_effects(Array(1, 2), [fresh, soaked], ["plate_conduction"])
    assert found.value("around_share@1") < 0.1 and found.value("around_share@2") > 0.9
    assert np.sqrt(found.sse / found.count) < 1.1
    model.provenance = {"around_share": 0.0}
    assert np.abs(shown - prediction.predict(model, replace(run, temperature_c=shown))).max() < 0.05
    cold = replace(run, temperature_c=np.where(run.time_s < 1.0, ROOM_C, run.temperature_c.T).T)
    assert not any(
        "around" in f.key for c in effects.candidates(scene_of(Problem(Array(1, 2), [cold]))) for f in c.free
    )


def test_how_warm_it_is_around_springs_of_another_run_is_told_by_its_first_minute() -> None:
    """Of springs that begin warm others say little: one beside what is cold loses more at once. A run left out is judged so, too."""
    model, soaked = cooling({"plate_conduction": PLATE})
    fresh = replace(soaked, temperature_c=beside_cold(model, soaked))
    for others, run in ((1.0, fresh), (0.0, soaked)):
        model.provenance = {"around_share": others}
        assert np.abs(run.temperature_c - prediction.predict(model, run)).max() < 0.2
        unlogged = replace(run, ambient_c=None)
        assert np.abs(run.temperature_c - prediction.predict(model, unlogged)).max() < 1.0
    rng = np.random.default_rng(1)
    runs = [
        replace(one, temperature_c=one.temperature_c + rng.normal(0.0, 0.05, one.drive.shape))
        for one in (fresh, soaked)
    ]
    problem, found, _ = fit_effects(Array(1, 2), runs, ["plate_conduction"])
    for split in unseen.splits(problem):
        off, judged = unseen.errors(split, found, None)
        assert np.sqrt(np.mean(off**2)) < 0.2 and np.array_equal(off, judged)


def test_a_room_that_would_lie_beyond_where_its_run_began_is_said() -> None:
    """Thermometers that begin at rest and then show what no room of theirs explains."""
    off = [alike(ROOM_C, seed) for seed in (1, 2)]
    for run in off:
        run.temperature_c[61:] -= 2.4
    problem, found, _ = fit_effects(Array(1, 2), off, [])
    said = doubt.of_rooms(problem, found)
    assert len(said) == 2 and "log ambient_c" in said[0] and "18.0 degC" in said[0]
    assert set(said) <= {*doubt.model_of_fit(problem, found, off)[1]}
    problem, found, _ = fit_effects(Array(1, 2), [alike(ROOM_C, seed) for seed in (1, 2)], [])
    assert doubt.of_rooms(problem, found) == []
