"""Beside a cause that has no name in the library, a known one is named all the same; the other is told by its kind and size."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ninespring.find import diagnosis, search, unnamed
from ninespring.find.evidence import excess
from ninespring.infer.fit import Fit
from ninespring.infer.problem import Problem
from ninespring.infer.scene import scene_of
from ninespring.io.logs import read_log
from ninespring.model import effects, native
from ninespring.model.models import Array
from plants import a_plant

EDGES = {"edge_loss": {"edge_loss_fraction": 0.2}}
LATENT = {"latent_heat": {"latent_heat_j": 7.0}}
WAKE = {"fan_wake": {"wake_w_per_k": 1.5e-3}}
SWING, GUST = "all drives change again and again", "all losses change again and again"


def power_of(columns: dict[str, np.ndarray]) -> np.ndarray:
    """Return the power of each spring, (rows, springs), W."""
    return np.column_stack([columns[f"i{k + 1}_a"] ** 2 * 0.2 for k in range(9)])


def shifted(columns: dict[str, np.ndarray], by_k: np.ndarray) -> None:
    """Add (rows, springs), K, to the temperatures."""
    for k in range(9):
        columns[f"t{k + 1}_c"] = columns[f"t{k + 1}_c"] + by_k[:, k]


def astray(columns: dict[str, np.ndarray], extra: np.ndarray, effects: dict[str, dict[str, float]] = EDGES) -> None:
    """Add to the temperatures what heat beside that of the currents makes of the same array."""
    rows = len(columns["fan"])
    plant = a_plant((3, 3), effects)
    time_s, fan, around = np.arange(float(rows)), columns["fan"], np.full(rows, 20.0)
    power, shown = power_of(columns), []
    for watts in (power, power + extra):
        twin = plant.copy()
        twin.reset()
        shown.append(twin.simulate(time_s, native.POWER, watts, fan, around))
    shifted(columns, shown[1] - shown[0])


def heated(columns: dict[str, np.ndarray], spring: int, watts: Any, effects: Any = EDGES) -> None:
    """Give one spring, from 1, so much more, (rows,) or always, W."""
    extra = np.zeros((len(columns["fan"]), 9))
    extra[:, spring - 1] = watts
    astray(columns, extra, effects)


def fitted(
    make_log: Callable[..., Path], names: Sequence[str] = (), **kind: Any
) -> tuple[Problem, Fit, list[unnamed.Cause]]:
    """Return a log's problem, the declared model fitted with some effects, and all causes without a name around it."""
    problem, fit, _ = diagnosis.fit_effects(Array(), [read_log(make_log(seed=3, **kind))], names)
    return problem, fit, unnamed.library(problem, fit)


def taken_whole(kinds: Sequence[unnamed.Cause], text: str) -> list[unnamed.Hidden]:
    """Return the first cause of these words as one that is there all the time."""
    one = next(one for one in kinds if one.text == text)
    return [unnamed.Hidden(one, one.text, (0, None), one.columns)]


def diagnosed(make_log: Callable[..., Path], seeds: tuple[int, ...] = (3, 4), **kind: Any) -> dict[str, Any]:
    """Diagnose logs of one kind, one a seed: effects and change as `make_log` takes them."""
    runs = [read_log(make_log(f"{seed}.csv", seed=seed, **kind)) for seed in seeds]
    return diagnosis.diagnose(Array(), runs).result


def crosstalk(columns: dict[str, np.ndarray]) -> None:
    """Let the drive of spring 1 heat spring 9 by a fifth."""
    heated(columns, 9, 0.2 * columns["i1_a"] ** 2 * 0.2)


@pytest.mark.nightly
def test_a_known_effect_is_named_beside_heat_that_goes_astray(make_log) -> None:
    found = diagnosed(make_log, effects=EDGES, change=crosstalk)
    (named,) = found["effects"]
    assert named["name"] == "edge_loss"
    assert named["parameters"]["edge_loss_fraction"]["value"] == pytest.approx(0.2, abs=0.01)
    assert found["unexplained"]
    (cause,) = found["unnamed"]
    assert "the drive of spring 1 also heats spring 9" in cause["text"]
    assert cause["size"] == pytest.approx(0.2, abs=0.01)


def test_a_name_goes_before_what_has_none(make_log) -> None:
    """Thermometers that show more, beside heat that goes astray, are no heat that comes with the drives."""

    def change(columns: dict[str, np.ndarray]) -> None:
        crosstalk(columns)
        for k in range(9):
            columns[f"t{k + 1}_c"] = 1.05 * columns[f"t{k + 1}_c"]

    problem, fit, kinds = fitted(make_log, ["edge_loss"], effects=EDGES, change=change)
    first = search.Search(problem, effects.candidates(scene_of(problem)), fit)
    alone = unnamed.find(problem, fit, kinds, ())
    before_it = unnamed.find(problem, fit, [*kinds, *unnamed._named(problem, first, fit)], ())
    assert [one.cause.kind for one in before_it] == ["crosstalk"] and len(alone) > 1


