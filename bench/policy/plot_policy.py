"""Draws the pictures of docs/driving.md from the runs that ``bench_policy --traces DIR`` wrote.

build/host/bench/policy/bench_policy --part nominal --traces /tmp && .venv/bin/python bench/policy/plot_policy.py /tmp
"""

from __future__ import annotations

import argparse
import csv
import sys
from pathlib import Path

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt

FIGURES = Path(__file__).resolve().parents[2] / "docs" / "figures"


def read(path: Path) -> dict[str, list[float]]:
    """Columns of a trace by name; empty fields (the baselines have no estimate) are NaN."""
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return {name: [float(row[name] or "nan") for row in rows] for name in rows[0]}


def eight(directory: Path) -> None:
    """Eight held: a corner and the undriven centre, beside both baselines."""
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.2), sharex=True)
    for name, label in (("eight", "precompensate"), ("b105", "B105"), ("b15", "B1.5")):
        trace = read(directory / f"policy_{name}.csv")
        axes[0].plot(trace["time_s"], trace["t1_c"], label=label)
        axes[1].plot(trace["time_s"], trace["t5_c"], label=label)
    axes[0].set(title="driven corner", xlabel="s", ylabel="degC")
    axes[0].axhspan(78, 88, alpha=0.12)
    axes[1].set(title="undriven centre", xlabel="s")
    axes[1].legend()
    figure.tight_layout()
    figure.savefig(FIGURES / "driving_eight.svg")


def nine(directory: Path) -> None:
    """All nine at once: currents in turn within the supply."""
    trace = read(directory / "policy_nine.csv")
    figure, axes = plt.subplots(2, 1, figsize=(9, 5), sharex=True)
    axes[0].stackplot(trace["time_s"], [trace[f"i{k}_a"] for k in range(1, 10)])
    axes[0].axhline(15.0, color="black", linewidth=0.8)
    axes[0].set(ylabel="A, stacked")
    for k in range(1, 10):
        axes[1].plot(trace["time_s"], trace[f"x{k}"])
    axes[1].set(xlabel="s", ylabel="austenite")
    figure.tight_layout()
    figure.savefig(FIGURES / "driving_nine.svg")


def lossy(directory: Path) -> None:
    """A plant with 15 % more loss and heat capacity: how the search finds martensite start."""
    trace = read(directory / "policy_lossy.csv")
    figure, axis = plt.subplots(figsize=(9, 3.2))
    axis.plot(trace["time_s"], trace["t1_c"], label="spring")
    axis.plot(trace["time_s"], trace["m1_c"], label="chip's estimate")
    axis.axhline(78.0, color="black", linewidth=0.8)
    axis.set(xlabel="s", ylabel="degC", ylim=(60, 105))
    axis.legend()
    figure.tight_layout()
    figure.savefig(FIGURES / "driving_search.svg")


def main() -> int:
    """Exit code 2 where a trace is missing."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("directory", type=Path, help="where bench_policy --traces wrote")
    directory: Path = parser.parse_args().directory
    FIGURES.mkdir(parents=True, exist_ok=True)
    try:
        eight(directory)
        nine(directory)
        lossy(directory)
    except OSError as error:
        print(f"{error.filename}: {error.strerror}; run bench_policy --traces first", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
