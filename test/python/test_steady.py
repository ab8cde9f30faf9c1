"""Steady tables: the number behind an effect is found again, what is left out is foretold, bad tables are refused."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from ninespring.errors import InputError
from ninespring.find import steady
from ninespring.io import results
from ninespring.model.models import Array

MIXING = {"optical_mixing": {"optical_share": 0.3}}


def states(on: dict[str, dict[str, float]]) -> list[steady.State]:
    """Return six states of held springs around an idle centre, as the paper has them, with effects on."""
    out = []
    for pitch in (4.0, 5.0, 6.0):
        for fan in (0.0, 1.0):
            hold = np.full(9, 99.0)
            hold[4] = math.nan
            empty = np.full(9, math.nan)
            state = steady.State(f"{pitch:g} mm, fan {fan:g}", pitch, fan, 20.0, hold, empty, empty.copy())
            state.measured_c[4] = steady.settle(Array(), {}, on, state)[4]
            out.append(state)
    return out


def test_the_number_behind_six_states_is_found_again() -> None:
    told = steady.diagnose_states(Array(), {}, states(MIXING))
    result = results.plain(told)
    found = result["effects"][0]
    assert found["name"] == "optical_mixing"
    assert found["parameters"]["optical_share"]["value"] == pytest.approx(0.3, rel=0.01)
    assert result["after"]["holdout_rmse_c"] < 0.1 < 5.0 < result["baseline"]["rmse_c"]
    assert results.checked(told)


def test_the_model_afterwards_has_everything_that_was_set() -> None:
    truth = {"plate_conduction": {"plate_coupling_w_per_k": 0.004, "plate_loss_w_per_k": 0.01}}
    table = states(truth)
    told = steady.diagnose_states(Array(), {}, table)
    assert told.effects[0].name == "plate_conduction"
    model = steady.model_after(told, None, Array())
    on = {"plate_conduction": {k: v for k, v in model.parameters.items() if k.startswith("plate_")}}
    assert np.abs(steady.errors(Array(), {}, on, table)).max() < 0.2


def test_of_a_row_all_that_was_measured_is_told() -> None:
    table = states(MIXING)[:3]
    table[0].measured_c[:] = math.nan
    for one in table[1:]:
        one.measured_c[3:6] = steady.settle(Array(), {}, MIXING, one)[3:6]
    told = steady.diagnose_states(Array(), {}, table)
    assert told.effects[0].name == "optical_mixing"
    named = [f"{one.case}, spring {k}" for one in table[1:] for k in (4, 5, 6)]
    assert [one.case for one in told.cases] == named
    shown = np.concatenate([one.measured_c[3:6] for one in table[1:]])
    assert [one.after_c for one in told.cases] == pytest.approx(list(shown), abs=0.3)


def test_a_state_that_is_left_out_is_not_fitted() -> None:
    table = states(MIXING)
    table[0].measured_c[4] += 10.0
    best = steady.diagnose_states(Array(), {}, table).after
    # one of six that no number explains: left out, it pulls the number no longer
    assert best.holdout_rmse_c > 1.08 * best.rmse_c


def test_nothing_is_adopted_where_the_declared_model_is_right() -> None:
    told = steady.diagnose_states(Array(), {}, states({}))
    assert told.effects == [] and told.baseline.rmse_c < 1e-6


@pytest.mark.parametrize(
    ("text", "where", "words"),
    [
        ("case,pitch_mm,hold1_c,t5_c,t5_f\na,4,99,50,1\n", ":1:28:", "unknown column 't5_f'"),
        ("case,hold1_c,i1_a,t5_c\na,99,1.5,50\n", ":2:3:", "both a current and a prescribed temperature"),
        ("case,hold1_c,t5_c\na,99,\n", ":1:1:", "no measured temperature"),
    ],
)
def test_a_wrong_table_is_refused_where_it_is_wrong(tmp_path: Path, text: str, where: str, words: str) -> None:
    path = tmp_path / "steady.csv"
    path.write_text(text)
    with pytest.raises(InputError) as refused:
        steady.read_steady(path)
    assert where in str(refused.value) and words in str(refused.value)
