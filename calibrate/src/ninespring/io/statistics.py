"""Statistics of residuals: noise floor, autocorrelation, structure. Series are (rows, springs), NaN where missing.

Nothing here knows what a spring is.
"""

from __future__ import annotations

import itertools
import math
import warnings
from collections.abc import Sequence

import numpy as np

_CLIPPED_STD = 0.9866
"""Standard deviation of a unit normal cut at +-3."""
STANDS = 0.25
"""Part of the rows in which a column that steps does not move."""


def clipped_std(values: np.ndarray) -> float:
    """Return the standard deviation of `values` about zero, blind to outliers (cut at 3 sigma, iterated)."""
    values = values[np.isfinite(values)]
    if values.size < 4:
        return float("nan")
    scale = float(np.sqrt(np.mean(values**2)))
    middle = 1.4826 * float(np.median(np.abs(values)))
    if middle > 0:
        scale = min(scale, 3.0 * middle)
    for _ in range(20):
        inside = values[np.abs(values) <= 3.0 * scale]
        if inside.size < 4:
            return scale
        new = float(np.sqrt(np.mean(inside**2))) / _CLIPPED_STD
        if abs(new - scale) <= 1e-6 * scale:
            break
        scale = new
    return scale


def noise_floor(series: np.ndarray, starts: Sequence[int] = (0,)) -> np.ndarray:
    """Return the white noise of each column, from third differences, same unit as `series`.

    Third differences remove anything smooth; white noise of variance s^2 leaves 20 s^2 in them. Outliers
    and the few kinks where an input steps are cut. Columns with too few values give NaN. Readings put onto another clock by
    straight lines share their noise with the next and look up to twice too clean: every second row tells, where it says
    no more than that.
    """
    near, apart, tells = _near_and_apart(series, starts)
    return np.where(tells, np.fmax(near, apart), near)


def rounding(series: np.ndarray, starts: Sequence[int] = (0,)) -> np.ndarray:
    """Return what steps of each column leave in it, rms, where they hide its noise; 0 elsewhere.

    A column that is the same from row to row a quarter of the time steps: by the least that it usually moves. Third differences of
    such a one are mostly nothing, and call it clean.
    """
    noise = np.nan_to_num(noise_floor(series, starts))
    out = np.zeros(series.shape[1])
    for k in range(series.shape[1]):
        moved = np.abs(np.diff(series[:, k]))
        moved = moved[np.isfinite(moved)]
        if moved.size and (moved == 0.0).mean() >= STANDS and (moved > 0.0).any():
            out[k] = np.quantile(moved[moved > 0.0], 0.1) / np.sqrt(12.0)
    return np.where(out > noise, out, 0.0)


def last_digit(values: np.ndarray | None) -> float:
    """Return the last decimal place in which numbers were written, as a step; 0 where that is beyond the sixth, or there are none."""
    for step in () if values is None else (1.0, 0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6):
        if np.all(np.abs(values - step * np.round(values / step)) < 1e-9):
            return step
    return 0.0


def shared_noise(series: np.ndarray, starts: Sequence[int] = (0,)) -> np.ndarray:
    """Return the correlation of each column's noise with the next row's: 0 if white, up to 1 / 2 between readings of another clock.

    A share r leaves 20 - 30 r of a variance in third differences, and 20 in those of every second row.
    """
    near, apart, tells = _near_and_apart(series, starts)
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.clip((1.0 - (near / apart) ** 2) / 1.5, 0.0, 0.5)
    return np.where(tells, share, 0.0)


