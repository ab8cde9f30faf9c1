"""The report's pictures, as SVG."""

from __future__ import annotations

import io
import math
from typing import Any

import matplotlib as mpl
import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure

from ..find.diagnosis import Diagnosis
from ..infer.fit import Fit
from ..io import statistics
from ..io.logs.run import Run

INK, MEASURED, BEFORE, AFTER = "#1d2733", "#9aa7b4", "#c8553d", "#1f77a4"
mpl.rcParams.update(
    {"svg.fonttype": "none", "font.family": "sans-serif", "text.color": INK, "axes.edgecolor": "#c3ccd4"}
)


def panels(
    rows: int,
    cols: int,
    size: tuple[float, float],
    margins: tuple[float, float, float, float],
    gap: tuple[float, float] = (0.0, 0.0),
    **more: Any,
) -> tuple[Figure, np.ndarray]:
    """Return a figure of panels (rows, cols), each of a size, between margins (left, right, bottom, top), inches.

    What stands in the margins is known: to have it measured, matplotlib draws all of it several times over.
    """
    left, right, bottom, top = margins
    wide = left + right + cols * size[0] + (cols - 1) * gap[0]
    high = bottom + top + rows * size[1] + (rows - 1) * gap[1]
    figure = Figure(figsize=(wide, high))
    figure.subplots_adjust(
        left / wide, bottom / high, 1 - right / wide, 1 - top / high, gap[0] / size[0], gap[1] / size[1]
    )
    return figure, figure.subplots(rows, cols, squeeze=False, **more)


def as_svg(figure: Figure) -> Markup:
    """Return a figure as SVG that stands in a page."""
    out = io.StringIO()
    figure.savefig(out, format="svg")
    text = out.getvalue()
    return Markup(text[text.index("<svg") :])


