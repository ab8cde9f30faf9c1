"""Heat of unknown origin is told by place, time, sign and size; v / i tells phases, rises and contacts; both are silent
where nothing is there."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from ninespring.find import certainty, contacts, diagnosis, evidence, residual, resistance, unknown_heat
from ninespring.find.readings import Readings, nats_of, readings, solve
from ninespring.infer.declared import base_spec
from ninespring.infer.fit import Fit
from ninespring.infer.problem import Problem
from ninespring.io.logs import log_text, read_log
from ninespring.io.logs.mending import RUN_IN_S
from ninespring.model import native
from ninespring.model.models import Array
from plants import a_plant, columns_of, switched

ROWS = 700
Change = Callable[[np.ndarray], None]


def array_log(
    path: Path,
    heat: Change = lambda watts: None,
    thermometers: Change = lambda shown: None,
    ohms: Change = lambda ohm: None,
    effects: dict[str, float] | None = None,
    drive: Change = lambda watts: None,
    gap: slice = slice(0),
) -> tuple[Problem, Fit]:
    """Write a 3 x 3 log with changes to the heat, the thermometers and the resistances that nothing logs; fit it."""
    rng = np.random.default_rng(2)
    time_s, watts = np.arange(float(ROWS)), switched(rng, ROWS, 0.05, 0.2, 0.65)
    fan = ((time_s // 200) % 2 == 1).astype(float)
    drive(watts)
    given = watts.copy()
    heat(given)
    plant = a_plant((3, 3), {"resistance_phase": {}} | ({"resistance_temperature": effects} if effects else {}))
    traced = plant.copy().trace(time_s, native.POWER, given, fan, np.full(ROWS, 20.0))
    ohm = plant.readings(time_s, given, fan, np.full(ROWS, 20.0)) * (1.0 + 0.04 * np.linspace(-1, 1, 9))
    ohms(ohm)
    shown = traced[:, :, 0] + rng.normal(0.0, 0.3, (ROWS, 9))
    thermometers(shown)
    current = np.sqrt(watts / ohm)
    voltage = watts / current + rng.normal(0.0, 3e-4, (ROWS, 9))
    columns = columns_of(i=current, v=voltage, t=shown) | {"fan": fan, "ambient_c": np.full(ROWS, 20.0)}
    logged = np.delete(np.arange(ROWS), gap)
    path.write_text(log_text(time_s[logged], {name: one[logged] for name, one in columns.items()}, decimals=5))
    problem = Problem(Array(), [read_log(path, 9)])
    return problem, diagnosis.first_fit(problem, base_spec(problem))


def test_a_step_of_heat_is_told_by_its_place_time_sign_and_size(tmp_path: Path) -> None:
    def less(watts: np.ndarray) -> None:
        watts[305:485, 2] -= 0.045

    problem, fit = array_log(tmp_path / "log.csv", heat=less)
    found = unknown_heat.find(problem, fit)
    heat = [one for one in found.events if one.kind == "heat"]
    assert heat and all(one.spring == 3 and one.size < 0 for one in heat)
    joules = sum(one.size * (one.to_s - one.from_s) for one in heat)
    assert joules == pytest.approx(-0.045 * 180.0, rel=0.25)
    assert min(one.from_s for one in heat) == pytest.approx(305, abs=30)
    assert max(one.to_s for one in heat) == pytest.approx(485, abs=30)
    assert "spring 3: " in heat[0].text and "less than known" in heat[0].text


def test_a_thermometer_that_jumps_is_no_heat(tmp_path: Path) -> None:
    def jump(shown: np.ndarray) -> None:
        shown[400:, 6] += 2.5

    problem, fit = array_log(tmp_path / "log.csv", thermometers=jump)
    (one,) = unknown_heat.find(problem, fit).events
    assert (one.kind, one.spring) == ("sensor", 7)
    assert one.size == pytest.approx(2.5, abs=0.3) and one.from_s == pytest.approx(400, abs=15)


def test_a_thermometer_that_is_off_all_along_has_not_jumped(tmp_path: Path) -> None:
    def off(shown: np.ndarray) -> None:
        shown[:, 6] += 4.0

    problem, fit = array_log(tmp_path / "log.csv", thermometers=off)
    assert [one.text for one in unknown_heat.find(problem, fit).events if one.kind == "sensor"] == []


@pytest.mark.parametrize("seed", [0, 2])
def test_what_a_transformation_leaves_is_no_jump_of_a_thermometer(make_log, seed: int) -> None:
    """It comes and goes within seconds, and a thermometer's piece is what explains it best."""
    run = read_log(make_log(effects={"latent_heat": {}}, seed=seed, noise=0.1, seconds=500))
    problem = Problem(Array(), [run])
    fit = diagnosis.first_fit(problem, base_spec(problem))
    assert evidence.unexplained(problem, fit)
    assert [one.text for one in unknown_heat.find(problem, fit).events if one.kind == "sensor"] == []


