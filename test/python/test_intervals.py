"""How sure a fit is: intervals that hold the truth as often as they say, and numbers whose errors go together."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from ninespring.cli.main import cli
from ninespring.infer.fit import Fit
from ninespring.model.spec import Free, Spec

FREE = (
    Free("loss", 0.006, 0.001, 0.1, "W/K", log=True),
    Free("shift", 0.0, -40.0, 1.0, "K", scale=2.0),
    Free("stuck", 1.0, 0.0, 2.0, "1"),
)


def fitted() -> Fit:
    """Return a fit of a number by its logarithm (10 %), one in steps of 2 K (0.5 of them, near its bound), one that nothing fixes."""
    covariance = np.array([[0.01, 0.04, 0.0], [0.04, 0.25, 0.0], [0.0, 0.0, 1.0]])
    return Fit(Spec(free=FREE), np.array([0.006, 0.5, 1.0]), 0.0, 10, [], covariance=covariance, stuck=["stuck"])


def test_an_interval_is_in_the_coordinate_that_was_fitted_and_within_the_bounds() -> None:
    found = fitted().intervals()
    assert list(found) == ["loss", "shift"]
    assert found["loss"] == pytest.approx((0.006 * math.exp(-0.196), 0.006 * math.exp(0.196)), rel=1e-4)
    assert found["shift"] == pytest.approx((0.5 - 1.96, 1.0), abs=1e-4)


def test_a_number_that_the_data_hardly_fix_lies_anywhere_within_its_bounds() -> None:
    hardly = Fit(Spec(free=FREE[:1]), np.array([0.006]), 0.0, 10, [], covariance=np.array([[1e6]]))
    assert hardly.intervals()["loss"] == (0.001, 0.1)


def test_errors_that_go_together_are_told_without_those_that_nothing_fixes() -> None:
    assert fitted().correlations(0.1) == [("shift", "loss", pytest.approx(0.8))]
    assert fitted().correlations(0.9) == []


def test_fit_tells_intervals_and_correlations(make_log, tmp_path: Path) -> None:
    log = make_log(seconds=300, effects={"latent_heat": {"latent_heat_j": 8.0}})
    words = [
        "fit",
        str(log),
        "--effects",
        "latent_heat",
        "-o",
        str(tmp_path / "m.toml"),
        "--json",
        str(tmp_path / "f.json"),
    ]
    done = CliRunner().invoke(cli, words, standalone_mode=False)
    assert done.exception is None, done.output
    assert "in 95 of 100 cases" in done.output
    assert "errors that go together" in done.output
    found = json.loads((tmp_path / "f.json").read_text())
    for one in found["parameters"].values():
        if one["stderr"] is not None:
            low, high = one["interval_95"]
            assert low <= one["value"] <= high
            assert high - low == pytest.approx(2 * 1.96 * one["stderr"], rel=0.15) or one.get("note")
    low, high = found["parameters"]["latent_heat_j"]["interval_95"]
    assert low < 8.0 < high
    assert [abs(one["correlation"]) for one in found["correlations"]] == sorted(
        (abs(one["correlation"]) for one in found["correlations"]), reverse=True
    )
