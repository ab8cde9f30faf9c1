"""Mistakes in the making of a log are said, whatever else the array does; a good log is not suspected."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from ninespring.find import diagnosis, doubt, plausibility, resistance
from ninespring.io import results, statistics
from ninespring.io.logs import condense, read_log, write_atomically
from ninespring.io.logs.run import Run
from ninespring.model import native
from ninespring.model.models import Array, model_text, read_model
from ninespring.say import page
from plants import a_plant

TRUE = {"latent_heat": {"latent_heat_j": 8.0}, "shared_air": {"air_exchange_w_per_k": 0.2}}


def later(columns: dict[str, np.ndarray], rows: int) -> None:
    """Move the temperatures later by so many rows."""
    time_s = np.arange(600.0)
    for k in range(1, 10):
        columns[f"t{k}_c"] = np.interp(time_s - rows, time_s, columns[f"t{k}_c"])


@pytest.mark.parametrize("columns", ["iv", "i"])
def test_a_good_log_is_not_suspected(make_log, columns: str) -> None:
    for seed in range(4):
        run = read_log(make_log(effects=TRUE, seed=seed, columns=columns))
        assert plausibility.swapped([run]) == []
        assert plausibility.undriven_but_hottest(run) == []


@pytest.mark.parametrize("order", [{2: 8, 8: 2}, {1: 2, 2: 1, 5: 6, 6: 5}, {1: 2, 2: 3, 3: 1}])
def test_swapped_columns_are_named_through_a_phase_change_and_warm_air(make_log, order: dict[int, int]) -> None:
    for letters in (("t", "c"), ("i", "a")):

        def swap(columns: dict[str, np.ndarray], letters: tuple[str, str] = letters) -> None:
            kinds = [letters, ("v", "v")] if letters[0] == "i" else [letters]
            for a, b in kinds:
                columns.update({f"{a}{k}_{b}": v for k, v in [(k, columns[f"{a}{o}_{b}"]) for k, o in order.items()]})

        found = plausibility.swapped([read_log(make_log(effects=TRUE, change=swap))])
        pairs = order if letters[0] == "t" else {o: k for k, o in order.items()}
        assert {text.split(",")[0] for text in found} == {
            f"t{k}_c follows the drive of spring {o}" for k, o in pairs.items()
        }


def test_a_drive_moves_its_spring_as_much_in_a_log_that_was_averaged() -> None:
    """Rows of a second after each switch, and of a minute later: what they weigh is the time that they last."""
    rng, time_s = np.random.default_rng(8), np.arange(4500.0)
    drive = np.repeat(rng.choice([0.0, 0.2, 0.45], (15, 4)), 300, axis=0)
    shown = a_plant((2, 2)).simulate(time_s, native.POWER, drive, np.zeros(4500), np.full(4500, 20.0))
    shown = shown + rng.normal(0.0, 0.1, shown.shape)
    whole = Run("whole", "", time_s, "power", drive, shown, np.zeros(4500), np.full(4500, 20.0))
    short = condense(whole, 700)
    assert np.ptp(np.diff(short.time_s)) > 5.0
    assert np.diag(plausibility.own_drive([short])) == pytest.approx(np.diag(plausibility.own_drive([whole])), rel=0.25)
    crossed = replace(short, temperature_c=short.temperature_c[:, [1, 0, 2, 3]])
    assert len(plausibility.swapped([crossed])) == 2 and not plausibility.swapped([short])


def test_of_a_log_with_swapped_columns_the_mistake_is_said_first_and_nothing_else_is_made_of_it(
    make_log, briefly: None
) -> None:
    def swap(columns: dict[str, np.ndarray]) -> None:
        pairs = {1: 2, 2: 1, 4: 9, 9: 4}
        columns.update({f"t{k}_c": v for k, v in [(k, columns[f"t{o}_c"]) for k, o in pairs.items()]})

    told = diagnosis.diagnose(Array(), [read_log(make_log(effects=TRUE, change=swap))]).told
    assert [kind for kind, _ in page.findings(told)[:4]] == ["a mistake in the log?"] * 4
    assert not any(one.seen_by for one in told.effects) and told.unnamed == []


def test_a_spring_that_is_hot_and_never_driven_is_said(make_log) -> None:
    run = read_log(make_log(effects=TRUE, change=lambda c: c.update(i7_a=c["i7_a"] * 0, v7_v=c["v7_v"] * 0)))
    (said,) = plausibility.undriven_but_hottest(run)
    assert said.startswith("spring 7 is never driven, yet at ")


def test_a_spring_that_begins_hot_and_cools_is_not_suspected(make_log) -> None:
    def hot(columns: dict[str, np.ndarray]) -> None:
        columns["t7_c"] = 20.0 + 120.0 * np.exp(-np.arange(600.0) / 50)
        columns.update(i7_a=columns["i7_a"] * 0, v7_v=columns["v7_v"] * 0)

    assert plausibility.undriven_but_hottest(read_log(make_log(change=hot))) == []


@pytest.mark.parametrize(
    ("late_s", "word", "rows", "off_s"),
    [
        *((late_s, "before", 0, 1) for late_s in (-2, -8, -40)),
        (8, "after", 0, 1),
        (20, "after", 300, 2),
        (-20, "before", 300, 2),
    ],
)
def test_a_shifted_clock_is_measured_both_ways(make_log, late_s: int, word: str, rows: int, off_s: int) -> None:
    """Rows that were averaged are the longer the longer nothing was switched: so many of them are no time."""
    run = read_log(make_log(change=lambda c: later(c, late_s)))
    run = condense(run, rows) if rows else run
    assert not rows or np.ptp(np.diff(run.time_s)) > 2.0
    problem, fit, _ = diagnosis.fit_effects(Array(), [run], [])
    (said,) = plausibility.shifted_clock(problem, (fit,))
    match = re.search(rf"come about (\d+) s {word} the inputs", said)
    assert match and abs(int(match[1]) - abs(late_s)) <= off_s


def test_a_clock_that_is_right_is_not_suspected(make_log) -> None:
    """Nor beside a fit whose errors last: it was held against fits of other clocks that leave as little as they can."""
    run = read_log(make_log(effects=TRUE))
    problem, fit, _ = diagnosis.fit_effects(Array(), [run], [])
    lasts = problem.evaluate(replace(fit, values=1.15 * fit.values))
    assert statistics.rms(lasts.residual) > 1.5 * statistics.rms(fit.residual)
    assert plausibility.shifted_clock(problem, (fit,)) == plausibility.shifted_clock(problem, (lasts,)) == []


@pytest.mark.parametrize(("step", "said"), [(1.5, 1), (0.5, 0), (0.01, 0)])
def test_thermometers_that_step_are_said_where_the_steps_are_most_of_their_noise(
    make_log, step: float, said: int
) -> None:
    """With 0.3 K of noise: steps of half a kelvin are within it."""

    def rounded(columns: dict[str, np.ndarray]) -> None:
        for k in range(1, 10):
            columns[f"t{k}_c"] = step * np.round(columns[f"t{k}_c"] / step)

    warnings = plausibility.coarse([read_log(make_log(effects=TRUE, change=rounded))])
    assert len(warnings) == said
    assert all(f"t8_c, t9_c step by {step:g} K" in one for one in warnings)


def by_resistance(name: str, number: str, value: float, unit: str) -> results.Effect:
    return resistance.told(name, 99.0, {number: results.Number(value=value, stderr=1e-4, unit=unit)})


def second(*effects: results.Effect) -> resistance.Second:
    told = results.Resistance(rows=1000, noise_ohm=1e-3, before_ohm=2e-3, after_ohm=1e-3, parameters={})
    return resistance.Second(told, list(effects), [])


def test_what_v_over_i_says_beside_wrong_temperatures_is_nothing_that_a_spring_can_have() -> None:
    rise = by_resistance("resistance_temperature", "resistance_austenite_rise_per_k", 0.0215, "1/K")
    contact = by_resistance("contact_resistance", "contact_ohm[5]", -0.008, "ohm")
    (said,) = doubt.impossible(second(contact, rise))
    assert said.startswith(
        "v / i does not go with the temperatures (resistance_austenite_rise_per_k would be 0.0215 1/K)"
    )
    assert doubt.impossible(second(contact)) == doubt.impossible(None) == []


def test_a_diagnosis_writes_no_model_that_its_readers_refuse(
    make_log, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def beside_a_wrong_clock(*_: object) -> resistance.Second:
        rise = by_resistance("resistance_temperature", "resistance_austenite_rise_per_k", 0.0215, "1/K")
        return second(by_resistance("resistance_phase", "resistance_austenite_ohm", 0.08, "ohm"), rise)

    monkeypatch.setattr(diagnosis.resistance, "witness", beside_a_wrong_clock)
    found = diagnosis.diagnose(Array(), [read_log(make_log())])
    assert found.effects == [] and found.result["warnings"][0].startswith("v / i does not go with the temperatures")
    write_atomically({tmp_path / "m.toml": model_text(found.model)})
    assert "resistance_austenite_ohm" not in read_model(tmp_path / "m.toml").parameters
