#!/usr/bin/env python3
"""Writes docs/worked-example.md and its picture: a real board's logs, diagnosed, and runs of other days predicted.

    .venv/bin/python script/worked_example.py

Every number of the page is made here, from data/tclab_doe (BSD-3): run it again where the diagnosis has changed.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import textwrap
from dataclasses import dataclass, replace
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt
from ninespring.find import diagnosis
from ninespring.infer.predict import predict
from ninespring.infer.result import model_of
from ninespring.io import importing
from ninespring.io.logs import Run, read_log
from ninespring.model.models import Model, read_model

ROOT = Path(__file__).resolve().parent.parent
DATA = ROOT / "data" / "tclab_doe"
PAGE, PICTURE = ROOT / "docs" / "worked-example.md", ROOT / "docs" / "figures" / "worked_example.svg"
STEP = "step_50_run_1"
HOUR = (STEP, "sin_2_50_run_1", "sin_5_50_run_1", "sin_50_50_run_1")
UNSEEN = ("step_50_run_2", "step_50_run_3", "sin_5_50_run_2", "sin_5_50_run_3")
SHOWN = "sin_5_50_run_2"


DECLARED = """\
schema = "ninespring.model/1"
array = {rows = 1, cols = 2}
parameter = [
    {name = "heat_capacity_j_per_k", value = 2, unit = "J/K"},
    {name = "loss_w_per_k", value = 0.012, unit = "W/K"},    # from here on only where a fit begins
    {name = "command_power_w", value = 1, unit = "W"},
]
"""
"""What is known of a heater beforehand: 4 g of 500 J/kgK."""


def declared(folder: Path) -> Model:
    """Return that model."""
    path = folder / "declared.toml"
    path.write_text(DECLARED, encoding="utf-8")
    return read_model(path)


def log(name: str, folder: Path) -> Run:
    """Return one of the board's files as a log."""
    path = folder / f"{name}.csv"
    source = DATA / f"validation_experiment_env_2_{name}.csv"
    path.write_text(importing.import_table(source, str(DATA / "tclab-doe.toml")), encoding="utf-8")
    return read_log(path, 2)


def foretold(model: Model, run: Run) -> np.ndarray:
    """Return what a model says of a run, (rows, 2), degC: its room is what both cold heaters read at first."""
    room = np.full(len(run.time_s), float(np.nanmean(run.temperature_c[0])))
    return predict(model, replace(run, ambient_c=room))


def error_k(model: Model, run: Run) -> float:
    """Return the rms error of a prediction, K."""
    return float(np.sqrt(np.nanmean((run.temperature_c - foretold(model, run)) ** 2)))


def draw(run: Run, before: Model, after: Model) -> None:
    """Draw the run that was foretold: readings, both models, and what they leave."""
    figure, (above, below) = plt.subplots(
        2, 1, figsize=(8, 5.4), sharex=True, height_ratios=(2, 1), layout="constrained"
    )
    shown = {"declared network, fitted": (foretold(before, run), "--"), "diagnosed": (foretold(after, run), "-")}
    for k, colour in enumerate(("C3", "C0")):
        above.plot(run.time_s[::5], run.temperature_c[::5, k], ".", color="0.6", ms=3, label=None if k else "read")
        for text, (value, style) in shown.items():
            label = f"heater {k + 1}, {text}"
            above.plot(run.time_s, value[:, k], style, color=colour, lw=1.2, label=label)
            below.plot(run.time_s, run.temperature_c[:, k] - value[:, k], style, color=colour, lw=0.8)
    above.set_ylabel("temperature, degC")
    below.set_ylabel("read less\nforetold, K")
    below.set_xlabel("time, s")
    below.axhline(0.0, color="0.7", lw=0.8)
    above.legend(fontsize=8, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, frameon=False)
    mpl.rcParams["svg.hashsalt"] = "ninespring"
    figure.savefig(PICTURE, metadata={"Date": None})
    plt.close(figure)


