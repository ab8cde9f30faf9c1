"""The demonstration behind script/demo: runs what the tree has built, and writes demo/index.html from it."""

from __future__ import annotations

import base64
import contextlib
import csv
import html
import json
import math
import subprocess
import sys
import tomllib
from collections.abc import Iterable, Iterator
from pathlib import Path

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt
from matplotlib.figure import Figure

ROOT = Path(__file__).resolve().parent.parent
OUT = ROOT / "demo"
SIM = ROOT / "build" / "host" / "ninespring-sim"
NINESPRING = ROOT / ".venv" / "bin" / "ninespring"
BENCH = ROOT / "build" / "host" / "bench" / "policy" / "bench_policy"
FIRMWARE = ROOT / "build" / "avr" / "firmware.elf"
SCENARIOS = ROOT / "sim_host" / "scenarios"
DRIVES = {"b105": "kept at 105 °C, as in the paper", "b15": "1.5 A from cold", "eight": "precompensate"}
BENCH_SUFFIX = {"b105": " - B105", "b15": " - B1.5", "eight": ""}
DRIVEN = [1, 2, 3, 4, 6, 7, 8, 9]
CENTRE = 5
CURRENTS = [f"i{k}_a" for k in DRIVEN]
HEATS_A = 1.5
PHASES = [f"x{k}" for k in DRIVEN]
MARTENSITE_START_C, AUSTENITE_START_C = 78.0, 88.0
NOTHING_KNOWN = "at 0.5 = fail brown_out\nat 1 = unlock\n"
EDGE_LOSS = 0.25
PLAN_S, DRIVE_S, HELD_S = 600, 300, 100
DRIVE_STEPS = """policy precompensate
off all
fan 0
at 5 = pattern 111101111
"""
PAGE = """<!doctype html>
<html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>Ninespring</title>
<style>
body {{ font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; color: #222; background: #fff }}
img {{ max-width: 100% }}
table {{ border-collapse: collapse }}
th, td {{ padding: .2rem .8rem; border-bottom: 1px solid #ddd; text-align: right }}
td:first-child {{ text-align: left }}
</style>
<h1>Ninespring</h1>
<p>Firmware that drives arrays of Nitinol springs, and knows what each spring's heat does to its neighbours. Every figure here
comes from the run that wrote this page; its logs lie beside it. Next: <code>.venv/bin/ninespring dashboard --simulate</code>.</p>
{sections}
</html>
"""

plt.rcParams.update({"font.size": 9, "axes.grid": True, "grid.alpha": 0.3, "legend.frameon": False})

Columns = dict[str, list[float]]


def run(*arguments: object) -> None:
    """Run a program of the tree; what it prints goes to the terminal, its errors end the demonstration."""
    words = [str(argument) for argument in arguments]
    print("\n$ " + " ".join(word.removeprefix(f"{ROOT}/") for word in words), flush=True)
    if code := subprocess.run(words, check=False).returncode:
        sys.exit(f"demo: {Path(words[0]).name} ended with {code}")


def read(path: Path) -> Columns:
    """Return a CSV file's columns by name; comments are left out, an empty field is NaN."""
    with path.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    return {name: [float(row[name] or "nan") for row in rows] for name in rows[0] if name not in ("source", "state")}


def picture(figure: Figure, name: str, text: str) -> str:
    """Return a figure as an image that stands in the page itself, and write it beside it; text says what is to be seen."""
    path = OUT / f"{name}.svg"
    figure.savefig(path)
    plt.close(figure)
    data = base64.b64encode(path.read_bytes()).decode()
    return f'<img alt="{html.escape(text)}" src="data:image/svg+xml;base64,{data}">'


def table(head: list[str], rows: list[list[str]]) -> str:
    """Return an HTML table; the first column is text, the others are figures."""
    top = "".join(f"<th>{html.escape(cell)}</th>" for cell in head)
    body = "".join("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><tr>{top}</tr>{body}</table>"


def paper() -> str:
    """The paper's experiment: the model that COMSOL's values declare, against COMSOL and the camera."""
    run(SIM, "paper", "-o", OUT / "paper.csv", "--json", OUT / "paper.json")
    result = json.loads((OUT / "paper.json").read_text(encoding="utf-8"))
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.4), sharey=True, layout="constrained")
    for axis, source, title in zip(axes, ("comsol", "camera"), ("COMSOL model", "thermal camera"), strict=True):
        cases = [case for case in result["cases"] if case["source"] == source]
        places = range(len(cases))
        axis.bar([p - 0.2 for p in places], [c["t_centre_c"] for c in cases], 0.4, label="paper", color="#888888")
        model = [c["model_centre_c"] for c in cases]
        axis.bar([p + 0.2 for p in places], model, 0.4, label="Ninespring", color="#d9631e")
        names = [f"{c['pitch_mm']:g} mm\nfan {'on' if c['fan'] else 'off'}" for c in cases]
        axis.set_xticks(list(places), names, fontsize=8)
        axis.set_title(f"the paper's {title}")
    axes[0].set_ylabel("undriven centre, °C")
    axes[0].legend()
    comsol, camera = result["errors"]["comsol"], result["errors"]["camera"]
    return f"""<h2>The paper's experiment</h2>
<p>Eight springs hot, the centre not driven: how warm does it get? The declared model meets the paper's six COMSOL values to
<b>{comsol["rmse_c"]:.2f} °C</b> rms. The thermal camera saw another array: the model misses its six by
<b>{camera["rmse_c"]:.1f} °C</b> rms, at most {camera["largest_error_c"]:.1f}. Nothing was tuned to the camera.
<code>docs/physics.md</code> says what may explain it, <code>docs/results.md</code> how well each explanation fits.</p>
{picture(figure, "paper", "bars: the centre's temperature in the paper and in the model")}"""