def drying(columns: dict[str, np.ndarray]) -> None:
    """Let every loss rise by a third over the run, and log no ambient."""
    over = np.column_stack([columns[f"t{k + 1}_c"] for k in range(9)]) - 20.0
    ramp = np.linspace(0.0, 1.0, len(over))[:, None]
    astray(columns, -0.34 * ramp * 0.006 * over / (1.0 + 0.34 * ramp), {})
    del columns["ambient_c"]


@pytest.mark.nightly
def test_a_cause_that_stood_for_names_is_taken_as_it_is_by_the_numbers_that_it_had_spoilt(
    make_log, monkeypatch: pytest.MonkeyPatch
) -> None:
    libraries: list[list[unnamed.Cause]] = []
    taken: list[unnamed.Hidden] = []
    library, taken_out = unnamed.library, unnamed.taken_out

    def library_of(*around: Any) -> list[unnamed.Cause]:
        libraries.append(library(*around))
        return libraries[-1]

    def take(problem: Any, fit: Any, hidden: list[unnamed.Hidden]) -> list[unnamed.Hidden]:
        taken.extend([] if taken else hidden)
        return taken_out(problem, fit, hidden)

    monkeypatch.setattr(unnamed, "library", library_of)
    monkeypatch.setattr(unnamed, "taken_out", take)
    found = diagnosed(make_log, seeds=(3,), change=drying)
    assert not found["effects"] and found["unnamed"][0]["text"].startswith("all losses change")
    assert len(libraries) == 2 and taken and all(any(one.cause is k for k in libraries[1]) for one in taken)


def swinging(columns: dict[str, np.ndarray], period_s: float) -> np.ndarray:
    """Return heat by which every spring is heated more and less, by a third, (rows, springs), W."""
    power = power_of(columns)
    return power * np.sin(np.arange(float(len(power))) / period_s * 2.0 * np.pi)[:, None] / 3.0


def swinging_drives(columns: dict[str, np.ndarray]) -> None:
    """Let every spring be heated more and less within ten minutes."""
    astray(columns, swinging(columns, 600.0), LATENT)


def test_what_comes_and_goes_within_a_minute_leaves_nothing_that_matters(make_log) -> None:
    change = lambda columns: astray(columns, swinging(columns, 80.0))  # noqa: E731
    problem, fit, kinds = fitted(make_log, ["edge_loss"], effects=EDGES, change=change)
    unnamed.taken_out(problem, fit, taken_whole(kinds, SWING))
    beside = problem.fit(fit.spec, fit.as_dict())
    assert excess(problem, beside) < 0.5**2 < 3.0**2 < excess(problem, fit)


def test_only_one_cause_comes_and_goes_as_it_likes(make_log) -> None:
    def warmed(columns: dict[str, np.ndarray]) -> None:
        astray(columns, np.zeros((600, 9)) + 0.15 * np.sin(np.arange(600.0) / 11.0)[:, None])

    problem, fit, kinds = fitted(make_log, change=warmed)
    (first, *_) = unnamed.find(problem, fit, kinds, ())
    assert first.cause.bumps
    hidden = unnamed.taken_out(problem, fit, taken_whole(kinds, GUST))
    found = unnamed.find(problem, problem.evaluate(fit), kinds, hidden)
    assert len(found) > 1 and sum(bool(one.cause.bumps) for one in found) == 1


MISMATCH = {"spring_mismatch": {"loss_scale[6]": 1.18}}


def swinging_losses(columns: dict[str, np.ndarray]) -> None:
    """Let every loss swing by a third within eleven minutes, about that of an array with one other spring."""
    rows, power, shown = len(columns["fan"]), power_of(columns), []
    for size in (0.0, 0.33):
        plant = a_plant((3, 3), MISMATCH, {"ambient_c": 20.0})
        still, blown = plant.get("loss_w_per_k"), plant.get("loss_fan_w_per_k")
        out = np.empty((rows, 9))
        for row in range(rows):
            swing = 1.0 + size * np.sin(2.0 * np.pi * row / 660.0)
            plant.set_all({"loss_w_per_k": still * swing, "loss_fan_w_per_k": blown * swing})
            here = slice(row, row + 2)
            time_s = np.arange(2.0)[: len(power[here])]
            out[row] = plant.simulate(time_s, native.POWER, power[here], columns["fan"][here])[0]
        shown.append(out)
    shifted(columns, shown[1] - shown[0])


