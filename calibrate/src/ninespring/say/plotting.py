"""Pictures of a log: time series per spring, and the array as it warms."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from ..io.logs import Run, read_table
from ..model.stiffness import LAYERS

UNIT = {"power": "power, W", "current": "current, A", "command": "command"}
FRAMES, FRAME_MS = 200, 100
"""Most frames of an animation, and how long each is shown."""


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


def layers_of(run: Run) -> list[tuple[str, range]]:
    """Return the run's layers: their names ('' where there is one), and their springs."""
    n = run.springs // run.layers
    names = LAYERS if run.layers == 2 else ("",)
    return [(name, range(k * n, (k + 1) * n)) for k, name in enumerate(names)]


def figure(run: Run, predicted: np.ndarray | None = None) -> Figure:
    """Return a figure: temperatures (n, k) and `predicted` ones dashed, below them what each spring was given.

    Two layers are drawn side by side.
    """
    out = Figure(figsize=(10 if run.layers == 1 else 15, 6), layout="constrained")
    FigureCanvasAgg(out)
    layers = layers_of(run)
    axes = out.subplots(2, len(layers), sharex=True, sharey="row", height_ratios=[2, 1], squeeze=False)
    for (name, springs), (top, bottom) in zip(layers, axes.T, strict=True):
        _draw(run, springs, predicted, top, bottom)
        if name:
            top.set_title(name)
    fan = " (shaded: fan)" if (run.fan > 0).any() else ""
    out.suptitle(Path(run.name).name + fan, x=0.01, ha="left")
    return out


def _draw(run: Run, springs: range, predicted: np.ndarray | None, top: Axes, bottom: Axes) -> None:
    colors = mpl.colormaps["viridis"](np.linspace(0.0, 0.9, len(springs)))
    temperature, what = shown(run)
    for k, color in zip(springs, colors, strict=True):
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
    top.legend(title="spring", loc="upper left", bbox_to_anchor=(1.0, 1.0), ncols=1 + (len(springs) - 1) // 12)


def _map(run: Run, rows: int, cols: int) -> tuple[Figure, Callable[[int], None]]:
    """Return a figure of the array, layers side by side, and what draws a row of the run into it."""
    temperature, what = shown(run)
    layers = layers_of(run)
    out = Figure(figsize=(1.2 * cols * len(layers) + 1.5, 1.2 * rows + 0.8), layout="constrained")
    FigureCanvasAgg(out)
    axes = out.subplots(1, len(layers), squeeze=False)[0]
    low, high = min(float(np.nanmin(temperature)), 20.0), max(float(np.nanmax(temperature)), 60.0)
    bright = low + 0.7 * (high - low)  # white is not read on what is above
    pictures, words = [], []
    for at, (name, springs) in zip(axes, layers, strict=True):
        pictures.append(at.imshow(temperature[0, springs].reshape(rows, cols), cmap="inferno", vmin=low, vmax=high))
        at.set(xticks=[], yticks=[])
        at.set_xlabel(name)
        for k in range(len(springs)):
            words.append(at.text(k % cols, k // cols, "", ha="center", va="center", fontsize=9))
    out.colorbar(pictures[0], ax=list(axes), label=f"{what}, degC")

    def draw(row: int) -> None:
        axes[0].set_title(f"{run.time_s[row]:.0f} s (bold: driven)", loc="left", fontsize=10)
        for picture, (_, springs) in zip(pictures, layers, strict=True):
            picture.set_data(temperature[row, springs].reshape(rows, cols))
        for k, one in enumerate(words):
            one.set_text(f"{k + 1}: {temperature[row, k]:.0f}")
            one.set_color("black" if temperature[row, k] > bright else "white")
            one.set_fontweight("bold" if run.drive[row, k] > 0 else "normal")

    return out, draw


def map_at(run: Run, rows: int, cols: int, time_s: float) -> Figure:
    """Return the array at a time, s: the row of the run that is nearest; driven springs in bold."""
    out, draw = _map(run, rows, cols)
    draw(int(np.abs(run.time_s - time_s).argmin()))
    return out


def drawn(figure: Figure, kind: str) -> bytes:
    """Return a figure as a file of its kind (.png, .svg, .pdf)."""
    out = io.BytesIO()
    figure.savefig(out, format=kind.removeprefix("."), dpi=150)
    return out.getvalue()


def animation_of(run: Run, rows: int, cols: int) -> bytes:
    """Return an animation (GIF) of the array's temperatures; the file says who wrote it, as matplotlib does in all other kinds."""
    pick = np.unique(np.linspace(0, len(run.time_s) - 1, min(FRAMES, len(run.time_s))).astype(int))
    drawing, draw = _map(run, rows, cols)
    canvas, frames = FigureCanvasAgg(drawing), []
    for row in pick:
        draw(row)
        canvas.draw()
        frames.append(Image.fromarray(np.array(canvas.buffer_rgba())).convert("RGB"))
    out = io.BytesIO()
    more = {"append_images": frames[1:], "duration": FRAME_MS, "loop": 0, "comment": "Matplotlib, ninespring"}
    frames[0].save(out, "GIF", save_all=True, **more)
    return out.getvalue()
