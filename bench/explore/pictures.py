"""The pictures of docs/exploring.md: runs its sweeps (carries on where they are), then draws.

.venv/bin/python bench/explore/pictures.py [stiffness paper pitch cooling spring patterns which] [--work build/explore] [--figures docs/figures]
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl
import pandas as pd
from matplotlib import pyplot as plt

mpl.use("svg")
mpl.rcParams |= {
    "svg.hashsalt": "ninespring",
    "svg.fonttype": "none",
    "font.size": 9,
    "figure.constrained_layout.use": True,
}
ROOT = Path(__file__).resolve().parents[2]
STILL, FAN = "#c2410c", "#1d4ed8"
AUSTENITE_START_C = 88
SIZES = {3: (":", "o"), 4: ("--", "s"), 8: ("-.", "^"), 16: ("-", "D")}
"""Line and marker of an array of so many rows and columns."""


def swept(name: str, work: Path) -> pd.DataFrame:
    """Run a sweep of the page; return its rows."""
    words = [
        sys.executable,
        "-m",
        "ninespring",
        "sweep",
        str(ROOT / "docs" / "exploring" / f"{name}.toml"),
        "-o",
        str(work / name),
    ]
    subprocess.run(words, check=True)
    return pd.read_parquet(work / name / "points")


def paper(work: Path) -> Any:
    """Draw the paper's figure of the centre against the pitch, and what geometry alone says."""
    kept = work / "paper.json"
    if not kept.exists():
        words = [sys.executable, str(ROOT / "bench" / "explore" / "paper.py"), "--mesh", "coarse", "--json", str(kept)]
        subprocess.run(words, check=True)
    sys.path.insert(0, str(Path(__file__).parent))
    from paper import CAMERA, COMSOL, fitted_c

    found = {row["figure"]: row["value"] for row in json.loads(kept.read_text())}
    figure, axes = plt.subplots(1, 2, figsize=(7.2, 3.8), sharey=True)
    pitches = [4, 5, 6]
    for fan, axis in enumerate(axes):
        name = "fan" if fan else "still"
        axis.plot(pitches, [COMSOL[p, fan] for p in pitches], "ks", label="paper, COMSOL")
        axis.plot(pitches, [CAMERA[p, fan] for p in pitches], "k^", mfc="none", label="paper, camera")
        more = [4, 4.5, 5, 5.5, 6, 7, 8]
        for size, style in ((3, "-"), (16, ":")):
            law = [fitted_c(p, fan, size) for p in more]
            axis.plot(more, law, style, color="#6b7280", label=f"spacing law, fitted to COMSOL, {size} x {size}")
        for reading, size, style, colour in (
            ("outer 3.45", 3, "o-", STILL),
            ("outer 3.45", 8, "o-.", STILL),
            ("outer 3.45", 16, "o:", STILL),
            ("mean 3.45", 3, "o-", "#9ca3af"),
        ):
            of = f", {size} x {size}" if size > 3 else ""
            at = [p for p in pitches if f"centre, {reading} mm{of}, pitch {p} mm, {name}" in found]
            values = [found[f"centre, {reading} mm{of}, pitch {p} mm, {name}"] for p in at]
            label = f"geometry alone, {reading} mm, {size} x {size}"
            axis.plot(at, values, style, ms=4, color=colour, label=label)
        axis.set(title="fan" if fan else "still air", xlabel="pitch, mm")
    axes[0].set_ylabel("undriven centre, degC\n(all others at 105)")
    figure.legend(*axes[1].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=7)
    return figure


def pitch(work: Path) -> Any:
    """Draw interference, speed, supply and energy against pitch and size."""
    table = swept("pitch", work)
    table["spring_j"] = table.energy_j / (table["size"] ** 2 - 1)
    figure, axes = plt.subplots(2, 2, figsize=(7.2, 5.6))
    for (metric, label), axis in zip(
        {
            "undriven_c": "undriven middle at most, degC",
            "pictures_per_min": "pictures a minute",
            "supply_a": "highest current of all supplies, A",
            "spring_j": "energy of a picture, J a driven spring",
        }.items(),
        axes.flat,
        strict=True,
    ):
        for (size, fan), part in table.groupby(["size", "fan"]):
            style, marker = SIZES[size]
            axis.plot(
                part.pitch_mm,
                part[metric],
                style,
                marker=marker,
                ms=4,
                mfc="none",
                color=FAN if fan else STILL,
                label=f"{size} x {size}{', fan' if fan else ''}",
            )
        axis.set(xlabel="pitch, mm", ylabel=label, ylim=(0, 1.15 * table[metric].max()))
    axes[0, 0].set_ylim(20, None)
    axes[1, 0].set(yscale="log", ylim=(10, 2000))
    axes[0, 0].legend(fontsize=7, handlelength=4, ncols=2)
    return figure