def test_what_comes_and_goes_slowly_needs_few_numbers(make_log) -> None:
    """Beside another spring that nothing has named yet, which leaves few samples that are independent."""
    found = unnamed.find(*fitted(make_log, effects=MISMATCH, change=swinging_losses, seconds=900), ())
    (swing,) = (one for one in found if one.cause.bumps)
    assert len(swing.cause.bumps) < 20


def test_small_causes_at_a_spring_are_no_reason_to_doubt_its_name(make_log) -> None:
    """All the time they would nearly explain the other loss of that spring; they are as small as they were found."""
    log = read_log(make_log(seed=3, effects=MISMATCH))
    problem, fit, base = diagnosis.fit_effects(Array(), [log], ["spring_mismatch"])
    places = ("the drive of spring 6 changes", "spring 6 is given heat", "thermometer 6 shows more")
    kinds = [one for one in unnamed.library(problem, fit) if one.edges and one.text.startswith(places)]
    assert len(kinds) == 3
    hidden = [unnamed.Hidden(one, one.text, (200, 260), np.zeros(()), 0.01) for one in kinds]
    hidden = unnamed.taken_out(problem, fit, hidden)
    first = search.Search(problem, effects.candidates(scene_of(problem)), base)
    result = (problem.evaluate(fit), {"spring_mismatch": problem.evaluate(base)}, [])
    _, kept, _ = unnamed._or_lasting(problem, first, result, hidden)
    assert kept is result


def test_what_comes_and_goes_is_straight_between_edges_as_far_apart_as_it_says(make_log) -> None:
    gusts = [one for one in fitted(make_log)[2] if one.text == GUST]
    assert [len(one.bumps) for one in gusts] == [41, 21, 11, 6]
    for one in gusts:
        # all together they are there all the time, however wide each is
        together = sum(unnamed.bump(*times, 600) for _, *times in one.bumps)
        assert np.allclose(together, 1.0)
        # and that is left to the declared loss
        assert np.allclose(one.columns.sum(axis=1), 0.0, atol=1e-3 * np.abs(one.columns).max())


def test_losses_that_come_and_go_explain_nothing_by_being_there_all_the_time(make_log) -> None:
    """Springs that differ: no loss of all of them comes and goes, and heat that is lost as the readings have it would explain any error."""
    differ = {"spring_mismatch": {f"loss_scale[{k + 1}]": 0.9 + 0.2 * (k % 2) for k in range(9)}}
    runs = [read_log(make_log(f"{seed}.csv", seed=seed, effects=differ, noise=0.1)) for seed in (3, 4)]
    problem, fit, _ = diagnosis.fit_effects(Array(), runs, [])
    kinds = unnamed.library(problem, fit)
    assert not unnamed.find(problem, fit, kinds, (), most=1)
    (gust,) = taken_whole(kinds, GUST)
    column = gust.around(problem, fit).column
    left = np.concatenate(problem.scaled(fit.residual))
    size, _ = unnamed._least_squares(column.T @ column, column.T @ left)
    assert float(size @ (column.T @ left)) < 0.3 * float(left @ left)


def test_a_name_goes_before_what_comes_and_goes_at_its_spring(make_log) -> None:
    blown = lambda columns: heated(columns, 6, 0.1 * np.sin(np.arange(600.0) / 9.0), {})  # noqa: E731
    at_spring = []
    for names in ([], ["spring_mismatch"]):
        found = unnamed.find(*fitted(make_log, names, change=blown), ())
        at_spring.append([one.text for one in found if one.cause.bumps])
    assert at_spring == [["spring 6 is given heat again and again"], []]


def test_no_drift_of_a_logged_ambient_is_a_name_beside_what_comes_and_goes(make_log) -> None:
    change = lambda columns: astray(columns, swinging(columns, 80.0), {})  # noqa: E731
    problem, fit, kinds = fitted(make_log, change=change)
    first = search.Search(problem, effects.candidates(scene_of(problem)), fit)
    drifts = [
        {one.variant for one in unnamed._beside(problem, first, beside).candidates if one.effect == "ambient_drift"}
        for beside in ([], taken_whole(kinds, SWING))
    ]
    assert drifts == [{"ramp", "free"}, {"ramp"}]


def test_a_name_has_its_size_beside_heat_that_moves_the_transformation(make_log) -> None:
    problem, alone, kinds = fitted(make_log, ["latent_heat"], effects=LATENT, change=swinging_drives)
    hidden = unnamed.taken_out(problem, alone, taken_whole(kinds, SWING))
    straight = problem.fit(alone.spec, alone.as_dict())
    fit, _ = unnamed.simulated(problem, straight, hidden)
    assert fit.sse < 1.5 * fit.count < straight.sse
    assert fit.value("latent_heat_j") == pytest.approx(7.0, rel=0.25)


