"""Pictures of a log: time series per spring, and the array as it warms."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib import animation
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from .logs import Run, read_table

UNIT = {"power": "power, W", "current": "current, A", "command": "command"}
FRAMES = 200
"""Most frames of an animation."""


def believed(run: Run) -> np.ndarray | None:
    """Return what the chip's model believed, (n, k) in degC, where a board's log says it (`m1_c` ...)."""
    frame = read_table(run.name).frame
    names = [f"m{k}_c" for k in range(1, run.springs + 1)]
    if not set(names) <= set(frame):
        return None
    rows = np.searchsorted(frame["time_s"].to_numpy(float), run.time_s)
    return frame[names].to_numpy(float)[rows]


def shown(run: Run) -> tuple[np.ndarray, str]:
    """Return the temperatures to show, (n, k) in degC, and what they are: measured, or else the chip's."""
    if np.isfinite(run.temperature_c).any():
        return run.temperature_c, "measured"
    chip = believed(run)
    return (run.temperature_c, "measured") if chip is None else (chip, "the chip's model")


def figure(run: Run, predicted: np.ndarray | None = None) -> Figure:
    """Return a figure: temperatures (n, k) and `predicted` ones dashed, below them what each spring was given."""
    out = Figure(figsize=(10, 6), layout="constrained")
    FigureCanvasAgg(out)
    top, bottom = out.subplots(2, 1, sharex=True, height_ratios=[2, 1])
    colors = mpl.colormaps["viridis"](np.linspace(0.0, 0.9, run.springs))
    temperature, what = shown(run)
    for k, color in enumerate(colors):
        top.plot(run.time_s, temperature[:, k], color=color, linewidth=1.0, label=f"{k + 1}")
        if predicted is not None:
            top.plot(run.time_s, predicted[:, k], color=color, linewidth=1.0, linestyle="--")
        bottom.step(run.time_s, run.drive[:, k], color=color, linewidth=1.0, where="post")
    if run.ambient_c is not None:
        top.plot(run.time_s, run.ambient_c, color="grey", linewidth=0.8, linestyle=":")
    top.set_ylabel(f"{what}, degC" + ("" if predicted is None else "; model dashed"))
    bottom.set_ylabel(UNIT[run.mode])
    bottom.set_xlabel("time, s")
    for axes in (top, bottom):
        axes.grid(alpha=0.3)
        if (run.fan > 0).any():
            axes.fill_between(
                run.time_s, 0, 1, where=run.fan > 0, step="post", alpha=0.08, transform=axes.get_xaxis_transform()
            )
    top.legend(title="spring", loc="upper left", bbox_to_anchor=(1.0, 1.0), ncols=1 + (run.springs - 1) // 12)
    top.set_title(Path(run.name).name + (" (shaded: fan)" if (run.fan > 0).any() else ""), loc="left")
    return out


def animate(run: Run, rows: int, cols: int, path: Path) -> None:
    """Write an animation (GIF) of the array's temperatures."""
    temperature, what = shown(run)
    pick = np.unique(np.linspace(0, len(run.time_s) - 1, min(FRAMES, len(run.time_s))).astype(int))
    out = Figure(figsize=(1.2 * cols + 1.5, 1.2 * rows + 0.8), layout="constrained")
    FigureCanvasAgg(out)
    axes = out.subplots()
    low, high = float(np.nanmin(temperature)), float(np.nanmax(temperature))
    picture = axes.imshow(temperature[0].reshape(rows, cols), cmap="inferno", vmin=min(low, 20.0), vmax=max(high, 60.0))
    out.colorbar(picture, label=f"{what}, degC")
    axes.set_xticks(range(cols), [])
    axes.set_yticks(range(rows), [])
    words = [
        axes.text(k % cols, k // cols, "", ha="center", va="center", color="white", fontsize=9)
        for k in range(run.springs)
    ]

    def draw(row: int) -> None:
        picture.set_data(temperature[row].reshape(rows, cols))
        axes.set_title(f"{run.time_s[row]:.0f} s", loc="left")
        for k, one in enumerate(words):
            one.set_text(f"{k + 1}: {temperature[row, k]:.0f}")
            one.set_fontweight("bold" if run.drive[row, k] > 0 else "normal")

    animation.FuncAnimation(out, draw, frames=list(pick), blit=False).save(path, writer=animation.PillowWriter(fps=10))
