"""The search: what is a candidate, what is preferred to what, what a forecast may promise, what is unexplained."""

from __future__ import annotations

import copy
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from command import ended
from made import searched
from ninespring.errors import InputError
from ninespring.find import diagnosis, evidence, experiments, residual, search
from ninespring.find.plan import plan_experiment
from ninespring.infer import budget, room
from ninespring.infer.declared import base_spec
from ninespring.infer.fit import Fit
from ninespring.infer.predict import predict
from ninespring.infer.problem import Problem
from ninespring.infer.scene import scene_of
from ninespring.io import results
from ninespring.io.logs import log_text, read_log
from ninespring.io.logs.run import Run
from ninespring.io.recording import script_lines
from ninespring.model import effects, native
from ninespring.model.models import Array, Model, model_text, read_model
from ninespring.model.spec import Spec
from plants import a_plant, columns_of, levels


def commanded(path: Path, on: dict[str, dict[str, float]], seed: int = 0, all_or_none: bool = False) -> Path:
    """Write a 1 x 2 log of 600 s at 1 Hz where only the command is known, as two heaters on an Arduino give it."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(600.0)
    drive = levels(rng)
    if all_or_none:
        drive = np.where(drive > 0.0, 1.0, 0.0)
    numbers = {"heat_capacity_j_per_k": 2.0, "loss_w_per_k": 0.012, "orthogonal_w_per_k": 0.004}
    second_w = 0.8 if all_or_none else 0.4
    plant = a_plant((1, 2), on, numbers | {"command_power_w[1]": 0.8, "command_power_w[2]": second_w})
    shown = plant.simulate(time_s, native.COMMAND, drive) + rng.normal(0.0, 0.05, (600, 2))
    path.write_text(log_text(time_s, columns_of(u=drive, t=shown) | {"ambient_c": np.full(600, 20.0)}))
    return path


def heaters() -> Model:
    """Return what is declared of the two heaters."""
    model = Model(Array(1, 2))
    model.parameters = {"heat_capacity_j_per_k": 2.0, "loss_w_per_k": 0.01, "command_power_w": 0.6}
    return model


def pulsed(path: Path) -> Run:
    """Return a single pulse, command only: a broad alloy that nobody declared, a late thermometer, a room 3.9 K below its logged one."""
    rng = np.random.default_rng(4)
    time_s = np.arange(0.0, 300.0, 0.5)
    drive = 0.1 * np.exp(-0.5 * ((time_s - 21.0) / 5.5) ** 2)
    drive[drive < 0.004] = 0.0
    numbers = {"heat_capacity_j_per_k": 0.298, "loss_w_per_k": 0.007, "latent_heat_j": 7.0, "sensor_lag_s": 4.0}
    numbers |= {"austenite_start_c": 36.3, "austenite_finish_c": 50.0, "command_power_w[1]": 15.7}
    numbers |= {"martensite_start_c": 35.5, "martensite_finish_c": 25.3, "ambient_c": 20.6}
    plant = a_plant((1, 1), ["latent_heat", "sensor_lag"], numbers)
    shown = plant.simulate(time_s, native.COMMAND, drive[:, None], ambient_c=np.full(600, 20.6))
    shown += rng.normal(0.0, 0.1, shown.shape)
    path.write_text(log_text(time_s, {"u1": drive, "t1_c": shown[:, 0], "ambient_c": np.full(600, 24.5)}))
    return read_log(path, 1)


def searched_pulse(path: Path) -> search.Search:
    """Return a search on a pulse, its alloy declared roughly."""
    declared = {"command_power_w": 10.0, "austenite_start_c": 48.0, "austenite_finish_c": 58.0}
    problem = Problem(Array(1, 1), [pulsed(path)], declared | {"martensite_start_c": 42.0, "martensite_finish_c": 32.0})
    scene = scene_of(problem)
    base = diagnosis.first_fit(problem, base_spec(problem))
    return search.Search(problem, [*effects.candidates(scene), *effects.of_runs(scene)], base)


def with_one_after_the_other(found: search.Search, *names: str) -> Fit:
    """Return the fit with effects added one after the other, an alloy as it is found."""
    fit = found.base
    for name in names:
        screen = found.screen(fit)
        k = max(k for k, one in enumerate(screen.candidates) if one.effect == name)
        fit = found.refit(fit, [screen.candidates[k]], [screen.forecast([k])[1].get(k, 1.0)])
    return fit


def test_what_was_fitted_on_the_way_is_a_rival_however_many_promised_more(make_log) -> None:
    """A power law for what radiates: five promised more along a line, and nothing was said of it, 5 nats behind what was called certain."""
    found = searched(read_log(make_log(effects={"radiation": {"emissivity": 0.9}})))
    radiation = with_one_after_the_other(found, "radiation")
    assert found.rivals(radiation, {"radiation": found.base}, most=0) == []
    air = with_one_after_the_other(found, "natural_convection")
    assert found.rivals(radiation, {"radiation": found.base}, most=0) == [("radiation", air)]


def test_quick_heaters_with_slow_thermometers_are_not_taken_for_slow_ones_that_a_camera_sees(tmp_path: Path) -> None:
    """What heats a neighbour is as quick as the heaters are: the readings follow together, as if each were a mean of both."""
    time_s, drive = 2.0 * np.arange(600.0), levels(np.random.default_rng(3))
    numbers = {"heat_capacity_j_per_k": 2.0, "loss_w_per_k": 0.1, "orthogonal_w_per_k": 0.02, "sensor_lag_s": 140.0}
    numbers |= {"command_power_w[1]": 7.0, "command_power_w[2]": 3.5}
    plant = a_plant((1, 2), ["sensor_lag"], numbers)
    shown = plant.simulate(time_s, native.COMMAND, drive) + np.random.default_rng(4).normal(0.0, 0.1, (600, 2))
    (tmp_path / "log.csv").write_text(log_text(time_s, columns_of(u=drive, t=shown)))
    found = diagnosis.diagnose(Array(1, 2), [read_log(tmp_path / "log.csv", 2)], model=heaters())
    (one,) = found.result["effects"]
    assert one["name"] == "sensor_lag" and one["parameters"]["sensor_lag_s"]["value"] == pytest.approx(140.0, rel=0.03)


def test_a_fit_begins_with_a_model_that_is_given(tmp_path: Path) -> None:
    log, declared = commanded(tmp_path / "log.csv", {"sensor_lag": {"sensor_lag_s": 20.0}}), heaters()
    declared.effects = ["sensor_lag"]
    (tmp_path / "declared.toml").write_text(model_text(declared))
    words = "fit", "--model", tmp_path / "declared.toml", log, "-o", tmp_path / "model.toml"
    assert ended(*words)[0] == 0
    fitted = read_model(tmp_path / "model.toml")
    assert fitted.effects == ["sensor_lag"] and fitted.parameters["heat_capacity_j_per_k"] == 2.0
    assert fitted.parameters["sensor_lag_s"] == pytest.approx(20.0, rel=0.05)


def test_an_alloy_that_went_astray_before_its_company_came_begins_again_beside_it(tmp_path: Path) -> None:
    found = searched_pulse(tmp_path / "pulse.csv")
    # a room that drifts quicker than any does: without it the alloy goes astray here
    found.candidates = [
        replace(one, free=(replace(one.free[0], low=-60.0, high=60.0),)) if one.variant == "ramp" else one
        for one in found.candidates
    ]
    astray = with_one_after_the_other(found, "latent_heat", "ambient_drift")
    again = found.begun_again(astray, found.base)
    assert again.spec.effects != () and set(again.spec.effects) == set(astray.spec.effects)
    assert again.chi2 < 0.7 * astray.chi2
    assert found.fits[found.key(again.spec)] is again


def test_an_alloy_is_found_from_far_off_though_what_comes_later_is_still_missing(tmp_path: Path) -> None:
    """What is believed of it stands against readings that are off by kelvins for minutes: it does not bend to what its company explains."""
    found = searched_pulse(tmp_path / "pulse.csv")
    astray = with_one_after_the_other(found, "sensor_lag", "latent_heat")
    far = astray.as_dict() | {"latent_heat_j": 10.8, "alloy_shift_k": -31.0, "heating_width_change_k": 28.0}
    assert found.problem.fit(astray.spec, far).chi2 == pytest.approx(astray.chi2, rel=0.05)
    assert astray.chi2 > 50.0 * astray.count and astray.at_bounds() == []
    true = with_one_after_the_other(found, "sensor_lag", "latent_heat", "run_ambient_offset")
    assert true.chi2 < 1.2 * true.count, "what it did not bend to, it explains"
    assert true.value("latent_heat_j") == pytest.approx(7.0, rel=0.05)
    assert true.value("sensor_lag_s") == pytest.approx(4.0, rel=0.05)
    assert true.firm < 2.0 < 50.0 < astray.firm


def test_blocks_in_which_a_drive_is_whole_do_not_speak_against_what_only_they_tell(tmp_path: Path) -> None:
    found = searched_pulse(tmp_path / "pulse.csv")
    true = with_one_after_the_other(found, "sensor_lag", "latent_heat", "run_ambient_offset")
    assert true.value("ambient_offset_k@1") == pytest.approx(-3.9, abs=0.5)
    assert found.problem.holdout_rmse(true) < 0.2 < 1.0 < found.problem.holdout_rmse(found.base)
    assert found.holds_out(true, found.base)


def test_the_room_of_the_only_run_is_believed_where_its_spring_rests(tmp_path: Path) -> None:
    found = searched_pulse(tmp_path / "pulse.csv")
    run = found.problem.runs[0]
    (one,) = [free for c in found.candidates if c.effect == "run_ambient_offset" for free in c.free]
    assert one.start == pytest.approx(-3.9, abs=0.1) and one.trust == 1.0
    there = with_one_after_the_other(found, "sensor_lag", "latent_heat", "run_ambient_offset")
    without = found.reduced(there, "run_ambient_offset")
    price = 0.5 * np.log(there.count)
    said = evidence.relief(there, without) + price
    assert said == pytest.approx(evidence.strain(without, there) - evidence.strain(there, without))
    assert said == pytest.approx(0.5 * 3.9**2, abs=1.5), "that it rests beside the logged room speaks against that"
    # nothing is said where it began warm, was nowhere near, or where there is nothing to be beside
    for other in (
        replace(run, warm=True),
        replace(run, ambient_c=None),
        replace(run, ambient_c=run.ambient_c - 20.0),
        replace(run, temperature_c=run.temperature_c + 15.0, ambient_c=run.ambient_c + 15.0),
    ):
        assert room.above_logged(other) is None
    several = replace(scene_of(found.problem), runs=2)
    assert all(free.start == 0.0 for c in effects.of_runs(several) for free in c.free if "ambient" in free.key)


def test_where_the_room_of_the_only_run_is_bends_nothing(tmp_path: Path) -> None:
    """It is one number, and stands beside any other in what only helps together."""
    found = searched_pulse(tmp_path / "pulse.csv")
    fit = with_one_after_the_other(found, "run_ambient_offset")
    assert not found.is_flexible(fit, "run_ambient_offset")
    assert found.handicap(fit, found.base) == 0.0
    two = [one for one in found.candidates if one.effect == "run_ambient_offset"]
    drift = [one for one in found.candidates if one.effect == "ambient_drift" and one.flexible]
    assert len(two) == 1 and not two[0].flexible and all(len(one.free) > 1 for one in drift)


def test_what_is_better_and_fitted_takes_its_place_though_nothing_further_may_be_begun() -> None:
    one, better = (Fit(Spec((name,)), np.array([]), chi2, 1, []) for name, chi2 in (("one", 2.0), ("better", 1.0)))

    class Ended(search.Search):
        def goes_on(self) -> bool:
            return False

        def backward(self, fit: Fit, share: float = 0.0) -> tuple[Fit, dict[str, Fit]]:
            return fit, {fit.spec.effects[0]: one}

        def rivals(self, fit: Fit, without: dict[str, Fit], most: int = 3) -> list[tuple[str, Fit]]:
            return [("one", better)] if fit is one else []

        def preferred(self, fit: Fit, other: Fit) -> bool:
            return fit is better

    problem = SimpleNamespace(budget=budget.Budget())
    found, without, contenders = Ended(problem, [], one).settle(one, grow=False)  # type: ignore[arg-type]
    assert found is better and without == {"better": one} and not contenders


def test_what_took_a_place_and_did_not_stay_there_gives_it_back() -> None:
    one, other, bare = (
        Fit(Spec(names, variant=tuple((name, "") for name in names)), np.array([]), 1.0, 1, [])
        for names in (("one",), ("other",), ())
    )

    class Swapped(search.Search):
        def backward(self, fit: Fit, share: float = 0.0) -> tuple[Fit, dict[str, Fit]]:
            return (bare, {}) if fit is other else (fit, {"one": bare})

        def rivals(self, fit: Fit, without: dict[str, Fit], most: int = 3) -> list[tuple[str, Fit]]:
            return [("one", other)] if fit is one else []

        def preferred(self, fit: Fit, instead: Fit) -> bool:
            return fit is other

    found = Swapped(SimpleNamespace(budget=budget.Budget()), [], bare).settle(one, grow=False)  # type: ignore[arg-type]
    assert found == (one, {"one": bare}, [("one", other)])


@pytest.mark.parametrize(("beyond", "width"), [(0.0, 0.9), (1.0, 0.1)])
def test_a_camera_that_sees_the_surroundings_beyond_the_array_makes_no_edge_loss(
    make_log, beyond: float, width: float
) -> None:
    camera = {"optical_share": 0.2, "optical_width": width, "optical_beyond": beyond}
    found = diagnosis.diagnose(Array(), [read_log(make_log(effects={"optical_mixing": camera}), 9)])
    (one,) = found.result["effects"]
    assert one["name"] == "optical_mixing" and one["certainty"] == "certain"
    assert ("room beyond" in one["text"]) == (beyond > 0)
    assert found.model.parameters["optical_beyond"] == pytest.approx(beyond, abs=0.1)
    assert found.model.parameters["optical_share"] == pytest.approx(0.2, rel=0.1)
    assert found.result["unexplained"] is False


@pytest.mark.parametrize(
    ("declared", "logged", "seen"),
    [
        ("", "", True),
        ("camera", "", True),
        ("thermocouple", "", False),
        ("", "semiconductor", False),
        ("camera", "semiconductor", True),
        ("", "a good one", True),
    ],
)
def test_what_touches_a_spring_sees_no_other(tmp_path: Path, declared: str, logged: str, seen: bool) -> None:
    path = commanded(tmp_path / "log.csv", {})
    path.write_text(f"# sensor: {logged}\n" + path.read_text())
    array = Array(1, 2, sensor={"kind": declared} if declared else {})
    assert ("optical_mixing" in names_of(Problem(array, [read_log(path, 2)]))) == seen


def test_a_blur_over_more_than_the_nearest_is_found_as_it_is(make_log) -> None:
    camera = {"optical_share": 0.6, "optical_width": 1.2, "optical_shape": 1.0}
    found = diagnosis.diagnose(Array(), [read_log(make_log(effects={"optical_mixing": camera}), 9)])
    (one,) = found.result["effects"]
    assert one["name"] == "optical_mixing" and found.result["unexplained"] is False
    # share and width of a long tail can stand for one another: what a spring sees of the next does not move
    sees = []
    for numbers in (camera, found.model.parameters):
        own = {key: value for key, value in numbers.items() if key.startswith("optical_")}
        plant = a_plant((3, 3), {"optical_mixing": own})
        plant.set_temperature(4, 120.0)
        sees.append(plant.measured_c() - 20.0)
    true, fitted = sees
    assert fitted[1] / fitted[4] == pytest.approx(true[1] / true[4], rel=0.1)
    assert fitted[0] / fitted[4] == pytest.approx(true[0] / true[4], rel=0.1)


@pytest.mark.parametrize("share", [0.3, 0.735])
def test_what_half_a_fan_gives_is_found_where_it_blew_at_half(make_log, share: float) -> None:
    log = make_log(effects={"fan_curve": {"fan_half_share": share}}, seconds=900, half=True)
    found = diagnosis.diagnose(Array(), [read_log(log, 9)])
    (one,) = found.result["effects"]
    assert one["name"] == "fan_curve" and one["certainty"] == "certain" and one["on_chip"]
    number = one["parameters"]["fan_half_share"]
    assert abs(number["value"] - share) < 3 * number["stderr"] < 0.06
    assert found.result["unexplained"] is False


def test_no_fan_curve_is_named_where_there_is_none_or_nothing_shows_it(make_log) -> None:
    proportional = diagnosis.diagnose(Array(), [read_log(make_log(seconds=900, half=True), 9)])
    assert proportional.result["effects"] == []

    def only_half(columns: dict[str, np.ndarray]) -> None:
        columns["fan"] = 0.5 * columns["fan"]

    run = read_log(make_log(seconds=900, change=only_half), 9)
    assert not scene_of(diagnosis.prepare(Array(), [run])).fan_between, "half of what, no run of it tells"
    curve = {"fan_curve": {"fan_half_share": 0.735}}
    only_full = diagnosis.diagnose(Array(), [read_log(make_log(effects=curve, seconds=900), 9)])
    assert only_full.result["effects"] == [] and "fan_half_share" not in only_full.model.parameters


@pytest.mark.parametrize(("chopped", "variant"), [(1.0, "chopped loads"), (0.0, "loads that draw their mean")])
def test_the_way_the_supply_sags_is_told_from_the_other(tmp_path: Path, chopped: float, variant: str) -> None:
    sag = {"supply_sag": {"supply_resistance_ohm": 8.0, "supply_chopped": chopped}}
    run = read_log(commanded(tmp_path / "log.csv", sag | {"sensor_lag": {"sensor_lag_s": 20.0}}), 2)
    found = diagnosis.diagnose(Array(1, 2), [run], model=heaters())
    listed = {e["name"]: e for e in found.result["effects"]}
    assert set(listed) == {"supply_sag", "sensor_lag"}
    assert listed["supply_sag"]["variant"] == variant
    assert listed["supply_sag"]["parameters"]["supply_resistance_ohm"]["value"] == pytest.approx(8.0, rel=0.1)
    assert found.model.parameters["supply_chopped"] == chopped
    assert found.result["unexplained"] is False
    shown = predict(found.model, run)
    assert np.sqrt(np.nanmean((run.temperature_c - shown) ** 2)) < 0.06


@pytest.mark.parametrize("chopped", [1.0, 0.0])
def test_of_commands_that_are_all_or_none_the_way_the_supply_sags_is_not_told(tmp_path: Path, chopped: float) -> None:
    """That it sags is certain all the same; the other law is a rival, with commands in between to tell it by."""
    sag = {"supply_sag": {"supply_resistance_ohm": 8.0, "supply_chopped": chopped}}
    run = read_log(commanded(tmp_path / "log.csv", sag, all_or_none=True), 2)
    found = diagnosis.diagnose(Array(1, 2), [run], model=heaters())
    (one,) = found.told.effects
    assert one.name == "supply_sag" and one.certainty == "certain"
    assert one.text.count("The supply sags under load") == 2 and one.text.endswith("do not tell which.")
    (rival,) = found.told.rivals
    assert rival.name == "supply_sag" and {rival.variant, one.variant} == {
        "chopped loads",
        "loads that draw their mean",
    }
    assert rival.experiment is not None and rival.experiment.difference_c > 1.0
    assert any(0 < share < 100 for step in rival.experiment.steps for share in step.percent)


def names_of(problem: Problem) -> set[str]:
    return {c.effect for c in effects.candidates(scene_of(problem))}


def test_only_what_the_log_could_show_is_a_candidate(make_log, tmp_path: Path) -> None:
    def without_fan(columns: dict[str, np.ndarray]) -> None:
        columns["fan"] = np.zeros(600)

    def lukewarm(columns: dict[str, np.ndarray]) -> None:
        for k in range(1, 10):
            columns[f"t{k}_c"] = np.minimum(columns[f"t{k}_c"], 70.0)

    def cold(columns: dict[str, np.ndarray]) -> None:
        for k in range(1, 10):
            columns[f"t{k}_c"] = np.minimum(columns[f"t{k}_c"], 40.0)

    everything = {*effects.IN_WORDS} - {
        "supply_sag",
        "resistance_phase",
        "resistance_temperature",
        "contact_resistance",  # power is logged
        "fan_curve",  # the fan is off or full
    }
    assert names_of(Problem(Array(), [read_log(make_log("a.csv"))])) == everything
    assert names_of(Problem(Array(), [read_log(make_log("b.csv", change=without_fan))])) == everything - {"fan_wake"}
    assert names_of(Problem(Array(), [read_log(make_log("f.csv", seconds=700, half=True))])) == everything | {
        "fan_curve"
    }
    # 30 K below the declared transformation an alloy may transform all the same, at half the way to it none does
    assert names_of(Problem(Array(), [read_log(make_log("c.csv", change=lukewarm))])) == everything
    assert names_of(Problem(Array(), [read_log(make_log("e.csv", change=cold))])) == everything - {
        "latent_heat",
        "transformation_shift",
    }
    assert "resistance_phase" in names_of(Problem(Array(), [read_log(make_log("d.csv", columns="i"))]))
    both = read_log(commanded(tmp_path / "u.csv", {}), 2)
    pair = names_of(Problem(Array(1, 2), [both]))
    assert {"supply_sag", "holder_mass"} <= pair and "edge_loss" not in pair
    one = replace(both, drive=both.drive[:, :1], temperature_c=both.temperature_c[:, :1], rounding_c=None)
    alone = names_of(Problem(Array(1, 1), [one]))
    assert "plate_conduction" in alone and "holder_mass" not in alone, "of a spring alone both are the same"
    with pytest.raises(InputError, match="what a spring alone is mounted on is plate_conduction"):
        diagnosis.fit_effects(Array(1, 1), [one], ["holder_mass"])
    plates = [
        next(c for c in effects.candidates(scene_of(Problem(array, [run]))) if c.effect == "plate_conduction")
        for array, run in ((Array(1, 1), one), (Array(1, 2), both))
    ]
    numbers = {"plate_coupling_w_per_k": results.Number(value=0.002, stderr=0.0001, unit="W/K")}
    said = [effects.sentence(one.effect, numbers, one.variant) for one in plates]
    assert said[0].startswith("Behind the spring") and said[1].startswith("The springs share a plate")
    assert "common" not in effects.in_words(plates[0].effect, plates[0].variant)


def test_every_probe_is_within_its_bounds_and_moves_what_is_seen(make_log, tmp_path: Path) -> None:
    for array, run in (
        (Array(), read_log(make_log(columns="i", seconds=900))),
        (Array(1, 2), read_log(commanded(tmp_path / "u.csv", {}), 2)),
    ):
        problem = Problem(array, [run])
        base = problem.fit(base_spec(problem))
        latent = next(
            (c for c in effects.candidates(scene_of(problem)) if c.effect == "latent_heat" and not c.variant), None
        )
        for one in effects.candidates(scene_of(problem)):
            if one.effect == "transformation_shift" and latent is None:
                continue  # nothing here transforms
            rides = latent is not None and one.effect == "transformation_shift"  # it shows by what goes with it
            before = base.spec.with_effect("latent_heat", latent.free, (), "") if rides else base.spec
            begin = np.concatenate([base.values, [5.0]]) if rides else base.values
            still = problem.predictions(before, begin)[0]
            spec = before.with_effect(one.effect, one.free, one.fixed, one.variant, one.also_on)
            for probe in (*one.probes, *one.more_starts):
                for free in one.free:
                    assert free.low <= probe.get(free.key, free.start) <= free.high, (one.effect, free.key)
                values = np.concatenate([begin, [probe.get(f.key, f.start) for f in one.free]])
                moved = problem.simulate(spec, values, 0)
                assert np.abs(moved - still).max() > 0.005, (one.effect, one.variant)
                assert np.abs(moved).max() < 900, (one.effect, one.variant)


@pytest.fixture
def plain(make_log) -> search.Search:
    """Return a search on a log of the declared model and nothing else."""
    return searched(read_log(make_log(seed=11)))


def with_effect(found: search.Search, effect: str, variant: str) -> Fit:
    one = next(c for c in found.candidates if (c.effect, c.variant) == (effect, variant))
    return found.refit(found.base, [one], [1.0])


def test_a_drift_that_follows_anything_must_win_clearly(plain: search.Search) -> None:
    drift, plate = with_effect(plain, "ambient_drift", "free"), with_effect(plain, "plate_conduction", "")
    for one in (drift, plate):
        one.factor = 1.0

    def ahead(fit: Fit, other: Fit, nats: float) -> None:
        """Give `fit` the likelihood with which it is ahead of the other by so many nats."""
        evidence.likelihood(plain.problem, fit)
        fit.nats += nats - evidence.log_evidence(plain.problem, fit, other)
        assert evidence.log_evidence(plain.problem, fit, other) == pytest.approx(nats)

    ahead(drift, plate, 0.5 * search.TOLD_APART)
    assert not plain.preferred(drift, plate) and plain.preferred(plate, drift)
    ahead(drift, plate, 2.0 * search.TOLD_APART)
    assert plain.preferred(drift, plate) and not plain.preferred(plate, drift)
    # against a ramp it needs no more than to be better: both are the same effect, and a wrong shape makes wrong numbers
    ramp = with_effect(plain, "ambient_drift", "ramp")
    ramp.factor = 1.0
    ahead(drift, ramp, 0.5 * search.TOLD_APART)
    assert plain.preferred(drift, ramp) and not plain.preferred(ramp, drift)


@pytest.mark.parametrize(("effect", "variant"), [("ambient_drift", "free"), ("holder_mass", "")])
def test_slow_nodes_are_tried_in_the_place_of_what_follows_anything_slow_whatever_the_forecast_says(
    plain: search.Search, effect: str, variant: str
) -> None:
    bends = with_effect(plain, effect, variant)
    tried = {other.spec.effects[-1] for _, other in plain.rivals(bends, {effect: plain.base})}
    assert {"shared_air", "plate_conduction"} <= tried


def test_another_variant_of_an_adopted_effect_is_tried(make_log) -> None:
    found = searched(read_log(make_log(effects={"spring_mismatch": {"loss_scale[4]": 1.4}}, seed=3)))
    wrong = with_effect(found, "spring_mismatch", "spring 5")
    contenders = [other for _, other in found.rivals(wrong, {"spring_mismatch": found.base})]
    right = next(other for other in contenders if dict(other.spec.variant) == {"spring_mismatch": "spring 4"})
    assert found.preferred(right, wrong) and not found.preferred(wrong, right)


def test_a_search_that_has_had_its_simulations_begins_no_further_step(make_log) -> None:
    found = searched(read_log(make_log(effects={"edge_loss": {"edge_loss_fraction": 0.2}}, seed=3)))
    problem, base = found.problem, found.base
    found.until = problem.simulations - 1
    assert found.forward(base) is base and not problem.budget.short
    found.until = problem.simulations + 1000
    assert found.forward(base).spec.effects == ("edge_loss",)


def test_a_screen_that_is_kept_holds_no_readings(make_log) -> None:
    """Of half a day of nine springs those of one are 40 MB, and a diagnosis keeps ten."""
    found = searched(read_log(make_log(seed=3)))
    kept = vars(found.screen(found.base)).values()
    assert sum(one.size for one in kept if isinstance(one, np.ndarray)) < 4 * found.problem.count


def test_all_searches_draw_from_one_budget(make_log) -> None:
    found = searched(read_log(make_log(effects={"edge_loss": {"edge_loss_fraction": 0.2}}, seed=3)))
    problem, base = found.problem, found.base
    problem.budget.enough = problem.simulations + 400
    shares = []
    for _ in range(2):
        shares.append(search.Search(problem, found.candidates, base).until - problem.simulations)
        problem.budget.take(200)
    assert shares == [100, 50] and not problem.budget.short
    problem.budget.take()
    assert search.Search(problem, found.candidates, base).forward(base) is base
    assert problem.budget.short


def test_a_diagnosis_that_could_not_go_on_says_so_and_answers_with_what_it_has(
    make_log, monkeypatch: pytest.MonkeyPatch
) -> None:
    def sways(columns: dict[str, np.ndarray]) -> None:
        columns["t4_c"] += 5.0 * np.sin(np.arange(600.0) / 30.0)

    monkeypatch.setattr(budget, "ENOUGH", 150)
    found = diagnosis.diagnose(Array(), [read_log(make_log(seed=3, change=sways))]).result
    assert found["unexplained"]
    assert any("ended at its bound of 150 simulations" in one for one in found["warnings"])


def test_a_forecast_keeps_to_what_is_physical(plain: search.Search) -> None:
    screen = plain.screen(plain.base)
    k = next(k for k, c in enumerate(screen.candidates) if c.effect == "radiation")
    column = int(np.flatnonzero(screen.owner == k)[0])
    size = screen.gram[column, column]
    for moment, drop in ((size, size), (-size, 0.0), (100 * size, None)):
        screen.moment = screen.moment.copy()
        screen.moment[column] = moment
        found, sizes = screen.forecast([k])
        if drop is not None:
            assert found == pytest.approx(drop, rel=1e-4, abs=1e-9)
        assert all(0 <= s <= screen.candidates[k].most for s in sizes.values())


def test_an_effect_that_explains_less_than_half_the_noise_is_not_worth_it(plain: search.Search) -> None:
    better = copy.copy(plain.base)
    better.residual = [0.5 * left for left in plain.base.residual]  # statistical evidence without end
    better.colour = None
    for share, worth in ((0.3, False), (0.5, True)):
        better.sse = plain.base.sse - share**2 * plain.base.count
        better.chi2 = plain.base.chi2 - share**2 * plain.base.count
        assert plain.worth(better, plain.base) == worth


def test_structure_of_half_the_noise_is_unexplained_and_less_is_not(plain: search.Search) -> None:
    fit = copy.copy(plain.base)
    wave = np.sqrt(2) * 0.3 * np.sin(np.arange(600.0) / 40)[:, None]
    for share, expected in ((0.35, False), (0.65, True)):
        fit.residual = [plain.base.residual[0] + share * wave]
        assert evidence.unexplained(plain.problem, fit) == expected
    one = np.zeros((600, 9))
    one[:, 4:5] = 1.4 * wave
    fit.residual = [plain.base.residual[0] + one]
    assert evidence.unexplained(plain.problem, fit)


def test_the_experiment_that_separates_is_one_in_which_both_models_differ(make_log) -> None:
    problem = Problem(Array(), [read_log(make_log(effects={"latent_heat": {"latent_heat_j": 8.0}}))])
    base = problem.fit(base_spec(problem))
    latent = next(c for c in effects.candidates(scene_of(problem)) if c.effect == "latent_heat")
    spec = base.spec.with_effect(latent.effect, latent.free, latent.fixed, latent.variant)
    with_heat = problem.fit(spec, base.as_dict())
    same, words = experiments.separate(problem, base, base)
    assert same.difference_c == 0.0 and "too little to see" in words
    told, words = experiments.separate(problem, base, with_heat)
    assert told.difference_c > 3.0 and 1 <= told.spring <= 9 and 0 < told.at_s <= told.duration_s
    assert told.name in words and f"spring {told.spring}" in words
    planned = plan_experiment(Array(), told, 14.0, 105.0)
    assert script_lines("\n".join(planned.steps), "steps.txt", told.duration_s + 10.0)[-1].at_s


def test_a_drift_of_these_runs_is_said_and_left_out_of_the_model(make_log, tmp_path: Path) -> None:
    drift = {"ambient_drift": {"ambient_amplitude_k": 4.0, "ambient_period_s": 1100.0, "ambient_ramp_k_per_h": 0.0}}
    run = read_log(make_log(effects=drift, seconds=900))
    found = diagnosis.diagnose(Array(), [run])
    effect = found.result["effects"][0]
    assert (effect["name"], effect["variant"]) == ("ambient_drift", "free")
    assert found.model.effects == []
    assert found.model.provenance["note"] == diagnosis.DRIFT_LEFT_OUT
    (said,) = (text for text in found.result["warnings"] if diagnosis.DRIFT_LEFT_OUT in text)
    assert ("nearer to the springs" in said) == (run.ambient_c is not None)


def test_a_run_that_does_not_begin_as_logged_is_said(make_log, briefly: None) -> None:
    def late(columns: dict[str, np.ndarray]) -> None:
        for k in range(1, 10):
            columns[f"t{k}_c"] = columns[f"t{k}_c"] + 6.0 * np.exp(-((np.arange(450.0) - 30) ** 2) / 200)

    result = diagnosis.diagnose(Array(), [read_log(make_log(change=late, seconds=450))]).result
    assert result["unexplained"] is True
    assert any("the start of run 1" in text for text in result["residual"]["depends_on"])


def test_correlations_of_the_rest_are_correlations(make_log) -> None:
    def pickup(columns: dict[str, np.ndarray]) -> None:
        columns["t3_c"] = columns["t3_c"] + 3.0 * columns["i3_a"]

    left = searched(read_log(make_log(change=pickup)))
    names, _ = residual.depends_on(left.problem, left.base)
    said = [text for text in names if "r = " in text]
    assert any("drive of spring 3 (seen at spring 3" in text for text in said)
    assert all(abs(float(text.split("r = ")[1].rstrip(")"))) <= 1.0 for text in said)


def test_a_run_that_begins_warm_needs_no_effect(tmp_path: Path) -> None:
    """Springs, air and plate start in balance with the first inputs, as after a long warm-up."""
    rng = np.random.default_rng(3)
    time_s = np.arange(600.0)
    drive = np.full((600, 2), 0.3)
    drive[200:400, 0], drive[300:500, 1] = 0.5, 0.1
    values = {"heat_capacity_j_per_k": 2.0, "loss_w_per_k": 0.012, "orthogonal_w_per_k": 0.004}
    values |= {"plate_coupling_w_per_k": 0.01, "plate_heat_capacity_j_per_k": 60.0, "plate_loss_w_per_k": 0.02}
    plant = a_plant((1, 2), ["plate_conduction"], values)
    for k in range(2):
        plant.drive(k, native.POWER, 0.3)
    plant.settle(1e6)
    shown = plant.simulate(time_s, native.POWER, drive) + rng.normal(0.0, 0.05, (600, 2))
    columns = columns_of(i=drive, v=np.ones_like(drive), t=shown) | {"ambient_c": np.full(600, 20.0)}
    path = tmp_path / "warm.csv"
    path.write_text(log_text(time_s, columns))
    run = read_log(path, 2)
    assert run.warm
    problem = Problem(Array(1, 2), [run])
    base = base_spec(problem)
    plate = next(c for c in effects.candidates(scene_of(problem)) if c.effect == "plate_conduction")
    spec = base.with_effect(plate.effect, plate.free, (), "")
    left = run.temperature_c - problem.simulate(spec, [values[f.key] for f in spec.free], 0)
    assert np.abs(left[100:200].mean(axis=0)).max() < 0.08


def test_a_model_with_effects_needs_no_other_on_the_log_it_came_from(make_log, tmp_path: Path) -> None:
    """Also where an effect has variants: the one that the model's parameters speak of is taken, and from there."""
    sag = {"supply_sag": {"supply_resistance_ohm": 8.0, "supply_chopped": 1.0}}
    for name, array, declared, run in (
        ("chopped loads", Array(1, 2), heaters(), read_log(commanded(tmp_path / "u.csv", sag), 2)),
        ("spring 4", Array(), None, read_log(make_log(effects={"spring_mismatch": {"loss_scale[4]": 1.4}}, seed=3))),
    ):
        first = diagnosis.diagnose(array, [run], model=declared)
        assert [e.get("variant") for e in first.result["effects"]] == [name]
        again = diagnosis.diagnose(array, [run], model=first.model)
        assert again.result["effects"] == []
        assert dict(again.baseline.spec.variant).popitem()[1] == name
        assert again.result["baseline"]["rmse_c"] == pytest.approx(first.result["after"]["rmse_c"], rel=0.01)
        frozen = diagnosis.diagnose(array, [run], model=first.model, frozen=True)
        assert frozen.baseline.spec.free == () and frozen.result["effects"] == []


def test_every_effect_of_the_table_has_its_file_and_a_sentence() -> None:
    assert [one.name for one in effects.library()] == list(native.effect_names())
    said = effects.sentence("sensor_lag", {"sensor_lag_s": results.Number(value=5.04, stderr=0.21, unit="s")})
    assert said == "The thermometers lag 5.0 s (+-0.2)."
    mismatch = {
        f"{name}[4]": results.Number(value=value, stderr=0.03, unit="1")
        for name, value in (("loss_scale", 1.16), ("heat_capacity_scale", 1.01))
    }
    assert effects.sentence("spring_mismatch", mismatch, "spring 4") == "Spring 4 loses 16 % more (+-3)."