@pytest.mark.parametrize(("seed", "k", "wanted"), [(0, 5, ["latent_heat"]), (2, 8, ["latent_heat"]), (2, 8, [])])
def test_a_thermometer_that_jumps_as_its_spring_transforms_is_told(
    make_log, seed: int, k: int, wanted: list[str]
) -> None:
    def jump(columns: dict[str, np.ndarray]) -> None:
        shown = columns[f"t{k + 1}_c"].copy()
        assert 84.0 < shown[200] < 98.0, "it transforms"
        shown[200:] += 4.0
        columns[f"t{k + 1}_c"] = shown

    run = read_log(make_log(effects={"latent_heat": {}}, seed=seed, noise=0.1, seconds=500, change=jump))
    problem, fit, _ = diagnosis.fit_effects(Array(), [run], wanted)
    (one,) = (one for one in unknown_heat.find(problem, fit).events if one.kind == "sensor")
    assert one.spring == k + 1 and one.from_s == pytest.approx(200, abs=15)
    assert one.size == pytest.approx(4.0, abs=0.3)


def test_what_relieves_nothing_explains_no_part_of_it(make_log, monkeypatch: pytest.MonkeyPatch) -> None:
    """Random effects lie as far apart without an effect as with it, and no farther than is believed."""
    run = read_log(make_log(effects={"edge_loss": {}}, seconds=300))
    problem, fit, base = diagnosis.fit_effects(Array(), [run], ["edge_loss"])
    plain = certainty.witness(problem, fit, "edge_loss", base, False)
    monkeypatch.setattr(certainty, "relief", lambda *fits: 1.0)
    monkeypatch.setattr(certainty, "strain", lambda *fits: 0.0)
    assert certainty.witness(problem, fit, "edge_loss", base, False) == plain


def test_a_run_that_is_shorter_than_what_is_late_does_not_hide_the_others(tmp_path: Path) -> None:
    def heated(shown: np.ndarray) -> None:
        shown[:, 4] += 8.0 * np.sin(np.arange(len(shown)) / 60.0)

    long, _ = array_log(tmp_path / "log.csv", thermometers=heated)
    problem = Problem(Array(), [long.runs[0], long.runs[0].part(slice(100))])
    said, note = residual.depends_on(problem, diagnosis.first_fit(problem, base_spec(problem)))
    assert "spring 5" in note and said


@pytest.mark.parametrize(("end", "told"), [(400, True), (205, False)])
def test_a_jump_is_where_readings_step_and_stay(end: int, told: bool) -> None:
    """What comes back within seconds, what is slow to come, and what steps by another size is none."""
    noise = np.random.default_rng(4).normal(0.0, 0.1, 400)
    rows = np.arange(400.0)
    slope = 0.01 * (rows - 200.0)
    there = slope + noise + np.where((rows >= 203) & (rows < end), 1.0, 0.0)
    assert unknown_heat._jumps(there, 200, 15, 1.0, 1.0, 0.1) is told
    slow = noise + np.clip((rows - 195.0) / 10.0, 0.0, 1.0)
    assert not unknown_heat._jumps(slow, 200, 15, 1.0, 1.0, 0.1)
    assert not unknown_heat._jumps(there, 200, 15, 3.0, 3.0, 0.1)
    assert not unknown_heat._jumps(there, 200, 15, -1.0, -1.0, 0.1)
    assert not unknown_heat._jumps(noise, 200, 15, 0.3, 0.3, 0.1)
    gone = np.where((rows > 190) & (rows < 203), np.nan, there)
    assert unknown_heat._jumps(gone, 200, 15, 1.0, 1.0, 0.1) is told, "a gap hides when, not that"


