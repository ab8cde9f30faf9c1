"""Draws the pictures of docs/driving.md from the runs that ``bench_policy --traces DIR`` wrote.

build/host/bench/policy/bench_policy --part none --traces /tmp && .venv/bin/python bench/policy/plot_policy.py /tmp
"""

from __future__ import annotations

import argparse
import csv
import io
import re
import sys
from pathlib import Path

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

FIGURES = Path(__file__).resolve().parents[2] / "docs" / "figures"
MARTENSITE_START_C, AUSTENITE_START_C = 78.0, 88.0

plt.rcParams.update(
    {
        "svg.fonttype": "none",
        "svg.hashsalt": "ninespring",  # the same runs give the same file
        "font.size": 9,
        "axes.grid": True,
        "grid.alpha": 0.3,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "legend.frameon": False,
        "path.simplify": True,
        "path.simplify_threshold": 0.5,
    }
)

Trace = dict[str, list[float]]


def read(directory: Path, name: str) -> Trace:
    """Columns of a trace by name; empty fields (the baselines have no estimate) are NaN."""
    with (directory / f"policy_{name}.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return {column: [float(row[column] or "nan") for row in rows] for column in rows[0]}


def save(figure: Figure, name: str) -> None:
    """Coordinates to a tenth of a point, one line a path: half the size, and nothing to be seen of it."""
    figure.tight_layout()
    text = io.StringIO()
    figure.savefig(text, format="svg", metadata={"Date": None})
    plt.close(figure)

    def shorter(path: re.Match[str]) -> str:
        numbers = re.sub(r"-?\d+\.\d+", lambda number: f"{float(number[0]):.1f}".removesuffix(".0"), path[0])
        return " ".join(numbers.split())

    (FIGURES / f"driving_{name}.svg").write_text(re.sub(r'(?<= d=")[^"]*', shorter, text.getvalue()), encoding="utf-8")


def mark_band(axis: Axes) -> None:
    """The hysteresis band: austenite that is there stays, martensite that is there stays."""
    axis.axhspan(MARTENSITE_START_C, AUSTENITE_START_C, alpha=0.12, color="tab:green", linewidth=0)


def constant(directory: Path) -> None:
    """Where a constant current leaves a spring after an hour, from cold."""
    trace = read(directory, "constant")
    figure, axis = plt.subplots(figsize=(7, 3.2))
    axis.plot(trace["current_a"], trace["alone_c"], ".", markersize=4, label="its neighbours off")
    axis.plot(trace["current_a"], trace["nine_c"], ".", markersize=4, label="all nine at that current")
    axis.axhspan(AUSTENITE_START_C, 98.0, alpha=0.12, color="tab:red", linewidth=0)
    axis.text(1.01, 93.0, "transformation on heating, 88 to 98 degC", va="center")
    axis.set(xlabel="constant current, A", ylabel="centre after an hour, degC", xlim=(1.0, 2.0), ylim=(30, 180))
    axis.legend(loc="upper left")
    save(figure, "constant")


def eight(directory: Path) -> None:
    """Eight held: a corner and the undriven centre, beside both baselines."""
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.2), sharex=True)
    for name, label in (("eight", "precompensate"), ("b105", "kept at 105 degC"), ("b15", "1.5 A")):
        trace = read(directory, name)
        axes[0].plot(trace["time_s"], trace["t1_c"], label=label)
        axes[1].plot(trace["time_s"], trace["t5_c"], label=label)
    axes[0].set(title="a driven corner", xlabel="time, s", ylabel="temperature, degC", ylim=(15, 115))
    axes[1].set(title="the undriven centre", xlabel="time, s", ylabel="temperature, degC", ylim=(15, 60))
    mark_band(axes[0])
    axes[1].legend(loc="lower right")
    save(figure, "eight")


def neighbours(directory: Path) -> None:
    """The centre is held alone; at 350 s its eight neighbours are switched on."""
    trace = read(directory, "neighbours")
    figure, axes = plt.subplots(2, 1, figsize=(9, 4.6), sharex=True)
    axes[0].plot(trace["time_s"], trace["t5_c"], label="centre")
    axes[0].plot(trace["time_s"], trace["t2_c"], label="neighbour, on from 350 s", linewidth=1)
    mark_band(axes[0])
    axes[0].set(ylabel="temperature, degC", ylim=(15, 115))
    axes[0].legend(loc="lower right")
    axes[1].plot(trace["time_s"], trace["i5_a"], label="centre")
    axes[1].set(xlabel="time, s", ylabel="centre's current, A", ylim=(0, 3.3))
    save(figure, "neighbours")


