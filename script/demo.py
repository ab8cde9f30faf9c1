"""The demonstration behind script/demo: runs ninespring-sim, prints tables, draws what it wrote."""

from __future__ import annotations

import csv
import subprocess
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

ROOT = Path(__file__).resolve().parent.parent
OUT = ROOT / "demo"
SIM = ROOT / "build" / "host" / "ninespring-sim"
SCENARIO = ROOT / "sim_host" / "scenarios" / "demo.ini"
FIRMWARE = ROOT / "build" / "avr" / "firmware.elf"
POLICIES = ("open", "precompensate")
LABELS = {"open": "open loop, 1.7 A", "precompensate": "precompensate"}
CENTRE = 5
AUSTENITE_START_C = 88.0


def simulate(*arguments: str | Path) -> None:
    """Run ninespring-sim; its tables go to the terminal, its errors end the demonstration."""
    command = [str(SIM), *map(str, arguments)]
    print(f"\n$ {' '.join(Path(word).name if word.startswith('/') else word for word in command)}", flush=True)
    done = subprocess.run(command, check=False)
    if done.returncode:
        sys.exit(f"demo: ninespring-sim ended with {done.returncode}")


def read(path: Path) -> list[dict[str, str]]:
    """Return a CSV file's rows, comments left out."""
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def column(rows: list[dict[str, str]], name: str) -> list[float]:
    return [float(row[name]) for row in rows]


def draw_paper(rows: list[dict[str, str]]) -> Path:
    """Draw the undriven centre: measured by both sources against the declared model."""
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.8), sharey=True, layout="constrained")
    for axis, source, title in zip(axes, ("comsol", "camera"), ("COMSOL model", "thermal camera"), strict=True):
        mine = [row for row in rows if row["source"] == source]
        names = [f"{row['pitch_mm']} mm\nfan {'on' if float(row['fan']) else 'off'}" for row in mine]
        places = range(len(mine))
        axis.bar([p - 0.2 for p in places], column(mine, "t_centre_c"), 0.4, label="paper", color="#888888")
        axis.bar([p + 0.2 for p in places], column(mine, "model_centre_c"), 0.4, label="Ninespring", color="#d9631e")
        axis.set_xticks(list(places), names, fontsize=8)
        axis.set_title(f"against the paper's {title}")
    axes[0].set_ylabel("undriven centre, °C")
    axes[0].legend()
    path = OUT / "paper.png"
    figure.savefig(path, dpi=130)
    plt.close(figure)
    return path


def draw_policies(runs: dict[str, list[dict[str, str]]]) -> Path:
    """Draw every spring's temperature for each policy, the centre in its own colour."""
    figure, axes = plt.subplots(1, len(runs), figsize=(10, 4.2), sharey=True, layout="constrained")
    for axis, (policy, rows) in zip(axes, runs.items(), strict=True):
        time = column(rows, "time_s")
        for spring in range(1, 10):
            centre = spring == CENTRE
            axis.plot(
                time,
                column(rows, f"t{spring}_c"),
                color="#1f6fb4" if centre else "#d9631e",
                lw=1.8 if centre else 0.8,
                label="centre, not driven" if centre else ("driven" if spring == 1 else None),
            )
        axis.axhline(AUSTENITE_START_C, color="k", lw=0.7, ls=":")
        axis.text(time[-1], AUSTENITE_START_C + 1, "A$_s$", ha="right", fontsize=8)
        if (off := switched_off(rows)) is not None:
            axis.axvline(off, color="k", lw=0.7, ls="--")
            axis.text(off + 8, 122, "safety switches off", fontsize=8, va="center")
        axis.set_ylim(15, 126)
        axis.set_title(LABELS[policy])
        axis.set_xlabel("time, s")
    axes[0].set_ylabel("temperature, °C")
    axes[0].legend(loc="center right")
    path = OUT / "policies.png"
    figure.savefig(path, dpi=130)
    plt.close(figure)
    return path


def switched_off(rows: list[dict[str, str]]) -> float | None:
    """Return when the last current ended, s, where none flows at the end; None where the springs are still driven."""
    driven = [any(float(row[f"i{k}_a"]) > 0 for k in range(1, 10)) for row in rows]
    if driven[-1] or not any(driven):
        return None
    return float(rows[max(k for k, on in enumerate(driven) if on)]["time_s"])


def energy_j(rows: list[dict[str, str]]) -> float:
    """Return the electrical energy of a run, J: v i over each row's interval."""
    time = column(rows, "time_s")
    power = [sum(float(row[f"v{k}_v"]) * float(row[f"i{k}_a"]) for k in range(1, 10)) for row in rows]
    return sum(p * (later - now) for p, now, later in zip(power, time, time[1:], strict=False))


def main() -> int:
    OUT.mkdir(exist_ok=True)
    simulate("paper", "-o", OUT / "paper.csv")
    runs = {}
    for policy in POLICIES:
        path = OUT / f"{policy}.csv"
        simulate("run", SCENARIO, "--policy", policy, "-o", path)
        runs[policy] = read(path)
    if FIRMWARE.exists():
        simulate("run", ROOT / "sim_host" / "scenarios" / "demo_board.ini", "--board", "avr", "-o", OUT / "board.csv")
    else:
        print("\nNO FIRMWARE was built (avr-gcc is missing): the same run on the simulated Mega is left out")

    print("\nEight springs driven for ten minutes, the centre not:\n")
    print(f"{'policy':<20} {'hottest spring':>15} {'centre at the end':>18} {'energy':>9}")
    for policy, rows in runs.items():
        hottest = max(max(column(rows, f"t{k}_c")) for k in range(1, 10))
        centre = float(rows[-1][f"t{CENTRE}_c"])
        print(f"{LABELS[policy]:<20} {hottest:>12.1f} °C {centre:>15.1f} °C {energy_j(rows):>7.0f} J")
    pictures = [draw_paper(read(OUT / "paper.csv")), draw_policies(runs)]
    print("\nPictures: " + ", ".join(str(picture.relative_to(ROOT)) for picture in pictures))
    return 0


if __name__ == "__main__":
    sys.exit(main())