def patterns(work: Path) -> Any:
    """Draw the hottest that any undriven spring comes in any of all patterns, against the pitch."""
    table = swept("patterns", work)
    figure, axis = plt.subplots(figsize=(7.2, 3.0))
    for (policy, fan), part in table.groupby(["policy", "fan"]):
        worst = part.loc[part.groupby("pitch_mm")["undriven_c"].idxmax()]
        axis.plot(
            worst.pitch_mm,
            worst.undriven_c,
            "-" if policy == "precompensate" else "--",
            marker="o",
            color=FAN if fan else STILL,
            label=f"{policy}{', fan' if fan else ''}",
        )
        for row in worst.itertuples():
            print(
                f"pitch {row.pitch_mm:g} mm, {policy}, fan {fan:g}: undriven at most {row.undriven_c:.1f} degC, "
                f"{100 * row.undriven_austenite:.0f} % austenite, with {row.pattern}"
            )
    moves(axis)
    axis.set(xlabel="pitch, mm", ylabel="undriven at most, degC\n(worst of 512 patterns)", ylim=(20, 125))
    axis.legend(fontsize=7, handlelength=4, ncols=3, loc="upper center")
    return figure


def moves(axis: Any) -> None:
    """Draw the temperature from which a spring moves."""
    axis.axhline(AUSTENITE_START_C, color="#9ca3af", lw=0.8, label="a spring moves")


def cooling(work: Path) -> Any:
    """Draw what plate, wall and fan do, by geometry."""
    return by_geometry(swept("cooling", work), ("plate", "baffle"), lambda plate, wall: f"{plate}, walls: {wall}")


def spring(work: Path) -> Any:
    """Draw what the size of the spring does, by geometry."""
    return by_geometry(
        swept("spring", work),
        ("wire_diameter_mm", "coil_diameter_mm"),
        lambda wire, coil: f"wire {wire:g}, coil {coil:g}",
    )


def by_geometry(table: pd.DataFrame, keys: tuple[str, str], words: Callable[..., str]) -> Any:
    """Draw interference and power against the pitch, a line for each of two keys' values, with the fan and without."""
    figure, axes = plt.subplots(1, 2, figsize=(7.2, 3.9))
    styles = dict(zip(table.groupby(list(keys)).groups, ("-", "--", ":", "-."), strict=True))
    for metric, axis, label in (
        ("undriven_c", axes[0], "undriven middle at most, degC"),
        ("hold_w", axes[1], "power in the hold, W"),
    ):
        for (*values, fan), part in table.groupby([*keys, "fan"]):
            axis.plot(
                part.pitch_mm,
                part[metric],
                styles[tuple(values)],
                marker="o",
                ms=4,
                color=FAN if fan else STILL,
                label=f"{words(*values)}{', fan' if fan else ''}",
            )
        axis.set(xlabel="pitch, mm", ylabel=label)
    moves(axes[0])
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=7, handlelength=4)
    return figure


def which(work: Path) -> Any:
    """Draw which parameters matter for what."""
    swept("which", work)
    found = json.loads((work / "which" / "indices.json").read_text())
    keys = list(next(iter(found.values())))
    figure, axis = plt.subplots(figsize=(7.2, 3.6))
    values = [[min(1.0, max(0.0, found[metric][key]["ST"])) for key in keys] for metric in found]
    axis.imshow(values, cmap="Oranges", vmin=0, vmax=1, aspect="auto")
    axis.set_xticks(range(len(keys)), keys, rotation=20, ha="right", fontsize=7)
    axis.set_yticks(range(len(found)), list(found))
    for y, metric in enumerate(found):
        for x, key in enumerate(keys):
            one = found[metric][key]
            words, colour = f"{one['ST']:.2f}\n± {one['ST_conf']:.2f}", "white" if one["ST"] > 0.7 else "black"
            axis.text(x, y, words, color=colour, ha="center", va="center", fontsize=6)
    return figure


def stiffness(work: Path) -> Any:
    """Draw both layers after four minutes, by the commands of the page."""
    from ninespring.io.logs import read_log
    from ninespring.say import plotting

    folder = work / "stiffness"
    folder.mkdir(exist_ok=True)
    model, scenario, log = (folder / name for name in ("model.toml", "run.ini", "run.csv"))
    tool = [sys.executable, "-m", "ninespring"]
    array = ROOT / "docs" / "exploring" / "stiffness.toml"
    if not model.exists():
        subprocess.run([*tool, "couplings", array, "--mesh", "coarse", "-o", model], check=True)
    pattern = ("--pattern", "111101111/000010000", "--fan", "100")
    subprocess.run([*tool, "scenario", "--model", model, *pattern, "-o", scenario], check=True)
    subprocess.run([ROOT / "build" / "host" / "ninespring-sim", "run", scenario, "-o", log], check=True)
    return plotting.map_at(read_log(log), 3, 3, 240.0)


PICTURES = {
    "stiffness": stiffness,
    "paper": paper,
    "pitch": pitch,
    "cooling": cooling,
    "spring": spring,
    "patterns": patterns,
    "which": which,
}


def main() -> None:
    """Run, draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("picture", nargs="*", help=", ".join(PICTURES))
    parser.add_argument("--work", type=Path, default=ROOT / "build" / "explore")
    parser.add_argument("--figures", type=Path, default=ROOT / "docs" / "figures")
    options = parser.parse_args()
    for folder in (options.work, options.figures):
        folder.mkdir(parents=True, exist_ok=True)
    for name in options.picture or PICTURES:
        figure = PICTURES[name](options.work)
        path = options.figures / f"exploring_{name}.svg"
        figure.savefig(path, metadata={"Date": None})
        print(path)


if __name__ == "__main__":
    main()
