"""Noise, autocorrelation, structure: against what is known."""

from __future__ import annotations

import numpy as np
import pytest
from ninespring.io import statistics


def test_the_noise_is_found_under_a_smooth_curve_and_outliers() -> None:
    rng = np.random.default_rng(1)
    curve = 20 + 60 * (1 - np.exp(-np.arange(900.0) / 50))[:, None]
    series = curve + rng.normal(0, 0.3, (900, 9))
    series[::100] += 30.0
    assert statistics.noise_floor(series) == pytest.approx(np.full(9, 0.3), rel=0.12)
    # read half way between two readings of another clock
    between = 0.5 * (series[1:] + series[:-1])
    assert statistics.noise_floor(between) == pytest.approx(np.full(9, 0.3 / np.sqrt(2.0)), rel=0.12)


def test_correlated_residuals_count_less() -> None:
    rng = np.random.default_rng(2)
    white = rng.normal(size=(60000, 1))
    red = np.zeros_like(white)
    for k in range(1, len(red)):
        red[k] = 0.9 * red[k - 1] + white[k]
    assert statistics.correlation_factor([white], 200) == pytest.approx(1.0, abs=0.3)
    assert statistics.correlation_factor([red], 200) == pytest.approx(19.0, rel=0.3)


def test_structure_is_zero_for_white_noise_and_its_variance_otherwise() -> None:
    rng = np.random.default_rng(3)
    noise = [np.full(9, 0.3)]
    white = rng.normal(0, 0.3, (900, 9))
    wave = 0.3 * np.sqrt(2) * np.sin(np.arange(900.0) / 60)[:, None]
    starts = [[0]]
    assert abs(np.mean(statistics.structure([white], noise, 12, starts))) < 0.02
    assert np.mean(statistics.structure([white + wave], noise, 12, starts)) == pytest.approx(1.0, rel=0.1)
    # read between two readings of another clock: neighbours share their noise, and that is none either
    for part in (0.25, 0.5):
        between = (1 - part) * white[1:] + part * white[:-1]
        own = [statistics.noise_floor(between)]
        for width in (4, 12, 40):
            assert abs(np.mean(statistics.structure([between], own, width, starts))) < 0.03
        seen = np.mean(statistics.structure([between + wave[1:]], own, 12, starts)) * np.mean(own[0]) ** 2
        assert seen == pytest.approx(0.09, rel=0.1)


def test_a_spike_is_found_and_a_step_is_not() -> None:
    rng = np.random.default_rng(4)
    series = rng.normal(0, 0.1, (400, 2))
    series[200:, 1] += 5.0
    series[77, 0] += 3.0
    found = statistics.spikes(series, np.full(2, 0.1))
    assert found[77, 0] and found.sum() == 1
    restless = np.concatenate([rng.normal(0, 0.1, (200, 1)), rng.normal(0, 1.0, (200, 1))])
    assert statistics.spikes(restless, np.array([0.1])).sum() <= 4


def test_missing_values_count_as_absent() -> None:
    rng = np.random.default_rng(6)
    white = rng.normal(0, 0.3, (3000, 3))
    white[rng.random(white.shape) < 0.3] = np.nan
    assert statistics.autocorrelation([white], 5)[1:] == pytest.approx(np.zeros(5), abs=0.05)
    red = np.zeros((30000, 2))
    steps = rng.normal(size=red.shape)
    for k in range(1, len(red)):
        red[k] = 0.9 * red[k - 1] + steps[k]
    red[rng.random(red.shape) < 0.3] = np.nan
    assert statistics.autocorrelation([red], 2)[1:] == pytest.approx([0.9, 0.81], abs=0.03)
    assert statistics.rms([white]) == pytest.approx(0.3, rel=0.05)
    assert abs(np.nanmean(statistics.structure([white], [np.full(3, 0.3)], 12, [[0]]))) < 0.03
