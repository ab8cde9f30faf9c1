"""A run alone whose springs rest elsewhere than where its room was logged: found from there where one after the other is not."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from ninespring.find import diagnosis, lasting, rested, search, unnamed
from ninespring.infer.fit import Fit
from ninespring.infer.likelihood import Colour
from ninespring.io.logs import log_text, read_log
from ninespring.io.logs.run import Run
from ninespring.model import native
from ninespring.model.effects import Candidate, alloy
from ninespring.model.models import Array, Model
from ninespring.model.spec import RUN_AMBIENT, Free, Spec
from plants import a_plant

ALLOY = {"austenite_start_c": 48.0, "austenite_finish_c": 58.0, "martensite_start_c": 42.0, "martensite_finish_c": 32.0}
"""As it is declared; it transforms elsewhere, in a broad and narrow loop."""


def pulse(path: Path, seed: int, room_c: float = 22.0, logged_c: float = 19.0, warm_k: float = 0.0) -> Run:
    """Return a single pulse of a wire with latent heat whose errors last for seconds, its room logged where it is not."""
    rng = np.random.default_rng(seed)
    step_s = 0.4
    time_s = np.arange(0.0, 300.0, step_s)
    drive = 0.1 * np.exp(-0.5 * ((time_s - 20.0) / 5.5) ** 2)
    drive[drive < 0.004] = 0.0
    numbers = {"heat_capacity_j_per_k": 0.3, "loss_w_per_k": 0.007, "latent_heat_j": 6.0, "command_power_w": 16.0}
    numbers |= {"austenite_start_c": 33.0, "austenite_finish_c": 49.0, "ambient_c": room_c}
    numbers |= {"martensite_start_c": 47.0, "martensite_finish_c": 28.0}
    plant = a_plant((1, 1), ["latent_heat"], numbers)
    plant.set_temperature(0, room_c + warm_k)
    shown = plant.simulate(time_s, native.COMMAND, drive[:, None], ambient_c=np.full(len(time_s), room_c))
    lasts = np.zeros(len(time_s))
    for k in range(1, len(time_s)):
        lasts[k] = lasts[k - 1] * np.exp(-step_s / 8.0) + 0.3 * np.sqrt(2.0 * step_s / 8.0) * rng.normal()
    shown = shown[:, 0] + lasts + rng.normal(0.0, 0.1, len(time_s))
    path.write_text(log_text(time_s, {"u1": drive, "t1_c": shown, "ambient_c": np.full(len(time_s), logged_c)}))
    return read_log(path, 1)


def diagnosed(run: Run) -> diagnosis.Diagnosis:
    model = Model(Array(1, 1))
    model.parameters = {"command_power_w": 10.0} | ALLOY
    return diagnosis.diagnose(Array(1, 1), [run], model=model)


def names(found: diagnosis.Diagnosis) -> set[str]:
    return {*found.effects, *(one.name for one in found.told.runs_differ)}


def test_a_room_and_an_alloy_that_only_show_together_are_found_from_where_the_spring_rests(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = pulse(tmp_path / "pulse.csv", 2)
    # one after the other nothing is found
    monkeypatch.setattr(search.Search, "run", lambda self, downwards=True: (self.base, {}, []))
    monkeypatch.setattr(lasting, "search_lasting", lambda problem, first, final: (first, (final, {}, [])))
    monkeypatch.setattr(unnamed, "search_beside", lambda *_: None)
    found = diagnosed(run)
    assert names(found) == {"latent_heat", RUN_AMBIENT}
    assert found.final.value("ambient_offset_k@1") == pytest.approx(3.0, abs=0.7)
    assert found.final.value("latent_heat_j") == pytest.approx(6.0, rel=0.3)
    assert found.told.after.rmse_c < 0.4 < 1.5 < found.told.baseline.rmse_c
    assert all(one.probability >= 0.5 for one in found.told.runs_differ), "what is told is named"
    assert not any("before anything was driven" in text for text in found.told.warnings)
    monkeypatch.setattr(diagnosis, "_rested", lambda *_: None)
    found = diagnosed(run)
    assert names(found) == set()
    assert any("springs read 3.0 K more than ambient_c" in text for text in found.told.warnings)


def test_a_spring_that_is_still_warm_is_in_its_logged_room_and_that_it_rests_elsewhere_is_said(
    briefly: None, tmp_path: Path
) -> None:
    found = diagnosed(pulse(tmp_path / "pulse.csv", 1, logged_c=22.0, warm_k=2.0))
    assert RUN_AMBIENT not in names(found)
    assert any("springs read" in text and "K more than ambient_c" in text for text in found.told.warnings)


@pytest.mark.parametrize(
    ("rests_k", "absent", "off"), [(1.7, 0.0, 1.7), (-1.7, 0.0, -1.7), (0.9, 0.0, None), (1.7, None, None)]
)
def test_a_room_is_looked_for_where_a_run_rests_further_from_the_logged_one_than_rooms_move(
    rests_k: float, absent: float | None, off: float | None
) -> None:
    free = Free("ambient_offset_k@1", rests_k, -20.0, 20.0, "K", run=0, prior=1.0, absent=absent)
    room = SimpleNamespace(effect=RUN_AMBIENT, free=(free,))
    other = SimpleNamespace(effect="sensor_lag", free=())
    found: Any = SimpleNamespace(candidates=[other, room])
    assert rested.off_k(found) == off
    found.candidates = [other]
    assert rested.off_k(found) is None


def test_a_narrow_loop_has_bands_as_wide_as_they_mostly_are_about_nearly_one_middle() -> None:
    place = alloy.closed({alloy.SHIFT: -10.0}, ALLOY.__getitem__)
    heating, cooling = (10.0 + place[key] for key in (alloy.HEATING, alloy.COOLING))
    assert heating == cooling == alloy.USUAL_K
    start, finish = 38.0 + 0.5 * place[alloy.HYSTERESIS], 32.0 - 0.5 * place[alloy.HYSTERESIS]
    assert start + 0.5 * heating - (finish - 0.5 * cooling) == pytest.approx(alloy.CLOSED_K)
    native.Plant(1, 1).set_all(
        {"austenite_start_c": start, "austenite_finish_c": start + heating}
        | {"martensite_start_c": finish, "martensite_finish_c": finish - cooling}
    )


@pytest.mark.parametrize(
    ("off", "beside", "nats", "rather"),
    [
        (1.0, 1.1, -20.0, True),
        (1.0, 1.04, -1.0, False),
        (1.0, 1.04, 1.0, True),
        (1.0, 0.97, 1.0, True),
        (1.1, 1.0, 90.0, False),
    ],
)
def test_an_account_from_where_it_rests_foretells_better_or_as_well_and_is_likelier(
    monkeypatch: pytest.MonkeyPatch, off: float, beside: float, nats: float, rather: bool
) -> None:
    monkeypatch.setattr(diagnosis, "_off", lambda case, *_: case.off_k)
    monkeypatch.setattr(diagnosis, "log_evidence", lambda *_: nats)
    one, other = (SimpleNamespace(off_k=k, problem=None, final=None) for k in (off, beside))
    accounts: Any = ((one, None, None), (other, None, None))
    assert diagnosis._rather(*accounts) is rather


@pytest.mark.parametrize(
    ("more", "worse", "tells", "needed"),
    [(40.0, 1.0, False, True), (10.0, 1.0, False, False), (10.0, 1.0, True, True), (40.0, 0.9, True, False)],
)
def test_a_name_is_needed_by_errors_that_are_the_same_without_it_and_by_the_unseen(
    more: float, worse: float, tells: bool, needed: bool
) -> None:
    """By 3 nats at least beyond its price, half the logarithm of a thousand readings and of two to choose from."""
    spec = Spec((RUN_AMBIENT,), free=(Free("ambient_offset_k@1", 0.0, -20.0, 20.0, "K", effect=RUN_AMBIENT),))
    fit = Fit(spec, np.array([2.0]), 500.0, 1000, [])
    other = replace(fit, spec=Spec(), values=np.array([]), chi2=500.0 + 0.5 * more)
    found: Any = SimpleNamespace(problem=SimpleNamespace(colour=Colour(white=0.5)), price=lambda: math.log(2.0))
    off = {id(fit): 1.0, id(other): worse}
    judged_by: Any = SimpleNamespace(own=lambda one: off[id(one)], tells=lambda *_: tells)
    assert rested._needed(found, judged_by, fit, other) is needed


def test_a_blur_that_begins_at_several_widths_is_no_alloy() -> None:
    numbers = [(Free(key, 0.0, -1.0, 1.0, "K", effect="one"),) for key in ("blur_fraction", alloy.SHIFT)]
    blur, latent = candidates = [Candidate("", free, ({},), alternatives=True) for free in numbers]
    assert rested.alloys(candidates) == [latent] and blur not in rested.alloys(candidates)