def drive() -> str:
    """Eight springs driven for ten minutes by the policy and by two baselines."""
    run(BENCH, "--part", "none", "--traces", OUT)
    run(BENCH, "--part", "nominal", "--json", OUT / "policy.json")
    runs = {name: read(OUT / f"policy_{name}.csv") for name in DRIVES}
    figures = {row["figure"]: row["value"] for row in json.loads((OUT / "policy.json").read_text(encoding="utf-8"))}

    figure, axes = plt.subplots(1, 2, figsize=(9, 3.4), layout="constrained")
    for name, label in DRIVES.items():
        axes[0].plot(runs[name]["time_s"], runs[name]["t1_c"], label=label)
        axes[1].plot(runs[name]["time_s"], runs[name][f"t{CENTRE}_c"], label=label)
    axes[0].axhspan(MARTENSITE_START_C, AUSTENITE_START_C, alpha=0.12, color="tab:green", linewidth=0)
    axes[0].set(title="a driven corner", xlabel="time, s", ylabel="temperature, °C", ylim=(15, 115))
    axes[1].set(title="the centre, not driven", xlabel="time, s", ylim=(15, 60))
    axes[1].legend(loc="lower right")

    def bench(figure_name: str, drive: str, unit: str) -> str:
        value = figures.get(figure_name + BENCH_SUFFIX[drive])
        return "–" if value is None else f"{value:.1f} {unit}"

    def transformed(trace: Columns) -> str:
        return f"{sum(trace[f'x{k}'][-1] >= 0.99 for k in DRIVEN)} of {len(DRIVEN)}"

    def hottest(trace: Columns) -> str:
        return f"{max(max(trace[f't{k}_c']) for k in DRIVEN):.0f} °C"

    rows = [
        ["driven springs that are austenite at the end", *(transformed(trace) for trace in runs.values())],
        ["hottest spring", *(hottest(trace) for trace in runs.values())],
        *(
            [words, *(bench(name, drive, unit) for drive in DRIVES)]
            for words, name, unit in (
                ("what the undriven centre rises by", "rise of the undriven centre, eight held 10 min", "K"),
                (
                    "all nine from cold to 99 % austenite, within 15 A",
                    "all nine, within 15 A (B105: 1.67 A each, B1.5: 1.5 A each)",
                    "s",
                ),
                (
                    "all nine on, the centre switched off: back to martensite after",
                    "release: centre of eight held, to 99 % martensite",
                    "s",
                ),
            )
        ),
    ]
    return f"""<h2>The drive, against what one would do without it</h2>
<p>Eight springs on for ten minutes, the centre off. <code>precompensate</code> heats a spring until it has transformed, and then
holds it in the hysteresis band (green), where it stays austenite at the least heat. The chip was told that the springs are cold
(<code>model cold</code>); what it does without that word stands below.</p>
{table(["", *DRIVES.values()], rows)}
{picture(figure, "drive", "temperature of a driven corner and of the centre over ten minutes, three ways to drive")}"""


def moments(trace: Columns) -> tuple[float, float]:
    """Return when the first spring is heated, and when all driven springs have transformed, s."""
    first_s = next((t for k, t in enumerate(trace["time_s"]) if any(trace[c][k] > HEATS_A for c in CURRENTS)), None)
    full_s = next((t for k, t in enumerate(trace["time_s"]) if all(trace[x][k] >= 0.99 for x in PHASES)), None)
    if first_s is None or full_s is None:
        sys.exit("demo: the springs were not driven, or did not transform")
    return first_s, full_s