def _near_and_apart(series: np.ndarray, starts: Sequence[int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return each column's white noise by every row, by every second one, and whether the latter tells of the former."""
    near, apart = (_third_differences(series, starts, stride) for stride in (1, 2))
    return near, apart, apart <= 1.1 * 2.0 * near  # a tenth: chance


def _third_differences(series: np.ndarray, starts: Sequence[int], stride: int) -> np.ndarray:
    """Return the white noise of each column by its values so many rows apart."""
    out = []
    for column in series.T:
        pieces = [column[:0]]
        for begin, end in itertools.pairwise([*starts, len(column)]):
            if end - begin > 3 * stride:
                a, b, c, d = (column[begin + j * stride : end - (3 - j) * stride] for j in range(4))
                pieces.append(d - 3 * c + 3 * b - a)
        out.append(clipped_std(np.concatenate(pieces)) / np.sqrt(20.0))
    return np.array(out)


def autocorrelation(series: Sequence[np.ndarray], lags: int) -> np.ndarray:
    """Return the autocorrelation at lags 0..lags pooled over all columns of all runs, about zero mean.

    Missing values count as absent. A model's residual must have mean zero too, so the mean is not removed.
    """
    top = np.zeros(lags + 1)
    count = np.zeros(lags + 1)
    for run in series:
        good = np.isfinite(run)
        value = np.where(good, run, 0.0)
        size = 1 << int(np.ceil(np.log2(max(2, len(run) + lags + 1))))
        for source, total in ((value, top), (good.astype(float), count)):
            spectrum = np.abs(np.fft.rfft(source, size, axis=0)) ** 2
            lagged = np.fft.irfft(spectrum, size, axis=0)[: lags + 1].sum(axis=1)
            total[: len(lagged)] += lagged
    with np.errstate(invalid="ignore", divide="ignore"):
        moment = top / np.maximum(count, 1.0)
    return moment / moment[0] if moment[0] > 0 else np.concatenate(([1.0], np.zeros(lags)))


def correlation_factor(series: Sequence[np.ndarray], lags: int) -> float:
    """Return how many samples carry the information of one independent sample (>= 1).

    The integrated autocorrelation, summed over pairs of lags while their sum stays positive (Geyer 1992).
    """
    rho = autocorrelation(series, lags)
    total = 1.0
    for k in range(1, len(rho) - 1, 2):
        pair = rho[k] + rho[k + 1]
        if pair <= 0:
            break
        total += 2.0 * pair
    return max(1.0, total)


def rises(series: np.ndarray) -> np.ndarray:
    """Return how far each column is above the lowest value of all, rms; 0 where nothing is there."""
    return np.sqrt(np.nan_to_num(mean_there((series - np.nanmin(series, initial=np.inf)) ** 2, 0)))


def variance(squares: float, count: int, least: float) -> float:
    """Return the likeliest variance of white noise by a sum of squares: `least` or more."""
    return max(squares / max(1, count), least, 1e-300)


def surprise(squares: float, count: int, least: float) -> float:
    """Return the negative logarithm of the likelihood of white noise as large as fits, `least` variance or more, but for a constant."""
    size = variance(squares, count, least)
    return 0.5 * (count * math.log(size) + squares / size)


def block_means(series: np.ndarray, width: int, starts: Sequence[int] = (0,)) -> tuple:
    """Return means over blocks of `width` rows, their counts and first rows: (b, columns), (b, columns), (b,)."""
    begins = np.concatenate([np.arange(a, b, width) for a, b in itertools.pairwise([*starts, len(series)])])
    good = np.isfinite(series)
    total = np.add.reduceat(np.where(good, series, 0.0), begins, axis=0)
    count = np.add.reduceat(good.astype(float), begins, axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(count > 0, total / np.maximum(count, 1), np.nan), count, begins


def mean_there(values: np.ndarray, axis: int) -> np.ndarray:
    """Return the mean along an axis of what is there, NaN where nothing is."""
    count = np.isfinite(values).sum(axis=axis)
    return np.where(count > 0, np.nansum(values, axis=axis) / np.maximum(count, 1), np.nan)


def structure(
    series: Sequence[np.ndarray], noise: Sequence[np.ndarray], width: int, starts: Sequence[Sequence[int]]
) -> np.ndarray:
    """Return the variance of what is slower than `width` rows, per run and column, in units of noise^2.

    Variance of block means less what noise, white or shared with the next row, would leave in them: (runs, columns). About
    zero (it may be slightly negative) where nothing else is left; structure well above the noise is of order one.
    """
    out = []
    for run, sigma, begins in zip(series, noise, starts, strict=True):
        mean, count, _ = block_means(run / sigma, width, begins)
        few = np.maximum(count, 1)
        with np.errstate(invalid="ignore", divide="ignore"):
            left = (1.0 + 2.0 * shared_noise(run, begins) * (few - 1.0) / few) / few
            excess = np.where(count > 0, mean**2 - left, np.nan)
            weight = np.where(np.isfinite(excess), count, 0.0)
            out.append(np.nansum(excess * weight, axis=0) / weight.sum(axis=0))
    return np.asarray(out)


def rms(series: Sequence[np.ndarray]) -> float:
    """Return the root mean square over everything that is there."""
    total = sum(float(np.nansum(run**2)) for run in series)
    count = sum(int(np.isfinite(run).sum()) for run in series)
    return float(np.sqrt(total / count)) if count else float("nan")


def rms_there(values: np.ndarray) -> float | None:
    """Return the root mean square of what is there, None where nothing is (JSON has no NaN)."""
    return rms([values]) if np.isfinite(values).any() else None


def spikes(residual: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """Return a mask (rows, columns) of isolated outliers: far from the median of the eight around them."""
    rows, columns = residual.shape
    out = np.zeros((rows, columns), dtype=bool)
    if rows < 9:
        return out
    padded = np.pad(residual, ((4, 4), (0, 0)), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 9, axis=0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        middle = np.nanmedian(windows, axis=2)
        spread = 1.4826 * np.nanmedian(np.abs(windows - middle[:, :, None]), axis=2)
    away = np.abs(residual - middle)
    return np.isfinite(away) & (away > 6.0 * noise) & (away > 4.0 * spread)


def trimmed_mean(values: np.ndarray) -> float:
    """Return the mean without a tenth of the values at either end."""
    cut = int(0.1 * values.size)
    return float(np.partition(values, (cut, values.size - cut - 1))[cut : values.size - cut].mean())