def nine(directory: Path) -> None:
    """All nine at once: currents in turn within the supply."""
    trace = read(directory, "nine")
    figure, axes = plt.subplots(2, 1, figsize=(9, 5), sharex=True)
    axes[0].stackplot(trace["time_s"], [trace[f"i{k}_a"] for k in range(1, 10)], linewidth=0)
    axes[0].axhline(15.0, color="black", linewidth=0.8)
    axes[0].text(99, 15.2, "supply_limit_a", ha="right", va="bottom")
    axes[0].set(ylabel="currents, stacked, A", ylim=(0, 17.5))
    for k in range(1, 10):
        axes[1].plot(trace["time_s"], [100 * x for x in trace[f"x{k}"]], label=str(k), linewidth=1.2)
    axes[1].set(xlabel="time, s", ylabel="austenite, %", xlim=(0, 100))
    axes[1].legend(title="spring", ncols=3, loc="center right", fontsize=8)
    save(figure, "nine")


def search(directory: Path) -> None:
    """A plant with 15 % more loss and heat capacity: how the search finds martensite start."""
    trace = read(directory, "lossy")
    figure, axis = plt.subplots(figsize=(9, 3.2))
    axis.plot(trace["time_s"], trace["t1_c"], label="spring 1")
    axis.plot(trace["time_s"], trace["m1_c"], label="the chip's estimate of it")
    axis.axhline(MARTENSITE_START_C, color="black", linewidth=0.8)
    axis.text(600, MARTENSITE_START_C - 0.7, "martensite start", ha="right", va="top")
    axis.set(xlabel="time, s", ylabel="temperature, degC", xlim=(0, 610), ylim=(65, 105))
    axis.legend(loc="upper right")
    save(figure, "search")


def levels(directory: Path) -> None:
    """One spring taken from level to level."""
    trace = read(directory, "levels")
    figure, axes = plt.subplots(2, 1, figsize=(9, 4.6), sharex=True)
    axes[0].plot(trace["time_s"], [100 * x for x in trace["x5"]], label="the spring")
    axes[0].step([0, 120, 220, 320, 400], [50, 25, 80, 100, 100], where="post", label="wanted", linewidth=1)
    axes[0].set(ylabel="austenite, %", ylim=(-3, 108))
    axes[0].legend(loc="lower right")
    axes[1].plot(trace["time_s"], trace["t5_c"])
    mark_band(axes[1])
    axes[1].set(xlabel="time, s", ylabel="temperature, degC", xlim=(0, 400))
    save(figure, "levels")


def limits(directory: Path) -> None:
    """Derating by a spring's own temperature, and by an undriven neighbour's."""
    figure, axes = plt.subplots(2, 2, figsize=(9, 4.6), sharex="col")
    own, undriven = read(directory, "own_limit"), read(directory, "undriven_limit")
    axes[0][0].plot(own["time_s"], own["t1_c"])
    axes[0][0].axhline(60.0, color="black", linewidth=0.8)
    axes[0][0].set(title="temperature_limit_c = 60", ylabel="driven spring, degC", ylim=(15, 70))
    axes[1][0].plot(own["time_s"], own["i1_a"])
    axes[1][0].set(xlabel="time, s", ylabel="its current, A", ylim=(0, 3.3))
    axes[0][1].plot(undriven["time_s"], undriven["t5_c"])
    axes[0][1].axhline(38.0, color="black", linewidth=0.8)
    axes[0][1].set(title="undriven_margin_k = 50", ylabel="undriven centre, degC", ylim=(15, 45))
    for k, label in ((1, "corner"), (2, "edge")):
        axes[1][1].plot(undriven["time_s"], undriven[f"i{k}_a"], label=label)
    axes[1][1].set(xlabel="time, s", ylabel="driven springs, A", ylim=(0, 3.3))
    axes[1][1].legend(loc="upper right")
    save(figure, "limits")


def main() -> int:
    """Exit code 2 where a trace is missing."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("directory", type=Path, help="where bench_policy --traces wrote")
    directory: Path = parser.parse_args().directory
    FIGURES.mkdir(parents=True, exist_ok=True)
    try:
        for draw in (constant, eight, neighbours, nine, search, levels, limits):
            draw(directory)
    except OSError as error:
        print(f"{error.filename}: {error.strerror}; run bench_policy --traces first", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