def test_nothing_is_told_where_nothing_is(tmp_path: Path) -> None:
    problem, fit = array_log(tmp_path / "log.csv")
    assert unknown_heat.find(problem, fit).events == []
    second = resistance.witness(problem, fit)
    assert second is not None
    assert {one.name for one in second.effects} <= {"resistance_phase"}


def test_a_contact_that_gets_worse_is_told_with_its_spring_time_and_size(tmp_path: Path) -> None:
    def worse(ohm: np.ndarray) -> None:
        ohm[350:, 4] += 0.008

    problem, fit = array_log(tmp_path / "log.csv", ohms=worse)
    second = resistance.witness(problem, fit)
    assert second is not None
    contacts = [one for one in second.effects if one.name == "contact_resistance"]
    assert len(contacts) == 1 and contacts[0].variant.startswith("spring 5, from 3")
    assert contacts[0].parameters["contact_ohm[5]"].value == pytest.approx(0.008, rel=0.15)


def test_a_contact_that_comes_and_goes_is_told_each_time_and_its_heat_taken_out(tmp_path: Path) -> None:
    def loose(ohm: np.ndarray) -> None:
        ohm[220:450, 4] += 0.008

    problem, fit = array_log(tmp_path / "log.csv", ohms=loose)
    second = resistance.witness(problem, fit)
    assert second is not None
    steps = second.contacts
    assert [one.spring for one in steps] == [4, 4]
    assert [one.ohm for one in steps] == pytest.approx([0.008, -0.008], rel=0.1)
    run = problem.runs[0]
    current = run.current_a
    assert current is not None
    before = run.drive.copy()
    contacts.take_heat_out(problem, steps)
    taken = before - problem.runs[0].drive
    assert np.delete(taken, 4, axis=1).max() == 0.0
    within = slice(int(steps[0].from_s), int(steps[1].from_s))
    assert taken[within, 4] == pytest.approx(current[within, 4] ** 2 * steps[0].ohm, rel=1e-9)
    assert np.abs(taken[int(steps[1].from_s) :, 4]).max() < 0.1 * taken[within, 4].max()


def told_by(monkeypatch: pytest.MonkeyPatch, *times: tuple[int, float, float, float, float]) -> list[str]:
    """Return what v / i names of two springs; each time: seconds, austenite, from and to what temperature, ohm, of the first."""
    rng = np.random.default_rng(3)
    parts = []
    begin_s = 0.0
    for spring in (0, 1):
        for long_s, phase, from_c, to_c, ohm in times if spring == 0 else [(900, 0.0, 20.0, 80.0, 0.175)]:
            each = (spring, 0, 0.0, phase, 0.0, 1e-3)
            columns = [np.full(long_s, one) for one in (ohm, *each)]
            columns[0] = columns[0] + rng.normal(0.0, 1e-3, long_s)
            columns[3] = begin_s + np.arange(long_s)
            columns[5] = np.linspace(from_c, to_c, long_s) - 20.0
            parts.append([*columns, columns[5] < 48.0])
            begin_s += long_s + 60.0
    read = Readings(*(np.concatenate([part[n] for part in parts]) for n in range(8)))
    read.spring, read.run = read.spring.astype(int), read.run.astype(int)
    monkeypatch.setattr(resistance, "readings", lambda problem, fit: read)
    monkeypatch.setattr(contacts, "dated", lambda problem, steps: steps)
    second = resistance.witness(Problem.__new__(Problem), Fit.__new__(Fit))
    assert second is not None
    return [one.name for one in second.effects]