def start() -> str:
    """When nothing is known, as after power-on, and with the hint that all is cold."""
    told = SCENARIOS / "demo_start.ini"
    unknown = OUT / "start_unknown.ini"
    unknown.write_text(
        told.read_text(encoding="utf-8").replace("[events]\n", f"[events]\n{NOTHING_KNOWN}"), encoding="utf-8"
    )
    board = ["--board", "avr"] if FIRMWARE.exists() else []
    which = "the firmware in a simulated Mega" if board else "natively: avr-gcc is missing"
    runs = {
        "as after power-on, natively": OUT / "start_unknown.csv",
        f"told model cold, {which}": OUT / "start_told.csv",
    }
    run(SIM, "run", unknown, "-o", OUT / "start_unknown.csv")
    run(SIM, "run", told, *board, "-o", OUT / "start_told.csv")
    figure, axes = plt.subplots(1, len(runs), figsize=(9, 3.4), sharey=True, squeeze=False, layout="constrained")
    rows = []
    for axis, (title, path) in zip(axes[0], runs.items(), strict=True):
        trace = read(path)
        for k in range(1, 10):
            centre = k == CENTRE
            label = "centre, not driven" if centre else "driven" if k == 1 else None
            axis.plot(trace["time_s"], trace[f"t{k}_c"], label=label, color="#1f6fb4" if centre else "#d9631e")
        axis.set(title=title, xlabel="time, s", ylim=(15, 115))
        first_s, full_s = moments(trace)
        rows.append([title, f"{first_s:.0f} s", f"{full_s:.0f} s"])
    axes[0][0].set_ylabel("temperature, °C")
    axes[0][0].legend(loc="upper left")
    return f"""<h2>From power-on</h2>
<p>Two console lines, at 2 and at 5 s: <code>policy precompensate</code>, <code>pattern 111101111</code>. A board that was just switched on
cannot know that the springs are cold: it waits until none can still be hot. The hint <code>model cold</code> makes it begin at once.</p>
{table(["", "heats from", "all eight transformed"], rows)}
{picture(figure, "start", "temperatures of nine springs from power-on, with and without the hint")}"""