def _thin(n: int) -> slice:
    return slice(None, None, max(1, n // 500))


def traces(found: Diagnosis) -> list[tuple[Markup, Markup]]:
    """Return two figures a run: temperatures, and what the models leave of them."""
    array = found.problem.array
    fits = ((found.baseline, BEFORE, "model before"), (found.shown, AFTER, "model after"))
    figures = []
    for r, run in enumerate(found.problem.runs):
        pick = _thin(len(run.time_s))
        since = (run.time_s - run.time_s[0])[pick]
        # a line across a gap or a stretch left out would be invented
        breaks = np.unique([0, *(np.searchsorted(np.arange(len(run.time_s))[pick], run.starts))])
        pair = []
        for residual in (False, True):
            figure, axes = panels(
                array.rows,
                array.cols,
                (max(3.45, 6.5 / array.cols), 1.83),
                (0.75, 0.12, 0.62, 0.5),
                (0.2, 0.32),
                sharex=True,
                sharey=True,
            )
            for k in range(run.springs):
                axis = axes[k // array.cols][k % array.cols]
                measured = run.temperature_c[:, k]
                if not np.isfinite(measured).any():
                    axis.text(
                        0.5, 0.5, "not measured", ha="center", transform=axis.transAxes, color=MEASURED, fontsize=9
                    )
                if not residual:
                    axis.plot(since, measured[pick], color=MEASURED, lw=2.6, label="measured")
                else:
                    noise = float(found.problem.noise[r][k])
                    axis.axhspan(-2 * noise, 2 * noise, color="#e3e8ec", lw=0, label="noise, 2 sigma")
                for fit, colour, label in fits:
                    shown = fit.residual[r][:, k] if residual else measured - fit.residual[r][:, k]
                    line = shown[pick].copy()
                    line[breaks[1:] - 1] = np.nan
                    axis.plot(since, line, color=colour, lw=0.9, label=label)
                if residual:
                    _shade_inputs(axis, run, k, pick)
                axis.set_title(f"spring {k + 1}", fontsize=9, loc="left", color=INK)
                axis.grid(alpha=0.25)
                axis.tick_params(labelsize=8)
            handles, labels = axes[0][0].get_legend_handles_labels()
            wide, high = figure.get_size_inches()
            figure.legend(handles, labels, fontsize=9, frameon=False, ncols=3, loc="upper right")
            figure.supxlabel("time since the beginning of the run, s", fontsize=9, y=0.1 / high)
            figure.supylabel("measured less model, K" if residual else "temperature, °C", fontsize=9, x=0.1 / wide)
            pair.append(as_svg(figure))
        figures.append((pair[0], pair[1]))
    return figures


def _shade_inputs(axis: Any, run: Run, k: int, pick: slice) -> None:
    """Shade a spring's drive and the fan into the lowest sixth of a picture."""
    since = (run.time_s - run.time_s[0])[pick]
    top = max(1e-12, float(run.drive.max()))
    across = axis.get_xaxis_transform()
    axis.fill_between(
        since, 0.0, run.drive[pick, k] / top / 6.0, transform=across, color="#c9a14a", alpha=0.45, lw=0, step="post"
    )
    axis.fill_between(since, 0.0, run.fan[pick] / 40.0, transform=across, color="#5b8fd0", alpha=0.7, lw=0, step="post")


def _tiles(
    axis: Any, values: np.ndarray, shape: tuple[int, int], colours: str, low: float, high: float, form: str
) -> Any:
    """Draw numbers (springs,) on the array, NaN where nothing was measured; return the picture."""
    shown = axis.imshow(values.reshape(shape), cmap=colours, vmin=low, vmax=high)
    for k, value in enumerate(values):
        known = math.isfinite(value)
        dark = known and abs(value) - max(low, 0.0) > (0.55 if low < 0 else 0.7) * (high - max(low, 0.0))
        place = {"va": "center", "ha": "center", "color": "white" if dark else INK, "fontsize": 9 if known else 7}
        words = form.format(value) if known else "not\nmeasured"
        axis.text(k % shape[1], k // shape[1], words, **place)
        corner = place | {"fontsize": 6, "alpha": 0.8}
        axis.text(k % shape[1] - 0.44, k // shape[1] - 0.42, str(k + 1), **corner | {"ha": "left", "va": "top"})
    axis.set_xticks([])
    axis.set_yticks([])
    return shown


def _in_noise(found: Diagnosis, fit: Fit) -> list[np.ndarray]:
    """Return what a fit leaves, in multiples of each sensor's noise: (rows, springs) a run."""
    return [left / noise for left, noise in zip(fit.residual, found.problem.noise, strict=True)]


def array_map(found: Diagnosis) -> Markup:
    """Draw what is left at each spring in multiples of its sensor's noise, with a colour bar."""
    shape = (found.problem.array.rows, found.problem.array.cols)
    rms = np.sqrt(statistics.mean_there(np.concatenate(_in_noise(found, found.shown)) ** 2, 0))
    cell = 3.0 / max(shape[1], 0.9 * shape[0])
    size = (shape[1] * cell, shape[0] * cell)
    above = max(0.1, 0.75 - 0.5 * size[1])  # words beside may be longer than what they stand beside
    side = 0.5 * (3.0 - size[0])
    figure, axes = panels(1, 1, size, (0.1 + side, 0.95 + side, above, above))
    shown = _tiles(axes[0, 0], rms, shape, "YlOrRd", 1.0, max(3.0, float(np.nanmax(rms))), "{:.1f}")
    beside = axes[0, 0].inset_axes((1.0 + 0.12 / size[0], 0.0, 0.15 / size[0], 1.0))
    figure.colorbar(shown, cax=beside, label="rms error / noise")
    return as_svg(figure)


def unknown_heat(found: Diagnosis) -> str:
    """Draw the watts that no log has, springs over time, a panel a run, with a colour bar; empty where there are none."""
    heat = found.heat
    most = max((float(np.abs(watts).max()) for watts in heat.watts if watts.size), default=0.0)
    if most <= 0:
        return ""
    springs, runs = found.problem.array.springs, len(heat.watts)
    panel = (7.4, max(0.8, 0.2 * springs))
    figure, axes = panels(runs, 1, panel, (0.6, 1.45, 0.45, 0.1), (0.0, 0.3))
    for r, (axis, times, watts) in enumerate(zip(axes[:, 0], heat.times_s, heat.watts, strict=True)):
        pick = _thin(len(times))
        edges = np.append(times[pick], times[-1]) - times[0]
        # red: more than was logged; blue: less
        shown = axis.pcolormesh(
            edges, np.arange(springs + 1) + 0.5, watts[pick].T, cmap="RdBu_r", vmin=-most, vmax=most
        )
        axis.set_yticks(np.arange(1, springs + 1))
        axis.invert_yaxis()
        axis.set_ylabel(f"run {r + 1}, spring", fontsize=8)
        axis.tick_params(labelsize=7)
    axes[-1, 0].set_xlabel("s", fontsize=8)
    beside = axes[-1, 0].inset_axes(
        (1.0 + 0.12 / panel[0], 0.0, 0.15 / panel[0], 1.0 + (runs - 1) * (1.0 + 0.3 / panel[1]))
    )
    figure.colorbar(shown, cax=beside, label="W more (red)\nor less (blue)\nthan known")
    return as_svg(figure)


def maps(found: Diagnosis) -> Markup:
    """Draw where the error sits: rms and mean of each spring, before and after."""
    problem = found.problem
    shape = (problem.array.rows, problem.array.cols)
    pictures = []
    for fit, label in ((found.baseline, "before"), (found.shown, "after")):
        left = np.concatenate(fit.residual)
        pictures.append((np.sqrt(statistics.mean_there(left**2, 0)), f"rms error {label}, K", "YlOrRd", "{:.2f}"))
        pictures.append((statistics.mean_there(left, 0), f"mean error {label}, K", "RdBu_r", "{:+.2f}"))
    most = [max(1e-9, *(float(np.nanmax(np.abs(pictures[k + j][0]))) for j in (0, 2))) for k in (0, 1)]
    wide = 2.8 * min(1.0, shape[1] / shape[0])
    side = max(0.1, 0.75 - 0.5 * wide)  # a title may be wider than what it stands above
    size, gap = (wide, wide * shape[0] / shape[1]), (2.95 - wide, 0.0)
    figure, axes = panels(1, 4, size, (side, side, 0.1, 0.3), gap)
    for k, (axis, (values, title, colours, form)) in enumerate(zip(axes[0], pictures, strict=True)):
        _tiles(axis, values, shape, colours, -most[1] if k % 2 else 0.0, most[k % 2], form)
        axis.set_title(title, fontsize=9)
    return as_svg(figure)


def autocorrelation(found: Diagnosis) -> Markup:
    """Draw what is left: its autocorrelation and its distribution."""
    problem = found.problem
    lags = min(120, problem.longest_lag())
    step = float(np.median(np.diff(problem.runs[0].time_s)))
    figure, (axes,) = panels(1, 2, (5.2, 2.3), (0.6, 0.1, 0.5, 0.3), (0.7, 0.0))
    for fit, colour, label in ((found.baseline, BEFORE, "before"), (found.shown, AFTER, "after")):
        left = _in_noise(found, fit)
        rho = statistics.autocorrelation(left, lags)
        axes[0].plot(np.arange(1, lags + 1) * step, rho[1:], color=colour, label=label)
        values = np.concatenate([one[np.isfinite(one)] for one in left])
        axes[1].hist(values, bins=80, range=(-6, 6), density=True, histtype="step", color=colour, label=label)
    bound = 2 / math.sqrt(problem.count)
    axes[0].axhspan(-bound, bound, color="#dfe5ea")
    axes[0].set_xlabel("lag, s", fontsize=9)
    axes[0].set_ylabel("correlation", fontsize=9)
    axes[0].set_title("autocorrelation of the residual (grey: white noise)", fontsize=9)
    x = np.linspace(-6, 6, 200)
    axes[1].plot(x, np.exp(-(x**2) / 2) / math.sqrt(2 * math.pi), color=MEASURED, label="sensor noise alone")
    axes[1].set_xlabel("residual / noise", fontsize=9)
    axes[1].set_ylabel("density", fontsize=9)
    axes[1].set_title("distribution of the residual", fontsize=9)
    for axis in axes:
        axis.legend(fontsize=8, frameon=False)
        axis.grid(alpha=0.25)
        axis.tick_params(labelsize=8)
    return as_svg(figure)