def test_nothing_without_a_name_where_the_library_explains_all(make_log) -> None:
    found = diagnosed(make_log, effects=EDGES)
    assert found["unnamed"] == [] and not found["unexplained"]


@pytest.mark.nightly
def test_a_trickle_of_heat_is_no_thermometer_with_an_offset(make_log) -> None:
    """What the library would take for a false thermometer is told as what it is, where that explains more."""
    found = diagnosed(make_log, seeds=(3,), effects=EDGES, change=lambda columns: heated(columns, 4, 0.06))
    assert [one["name"] for one in found["effects"]] == ["edge_loss"] and found["unexplained"]
    (cause,) = found["unnamed"]
    assert "spring 4 is given heat, 0 to 599 s of run 1" in cause["text"]
    assert cause["size"] == pytest.approx(0.06, abs=0.005)


@pytest.mark.nightly
def test_names_that_stand_in_for_a_trickle_of_heat_go_and_the_true_one_stays(make_log) -> None:
    """A thermometer's gain and a spring's own loss would explain it together, beside the latent heat that is there."""
    found = diagnosed(make_log, effects=LATENT, change=lambda columns: heated(columns, 7, 0.06, LATENT))
    assert [one["name"] for one in found["effects"]] == ["latent_heat"] and found["unexplained"]
    assert any("spring 7 is given heat all the time" in one["text"] for one in found["unnamed"])


def test_a_thermometer_that_comes_loose_is_none_that_always_shows_less(make_log) -> None:
    """Were it false all the time, it would have to be right again where the logs begin: the simpler words are the unnamed."""

    def loosens(columns: dict[str, np.ndarray]) -> None:
        columns["t2_c"][150:] = 20.0 + 0.7 * (columns["t2_c"][150:] - 20.0)

    found = diagnosed(make_log, seeds=(3,), effects=WAKE, change=loosens)
    assert [one["name"] for one in found["effects"]] == ["fan_wake"] and not found["unexplained"]
    (cause,) = found["unnamed"]
    assert "thermometer 2 shows less of its spring's rise, 150 to 599 s of run 1" in cause["text"]
    assert cause["size"] == pytest.approx(-0.3, abs=0.01)


def test_what_only_leads_on_what_is_there_is_not_found_the_other_way_round(make_log) -> None:
    """A thermometer that shows more than its spring's own rise over a neighbour's sees no spring by less than nothing."""

    def apart(columns: dict[str, np.ndarray]) -> None:
        columns["t2_c"] = columns["t2_c"] + 0.08 * (columns["t2_c"] - columns["t3_c"])

    found = diagnosed(make_log, seeds=(3,), change=apart, seconds=300)
    assert found["unexplained"] or found["effects"]
    assert all(one["size"] > 0 for one in found["unnamed"] if one["kind"] in unnamed.GIVES_ONLY)


def told(kind: str, text: str, *sizes: float) -> list[unnamed.Hidden]:
    """Return unnamed causes of one kind and place, each with its size, that begin at 60 s, 120 s ... and stay."""
    cause = unnamed.Cause(kind, text, (), np.zeros((0, 1)))
    starts = [60 * (n + 1) for n in range(len(sizes))]
    return [
        unnamed.Hidden(cause, text.format(f"{start} to 899 s"), (start, 900), cause.columns, size, 0.03)
        for start, size in zip(starts, sizes, strict=True)
    ]


@pytest.mark.parametrize(
    ("kind", "text", "size", "words"),
    [
        ("heat", "spring 2 is given heat, {} of run 1", -0.5, "spring 2 loses heat, 60 to 899 s of run 1: 0.50 W"),
        ("heat", "spring 2 is given heat, {} of run 1", 0.5, "spring 2 is given heat, 60 to 899 s of run 1: 0.50 W"),
        (
            "share",
            "thermometer 2 shows more of its spring's rise, {}",
            -0.3,
            "thermometer 2 shows less of its spring's rise",
        ),
        ("surroundings", "the surroundings are warmer, {}", -2.0, "the surroundings are cooler, 60 to 899 s: 2.00 K"),
        ("gust", "all losses change, {}", -0.4, "all losses change, 60 to 899 s: -40 %"),
    ],
)
def test_a_negative_size_is_said_in_words_that_have_none(kind: str, text: str, size: float, words: str) -> None:
    (cause,) = told(kind, text, size)
    said = cause.told()
    assert said.text.startswith(words) and said.size == size


def test_no_part_loses_more_than_all() -> None:
    assert not told("gust", "all losses change, {}", -1.01)[0].possible
    assert told("gust", "all losses change, {}", -0.9)[0].possible
    assert told("heat", "spring 1 is given heat, {}", -2.0)[0].possible
