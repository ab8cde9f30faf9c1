#!/usr/bin/env python3
"""Writes docs/worked-example.md and its picture: an hour of a real board's logs, diagnosed, and runs of other days predicted.

    .venv/bin/python script/worked_example.py

Every number of the page is made here, from data/tclab_doe (BSD-3): run it again where the diagnosis has changed.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt
from ninespring import importing
from ninespring.fit.predict import predict
from ninespring.logs import Run, read_log
from ninespring.models import Array, Model
from ninespring.verdict import diagnosis
from ninespring.verdict.result import model_of

ROOT = Path(__file__).resolve().parent.parent
DATA = ROOT / "data" / "tclab_doe"
PAGE, PICTURE = ROOT / "docs" / "worked-example.md", ROOT / "docs" / "figures" / "worked_example.svg"
FITTED = ("step_50_run_1", "sin_2_50_run_1", "sin_5_50_run_1", "sin_50_50_run_1")
UNSEEN = ("step_50_run_2", "step_50_run_3", "sin_5_50_run_2", "sin_5_50_run_3")
SHOWN = "sin_5_50_run_2"


def declared() -> Model:
    """Return what is known of a heater beforehand: 4 g of 500 J/kgK. The rest is where a fit begins."""
    model = Model(Array(1, 2))
    model.parameters = {"heat_capacity_j_per_k": 2.0, "loss_w_per_k": 0.012, "command_power_w": 1.0}
    return model


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
        above.plot(run.time_s, run.temperature_c[:, k], ".", color="0.6", ms=3, label="read" if k == 0 else None)
        for text, (value, style) in shown.items():
            label = f"heater {k + 1}, {text}"
            above.plot(run.time_s, value[:, k], style, color=colour, lw=1.2, label=label)
            below.plot(run.time_s, run.temperature_c[:, k] - value[:, k], style, color=colour, lw=0.8)
    above.set_ylabel("temperature, degC")
    below.set_ylabel("read less\nforetold, K")
    below.set_xlabel("time, s")
    below.axhline(0.0, color="0.7", lw=0.8)
    above.legend(fontsize=8, loc="lower right")
    mpl.rcParams["svg.hashsalt"] = "ninespring"
    figure.savefig(PICTURE, metadata={"Date": None})
    plt.close(figure)


PAGE_TEXT = """# A worked example: an hour of a real board

<!-- Written by script/worked_example.py: change that, not this. -->

A board that is neither ours nor simulated: a Temperature Control Lab, two transistors that heat each other, on an Arduino. Somebody else logged it on
different days for other ends: command in percent, readings in steps of 0.32 K, no ambient, no supply voltage, no power
(`data/tclab_doe`, BSD-3; thirteen runs of 15 minutes). Four runs, an hour together, are what there is to learn from. What is asked:
what happens in runs of other days.

## From their file to a log

    .venv/bin/ninespring import --map data/tclab_doe/tclab-doe.toml \\
        data/tclab_doe/validation_experiment_env_2_step_50_run_1.csv -o step.csv

and likewise `sin_2_50_run_1`, `sin_5_50_run_1` and `sin_50_50_run_1` (heater 1 in sines of 2, 5 and 50 minutes about half its power; heater 2 stays off).

## What the hour says

    .venv/bin/ninespring diagnose --model declared.toml step.csv sin2.csv sin5.csv sin50.csv -o diagnosis

`declared.toml` has a 1 x 2 array and one number that nothing in a command can tell, the heat capacity (4 g of 500 J/kgK: 2 J/K). Two nodes, their losses, their coupling, the
heaters' strength and each day's room are fitted and leave {before_fit:.2f} K (rms); with what was found {after_fit:.2f} K:

{effects}

## What happens in runs of other days

    .venv/bin/ninespring predict --model diagnosis/model.toml other.csv -o predicted.csv

None of these was fitted. Each prediction knows the run's command and its first reading, which is taken for the room (`ambient_c`); the rest is the model.

| run | declared network, fitted: error, K rms | diagnosed |
|---|---|---|
{rows}

![A run of another day, foretold: readings, both models, and what they leave](figures/worked_example.svg)

The picture is `{shown}`. {verdict}

For scale: two runs of the same command on different days (the steps) differ from each other by {spread:.2f} K rms from their own first readings on.
"""


def main() -> int:
    """Write the page."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        learnt = [log(one, folder) for one in FITTED]
        others = {one: log(one, folder) for one in UNSEEN}
    found = diagnosis.diagnose(Array(1, 2), learnt, model=declared())
    before, after = model_of(found.problem, found.baseline, learnt), found.model
    listed = [f"- **{one['name']}** ({one['certainty']}): {one['text']}" for one in found.result["effects"]]
    listed += [f"- {one['text']}" for one in found.result["runs_differ"] if "text" in one]
    errors = {one: (error_k(before, run), error_k(after, run)) for one, run in others.items()}
    worse = [one for one, (plain, better) in errors.items() if better > plain]
    mean = [float(np.mean([pair[k] for pair in errors.values()])) for k in (0, 1)]
    rises = [run.temperature_c - run.temperature_c[0] for run in (others["step_50_run_2"], others["step_50_run_3"])]
    rows = min(map(len, rises))
    verdict = f"Over the four runs the error goes from {mean[0]:.2f} to {mean[1]:.2f} K."
    if worse:
        verdict += f" It is larger than the declared network's in {', '.join(f'`{one}`' for one in worse)}."
    draw(others[SHOWN], before, after)
    PAGE.write_text(
        PAGE_TEXT.format(
            before_fit=found.result["baseline"]["rmse_c"],
            after_fit=found.result["after"]["rmse_c"],
            effects="\n".join(listed) or "- nothing beyond the declared network",
            rows="\n".join(f"| `{one}` | {a:.2f} | {b:.2f} |" for one, (a, b) in errors.items()),
            shown=SHOWN,
            verdict=verdict,
            spread=float(np.sqrt(np.nanmean((rises[0][:rows] - rises[1][:rows]) ** 2))),
        ),
        encoding="utf-8",
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
