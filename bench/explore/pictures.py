"""The pictures of docs/exploring.md: runs its sweeps (carries on where they are), then draws.

.venv/bin/python bench/explore/pictures.py [stiffness paper pitch cooling patterns which] [--work build/explore] [--figures docs/figures]
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
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
    figure, axes = plt.subplots(1, 2, figsize=(7.2, 3.5), sharey=True)
    pitches = [4, 5, 6]
    for fan, axis in enumerate(axes):
        name = "fan" if fan else "still"
        axis.plot(pitches, [COMSOL[p, fan] for p in pitches], "ks", label="paper, COMSOL")
        axis.plot(pitches, [CAMERA[p, fan] for p in pitches], "k^", mfc="none", label="paper, camera")
        more = [4, 4.5, 5, 5.5, 6, 7, 8]
        axis.plot(more, [fitted_c(p, fan) for p in more], "-", color="#6b7280", label="spacing law, fitted to COMSOL")
        for reading, colour in (("outer 3.45", STILL), ("mean 3.45", "#9ca3af")):
            at = [p for p in pitches if f"centre, {reading} mm, pitch {p} mm, {name}" in found]
            values = [found[f"centre, {reading} mm, pitch {p} mm, {name}"] for p in at]
            axis.plot(at, values, "o-", color=colour, label=f"geometry alone, {reading} mm")
        axis.set(title="fan" if fan else "still air", xlabel="pitch, mm")
    axes[0].set_ylabel("undriven centre, degC\n(eight at 105)")
    figure.legend(*axes[1].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=7)
    return figure


def pitch(work: Path) -> Any:
    """Draw interference and speed against pitch and size."""
    table = swept("pitch", work)
    figure, axes = plt.subplots(1, 2, figsize=(7.2, 3.0))
    for metric, axis, label in (
        ("undriven_c", axes[0], "undriven middle at most, degC"),
        ("pictures_per_min", axes[1], "pictures a minute"),
    ):
        for (size, fan), part in table.groupby(["size", "fan"]):
            style, marker = {3: (":", "o"), 4: ("--", "s"), 8: ("-.", "^"), 16: ("-", "D")}[size]
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
        axis.set(xlabel="pitch, mm", ylabel=label)
    axes[0].legend(fontsize=7, handlelength=4)
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
    axis.axhline(AUSTENITE_START_C, color="#9ca3af", lw=0.8)
    axis.set(xlabel="pitch, mm", ylabel="undriven at most, degC\n(worst of 512 patterns)", ylim=(20, 105))
    axis.legend(fontsize=7, handlelength=4, ncols=4, loc="upper center")
    return figure


def cooling(work: Path) -> Any:
    """Draw what plate and fan do, by geometry."""
    table = swept("cooling", work)
    figure, axes = plt.subplots(1, 2, figsize=(7.2, 3.0))
    for metric, axis, label in (
        ("undriven_c", axes[0], "undriven middle at most, degC"),
        ("hold_w", axes[1], "power in the hold, W"),
    ):
        for (plate, fan), part in table.groupby(["plate", "fan"]):
            style = "-" if plate == "aluminium" else "--"
            axis.plot(
                part.pitch_mm,
                part[metric],
                style,
                marker="o",
                color=FAN if fan else STILL,
                label=f"{plate}{', fan' if fan else ''}",
            )
        axis.set(xlabel="pitch, mm", ylabel=label)
    axes[0].axhline(AUSTENITE_START_C, color="#9ca3af", lw=0.8)
    axes[0].legend(fontsize=7)
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
            axis.text(x, y, f"{one['ST']:.2f}\n± {one['ST_conf']:.2f}", ha="center", va="center", fontsize=6)
    return figure


def stiffness(work: Path) -> Any:
    """Draw both layers after four minutes, by the commands of the page."""
    from ninespring import plotting
    from ninespring.logs import read_log

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
    options.work.mkdir(parents=True, exist_ok=True)
    for name in options.picture or PICTURES:
        figure = PICTURES[name](options.work)
        path = options.figures / f"exploring_{name}.svg"
        figure.savefig(path, metadata={"Date": None})
        print(path)


if __name__ == "__main__":
    main()