PAGE_TEXT = """# A worked example: a real board, one day and another

<!-- Written by script/worked_example.py: change that, not this. -->

A board that is neither ours nor simulated: a Temperature Control Lab, two transistors that heat each other, on an Arduino. Somebody else logged it on
different days for other ends: command in percent, readings in steps of 0.32 K, no ambient, no supply voltage, no power
(`data/tclab_doe`, BSD-3; thirteen runs of 15 minutes). What is asked: what happens in runs of other days.

## From their file to a log

    .venv/bin/ninespring import --map data/tclab_doe/tclab-doe.toml \\
        data/tclab_doe/validation_experiment_env_2_step_50_run_1.csv -o step.csv

Heater 1 steps to half its power, heater 2 stays off. Likewise `sin_2_50_run_1`, `sin_5_50_run_1` and `sin_50_50_run_1`: sines of 2, 5 and 50 minutes about it.

## What one run says

    .venv/bin/ninespring diagnose --model declared.toml step.csv -o diagnosis

`declared.toml` has a 1 x 2 array and one number that nothing in a command can tell, the heat capacity (4 g of 500 J/kgK: 2 J/K):

{declared}
Two nodes, their losses, their coupling, the
heaters' strength and the day's room are fitted, and leave {step.before:.2f} K (rms); with what was found {step.after:.2f} K:

{step.said}

## What happens in runs of other days

    .venv/bin/ninespring predict --model diagnosis/model.toml other.csv -o predicted.csv

None of these was fitted. Each prediction knows the run's command and its first reading, which is taken for the room (`ambient_c`); the rest is the model. Errors in K rms:

| run | declared network, fitted to the step | diagnosed from it | fitted to an hour | diagnosed from it |
|---|---|---|---|---|
{rows}

![A run of another day, foretold from the step: readings, both models, and what they leave](figures/worked_example.svg)

The picture is `{shown}`, foretold from the step. For scale: two runs of the same command on different days (the steps) differ from each other by {spread:.2f} K rms, from their own
first readings on: what the room does during a run no model of the board can know.

## What an hour says

    .venv/bin/ninespring diagnose --model declared.toml step.csv sin2.csv sin5.csv sin50.csv -o hour

All four runs, of different days, with a room of its own for each: the declared network leaves {hour.before:.2f} K, with what was found {hour.after:.2f} K:

{hour.said}
"""


@dataclass(frozen=True)
class Learnt:
    """What was learnt from some runs: the declared network, fitted, and the diagnosed one."""

    declared: Model
    diagnosed: Model
    before: float
    """Error of the first in what it was fitted to, K rms."""
    after: float
    said: str
    """What was found, a line each."""


def learn(model: Model, runs: list[Run]) -> Learnt:
    """Diagnose some runs."""
    found = diagnosis.diagnose(model.array, runs, model=model)
    result = found.result
    said = [f"- **{one['name']}** ({one['certainty']}): {one['text']}" for one in result["effects"]]
    said += [f"- {one['text']}" for one in (*result["runs_differ"], *result["unnamed"]) if "text" in one]
    said = said or ["- nothing beyond the declared network has a name"]
    if result["unexplained"]:
        said.append("- `unexplained`: more is left than the thermometers' noise")
    said += [f"- warning: {text}" for text in result["warnings"] if "not named" in text]
    return Learnt(
        model_of(found.problem, found.baseline, runs),
        found.model,
        result["baseline"]["rmse_c"],
        result["after"]["rmse_c"],
        "\n".join(said),
    )


def main() -> int:
    """Write the page."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        runs = {one: log(one, folder) for one in (*HOUR, *UNSEEN)}
        model = declared(folder)
    step, hour = learn(model, [runs[STEP]]), learn(model, [runs[one] for one in HOUR])
    models = (step.declared, step.diagnosed, hour.declared, hour.diagnosed)
    rows = [f"| `{one}` | {' | '.join(f'{error_k(model, runs[one]):.2f}' for model in models)} |" for one in UNSEEN]
    rises = [runs[one].temperature_c - runs[one].temperature_c[0] for one in ("step_50_run_2", "step_50_run_3")]
    both = min(map(len, rises))
    draw(runs[SHOWN], step.declared, step.diagnosed)
    PAGE.write_text(
        PAGE_TEXT.format(
            step=step,
            hour=hour,
            declared=textwrap.indent(DECLARED, "    "),
            rows="\n".join(rows),
            shown=SHOWN,
            spread=float(np.sqrt(np.nanmean((rises[0][:both] - rises[1][:both]) ** 2))),
        ),
        encoding="utf-8",
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