COLD = (200, 0.0, 20.0, 70.0, 0.175)


def test_a_few_readings_of_austenite_are_no_contact(monkeypatch: pytest.MonkeyPatch) -> None:
    seldom = (15, 1.0, 100.0, 110.0, 0.215)
    assert told_by(monkeypatch, COLD, (29, 0.0, 57.0, 75.0, 0.175), seldom, COLD, COLD) == []


def test_a_spring_that_did_not_transform_wholly_is_neither_a_contact_nor_a_coefficient(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    partly, wholly = (80, 1.0, 95.0, 85.0, 0.209), (100, 1.0, 120.0, 105.0, 0.2145)
    assert told_by(monkeypatch, COLD, partly, COLD, wholly, COLD, wholly, partly) == ["resistance_phase"]


def test_a_spring_that_begins_to_transform_more_slowly_than_the_model_is_no_contact(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    begins = (100, 0.005, 84.0, 88.0, 0.179)
    assert told_by(monkeypatch, COLD, COLD, begins) == []


def test_a_contact_that_cold_wire_shows_is_placed_by_hot_readings_too(monkeypatch: pytest.MonkeyPatch) -> None:
    hot, worse = (100, 1.0, 110.0, 100.0, 0.215), (100, 1.0, 110.0, 100.0, 0.225)
    cold = (200, 0.0, 20.0, 70.0, 0.185)
    named = told_by(monkeypatch, COLD, hot, COLD, worse, cold, worse, cold)
    assert sorted(named) == ["contact_resistance", "resistance_phase"]


def test_what_a_spring_was_before_a_gap_is_not_guessed(tmp_path: Path) -> None:
    def held(watts: np.ndarray) -> None:
        watts[:] = 0.05
        watts[100:180, 4], watts[180:, 4] = 0.75, 0.56  # through the transformation, and held above where it goes back
        watts[200:400, 4] = watts[600:, 4] = 0.92  # with the fan

    problem, fit = array_log(tmp_path / "log.csv", drive=held, gap=slice(300, 380))
    read = readings(problem, fit)
    assert read is not None
    middle = read.spring == 4
    before, after = (read.time_s < 300.0) & middle, (read.time_s > 380.0) & middle
    assert (read.phase[before] > 0.5).any() and not after.any()
    assert ((read.time_s > 380.0 + RUN_IN_S) & ~middle).any()


def test_a_reading_that_a_simulation_starts_from_is_no_spike(tmp_path: Path) -> None:
    problem, fit = array_log(tmp_path / "log.csv", gap=slice(300, 380))
    begin = problem.runs[0].starts[1]
    left = [np.where(np.isfinite(one), 0.0, np.nan) for one in fit.residual]
    left[0][begin, 4] = 40.0
    problem.mask_spikes(left)
    assert np.isfinite(problem.runs[0].temperature_c[begin, 4])


def test_spikes_are_left_out_of_a_problem_and_stay_in_its_log(tmp_path: Path) -> None:
    """Else another problem of the same log has other readings, and what one search fitted does not serve the other."""
    problem, fit = array_log(tmp_path / "log.csv")
    run, left = problem.runs[0], [one.copy() for one in fit.residual]
    left[0][200, 4] = 40.0
    shown = run.temperature_c.copy()
    assert problem.mask_spikes(left) == 1
    assert np.isnan(problem.runs[0].temperature_c[200, 4])
    assert np.array_equal(run.temperature_c, shown, equal_nan=True)


def test_a_resistance_that_rises_with_temperature_is_told(tmp_path: Path) -> None:
    rises = {"resistance_martensite_rise_per_k": 0.0008, "resistance_austenite_rise_per_k": 0.0005}
    problem, fit = array_log(tmp_path / "log.csv", effects=rises)
    second = resistance.witness(problem, fit)
    assert second is not None
    named = {one.name: one.parameters for one in second.effects}
    rise = named["resistance_temperature"]["resistance_martensite_rise_per_k"]
    assert rise.value == pytest.approx(0.0008, rel=0.15)


@pytest.mark.parametrize("wanders", [0.0, 0.02])
def test_v_over_i_that_is_not_explained_to_its_noise_makes_nothing_certain(tmp_path: Path, wanders: float) -> None:
    """Something else acts in it: what is named may stand in for that, and no heat of a contact is taken out for it."""

    def other(ohm: np.ndarray) -> None:
        ohm[:, :4] *= 1.0 + wanders * np.sin(np.arange(ROWS) / 40.0)[:, None]
        ohm[350:, 4] += 0.008

    problem, fit = array_log(tmp_path / "log.csv", ohms=other)
    second = resistance.witness(problem, fit)
    assert second is not None and {"resistance_phase", "contact_resistance"} <= {one.name for one in second.effects}
    for one in second.effects:
        assert (one.certainty, one.probability < certainty.CERTAIN) == (
            ("probable", True) if wanders else ("certain", False)
        )
    assert bool(second.contacts) == (not wanders)


def test_a_cause_of_one_size_always_is_likelier_than_one_that_fits_here_and_not_there() -> None:
    def of(**change: float) -> float:
        usual = {"nats": 100.0, "share": 0.97, "in_time": 0.01, "in_place": 0.02, "left": 1.0, "flexible": False}
        return certainty.Witness(**(usual | change)).probability()

    assert of() > 0.9 > 0.5 > of(in_time=0.5, share=0.4)
    assert of(in_time=0.3) < of() and of(share=0.3) < of() and of(nats=4.0) < of() and of(flexible=True) < of()
    assert of(nats=30.0) == of(nats=3000.0)


def test_an_amplitude_that_is_the_same_everywhere_does_not_scatter() -> None:
    rng = np.random.default_rng(1)
    signal = [rng.normal(0, 5, 200) for _ in range(6)]
    noise = [rng.normal(0, 1, 200) for _ in range(6)]
    assert certainty.scatter(signal, noise, 1.0) < 0.03
    half = [n + (0.5 if k < 3 else -0.5) * s for k, (s, n) in enumerate(zip(signal, noise, strict=True))]
    assert certainty.scatter(signal, half, 1.0) == pytest.approx(0.5, abs=0.05)


def test_what_is_far_below_a_finding_is_not_taken_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    rows = 2000
    time_s = np.arange(float(rows))
    wander = 2e-4 * np.sin(time_s / 60.0)  # ohm: far above the noise, a tenth of the smallest contact
    ohm = 0.2 + wander + rng.normal(0.0, 1e-5, rows)
    zeros = np.zeros(rows)
    spring, noise, cold = zeros.astype(int), np.full(rows, 1e-5), np.ones(rows, dtype=bool)
    read = Readings(ohm, spring, spring, time_s, zeros, zeros + 10.0, noise, cold)
    asked = []
    solve = contacts.solve
    monkeypatch.setattr(contacts, "solve", lambda *given: asked.append(1) or solve(*given))
    columns = {"own 0": np.ones(rows)}
    steps, _ = contacts.find(read, columns)
    assert steps == []
    assert len(asked) == 3  # cold readings without and with the best of changes, and all
    read.ohm = ohm + 0.006 * (time_s > 900.0)
    steps, _ = contacts.find(read, columns)
    assert [round(one.ohm, 3) for one in steps] == [0.006]
    assert abs(steps[0].from_s - 901.0) < 40.0


def test_what_is_finer_than_voltages_step_is_no_evidence() -> None:
    """A simulation's exact v / i that moves by a hundred-thousandth with heat, beside what a reading is known to."""
    over_k, nothing = np.linspace(0.0, 60.0, 500), np.zeros(500)
    for rise, told in ((1e-8, False), (1e-4, True)):
        ohm = 0.2 + rise * over_k
        read = Readings(ohm, nothing, nothing, np.arange(500.0), nothing, over_k, np.full(500, 8e-4), nothing < 1.0)
        own = {"own 0": np.ones(500)}
        assert (nats_of(read, solve(read, own), solve(read, own | {"rise martensite": over_k})) > 0.0) == told