@contextlib.contextmanager
def undeclared_board() -> Iterator[tuple[str, str]]:
    """Yield the ports of a simulated board and of its thermometers; its array does what nobody declared."""
    words = ["board", "--speed", "max", "--thermometers", "pty"]
    words += ["--set", "plant.effects=latent_heat,resistance_phase,edge_loss"]
    words += ["--set", f"plant.edge_loss_fraction={EDGE_LOSS}"]
    with subprocess.Popen([str(SIM), *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            port, thermometers = (process.stdout.readline().strip() for _ in range(2))
            if not thermometers:
                sys.exit(f"demo: the simulated board does not start: {process.stderr.read().strip()}")
            yield port, thermometers
        finally:
            process.terminate()


def record(ports: tuple[str, str], name: str, steps: Path, duration_s: int) -> Path:
    """Return a log of the board with its thermometers, driven by a script of steps."""
    log, (port, thermometers) = OUT / f"{name}.csv", ports
    words = ["--port", port, "--thermometers", thermometers, "--run", steps, "--duration", duration_s]
    run(NINESPRING, "record", *words, "-o", log)
    return log


def chip_error(trace: Columns) -> float:
    """Return by how much the chip's temperatures are off the thermometers', K rms of all springs."""
    off = [m - t for k in range(1, 10) for m, t in zip(trace[f"m{k}_c"], trace[f"t{k}_c"], strict=True)]
    known = [one for one in off if not math.isnan(one)]
    return math.sqrt(sum(one**2 for one in known) / len(known))


def mean(values: Iterable[float]) -> float:
    known = [one for one in values if not math.isnan(one)]
    return sum(known) / len(known)


def heatings(celsius: Iterable[float]) -> int:
    """Return how often a spring was heated through its transformation: from a hold's temperatures to above austenite start."""
    count, below = 0, True
    for one in celsius:
        if below and one > AUSTENITE_START_C + 2.0:
            count, below = count + 1, False
        elif one < (MARTENSITE_START_C + AUSTENITE_START_C) / 2.0:
            below = True
    return count


def held(trace: Columns) -> dict[str, float]:
    """Return what the thermometers say of the driven springs while they are held, and what that costs."""
    first = next(k for k, t in enumerate(trace["time_s"]) if t - trace["time_s"][0] >= DRIVE_S - HELD_S)
    mean_c = [mean(trace[f"t{k}_c"][first:]) for k in DRIVEN]
    power = [
        mean(i * v for i, v in zip(trace[f"i{k}_a"][first:], trace[f"v{k}_v"][first:], strict=True)) for k in DRIVEN
    ]
    hottest = max(t for k in DRIVEN for t in trace[f"t{k}_c"] if not math.isnan(t))
    again = sum(heatings(trace[f"t{k}_c"]) - 1 for k in DRIVEN)
    return {"again": again, "coldest": min(mean_c), "warmest": max(mean_c), "hottest": hottest, "watts": sum(power)}


def undeclared() -> str:
    """Find an effect that nobody declared, put it on the chip, and drive again: the chip's error and the drive."""
    title = "<h2>An effect that nobody declared</h2>"
    if not FIRMWARE.exists():
        return f"{title}<p>Left out: it needs the simulated Mega, and avr-gcc is missing.</p>"
    plan, drive_steps = OUT / "plan.txt", OUT / "drive.txt"
    drive_steps.write_text(DRIVE_STEPS, encoding="utf-8")
    run(NINESPRING, "plan", "--duration", PLAN_S, "-o", plan)
    with undeclared_board() as ports:
        measured = record(ports, "measured", plan, PLAN_S)
        traces = {"before": read(record(ports, "before", drive_steps, DRIVE_S))}
        run(NINESPRING, "diagnose", measured, "-o", OUT / "diagnosis")
        run(NINESPRING, "export", "--model", OUT / "diagnosis" / "model.toml", "-o", OUT / "settings.txt")
        run(NINESPRING, "upload", "--port", ports[0], OUT / "settings.txt")
        traces["after"] = read(record(ports, "after", drive_steps, DRIVE_S))
    model = tomllib.loads((OUT / "diagnosis" / "model.toml").read_text(encoding="utf-8"))
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.2), sharey=True, layout="constrained")
    for axis, (name, trace) in zip(axes, traces.items(), strict=True):
        seconds = [t - trace["time_s"][0] for t in trace["time_s"]]
        for k, colour in ((1, "#d9631e"), (2, "#8a5fb0"), (CENTRE, "#1f6fb4")):
            axis.plot(
                seconds,
                trace[f"t{k}_c"],
                color=colour,
                label={1: "a corner", 2: "an edge", CENTRE: "the centre, off"}[k],
            )
            axis.plot(seconds, trace[f"m{k}_c"], color=colour, linestyle="dotted")
        axis.set(title=f"{name}: off by {chip_error(trace):.2f} K rms", xlabel="time, s", ylim=(15, 115))
    axes[0].set_ylabel("°C; dotted: the chip's belief")
    axes[0].legend(loc="lower right")
    found = ", ".join(model["effects"])
    numbers = [
        [
            p["name"] + (f"[{p['spring']}]" if "spring" in p else ""),
            f"{p['value']:.4g} {p['unit']}".removesuffix(" 1"),
            f"{p['stderr']:.1g}",
        ]
        for p in model["parameter"]
        if p.get("effect") in model["effects"] and "stderr" in p
    ]
    drives = {name: held(trace) for name, trace in traces.items()}
    rows = [
        [
            "the chip's temperatures, against the thermometers",
            *(f"{chip_error(one):.2f} K rms" for one in traces.values()),
        ]
    ]
    rows += [
        [words, *(f"{drives[name][key]:.{digits}f} {unit}" for name in traces)]
        for words, key, digits, unit in (
            ("held springs: the coolest, mean", "coldest", 1, "°C"),
            ("held springs: the warmest, mean", "warmest", 1, "°C"),
            ("hottest that a driven spring came", "hottest", 1, "°C"),
            ("springs that had lost their phase and were heated again", "again", 0, "times"),
            ("power of the eight while they are held", "watts", 2, "W"),
        )
    ]
    return f"""{title}
<p>This simulated array loses a quarter more heat for each free side of a spring (<code>edge_loss_fraction</code> {EDGE_LOSS}): corners
twice. Neither the chip nor the calibration is told. The firmware runs in a simulated Mega with thermometers beside it (0.1 K of noise):
<code>record</code> logs {PLAN_S // 60} minutes of <code>ninespring plan</code>, <code>diagnose</code> is given the log, <code>export</code> and
<code>upload</code> put what it found on the chip. The effects in the model: <b>{html.escape(found)}</b>.</p>
{table(["", "found", "+-"], numbers)}
<p>Before and after, the same drive that no fit has seen: <code>policy precompensate</code>, eight springs on, the centre off. A spring
that is held below {MARTENSITE_START_C:.0f} °C, where martensite starts, loses its phase.</p>
{table(["", *traces], rows)}
{picture(figure, "undeclared", "temperatures of three springs, measured and believed by the chip, before and after")}
<p>The whole <a href="diagnosis/report.html">report</a>; <a href="settings.txt">what was uploaded</a>.</p>"""


def main() -> int:
    OUT.mkdir(exist_ok=True)
    sections = [paper(), drive(), start(), undeclared()]
    page = OUT / "index.html"
    page.write_text(PAGE.format(sections="\n".join(sections)), encoding="utf-8")
    print(f"\nOpen {page.relative_to(ROOT)}")
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit("demo: stopped")
