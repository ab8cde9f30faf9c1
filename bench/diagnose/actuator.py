"""A real NiTi actuator, each run alone: what is named, and how far off the model is as fitted and in what it did not see.

    .venv/bin/python bench/diagnose/actuator.py [--json FILE]

Its logs (niti_pulse) are read from NINESPRING_PRIVATE, and nothing is told where that is not set: their licence does not let them be
carried. By hand, by least squares, they come to 0.73 and 0.84 K with latent heat, a lag and a room some 3 K off.

What keeps the tool from there (measured on AB0, AB1 and 30 runs drawn from other equations, with errors that wander as these do; of ten of those that nothing was
developed on, latent heat and the room are named in nine, and what is left is 0.92 of what the errors are):
- A band of 0.5 K at 27.5 degC stands in for the room, in both, because a width's prior has it nearly as likely as 10 K. (Of 87 samples none is like that.) With widths as
  logarithms (0.7 about what is declared) it goes; then nothing is named in either, and 1.7 / 2.0 K are left.
- Beside such a band, or without, the likelihood takes what a room would explain for noise: in AB1 of 60 s, or of ten minutes and 3 K. A ramp of the room beside latent heat leaves 0.82 K there,
  is 6 nats likelier by least squares than that band and costs 5.5 (of 3 that it must be ahead), and 10 less likely than that noise.
- The rested spring begins 1.75 / 1.5 K above the logged room, which is 1.5 / 1.1 nats for an offset: room and latent heat end at 2.2 to 2.8 K and leave more than a ramp does.
- A fit and its errors, each as the other has it, have two hills: what is slow is the room's, or the errors'. Begun by least squares they reach the first one.
Noise that grows with the rate at which temperature changes, or with heavy tails, makes the room's offset worth 0 to 2 nats in AB1. The likeliest fit with all three leaves 1.1 K there, not 0.84.
All of that was built at once: alloys as closed loops of any widths with the samples' widths as prior, and a room of its own (3 K) beside each logged one.
Both are then named in both runs (room 2.0 +- 0.7 and 1.7 +- 0.8 K), but as fitted 1.07 / 1.51 K are left and of what was not seen 1.44 / 1.85 K (0.74 / 1.39
now): AB0 begins 1.7 K above its logged room and ends 3.3 K above it, which no constant says. A ramp beside all three leaves 0.65 / 0.58 K.
A fit by hand, from many beginnings (one node, closed loops of any widths, lag, room), says why neither will do:
- Least squares leave 0.71 / 0.81 K with bands of 27 to 60 K, and are 28 / 60 nats less likely than bands of 5 to 8 K about 40 to 41 degC, a lag of 0.5 to 0.65 s and
  a room 2.8 to 2.9 K off, much the same numbers in both runs, which leave 0.90 / 1.11 K and each foretell the other run to 1.09 / 1.03 K.
- Of the last half and third, least squares foretell 3.0 / 3.8 K, the declared model 2.4 / 2.7: the first half has the room 1.6 to 2.4 K colder than logged, the whole 3 K warmer.
- Air in a box (0.89 / 0.97 K as likely as can be) explains little: it warms while the spring cools, and readings rise from 150 s on, in part by jumps.
What the rest of the run says decides more than any likelihood of one pulse (the room, a lag and a narrow loop 20 K wide fitted at once, beside errors as least squares leave them; `find/rested.py`):
- Of the unseen 0.8 / 1.2 K are left with the room (2.6 to 2.8 K) and latent heat, 2.7 to 3.1 K without the room, 1.4 to 2.1 without latent heat. By errors that are the same with it and
  without, the room is worth 61 / 35 nats beside latent heat; by errors fitted anew for each, 0 / 7.
- AB1 is so given both names. In AB0 a band of 0.5 K at 27.7 degC foretells the same rest to 0.74 K, as it holds the spring up as the room does: it stays. With widths as logarithms (0.7 about what is declared)
  it goes (0.96 K left, 1.18 unseen).
- A lag is 2.4 / 3.8 nats by the same errors and nothing in the unseen: with it 0.83 / 1.11 K would be left, without 1.01 / 1.24.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from ninespring.find import diagnosis
from ninespring.io.logs import log_text, read_log
from ninespring.io.logs.run import Run
from ninespring.model.models import Array, Model
from tell import Figures, tell

FIGURES = Figures("python bench/diagnose/actuator.py")
row = FIGURES.row
ASKED = {"AB0.csv": "<= 0.8", "AB1.csv": "<= 0.92"}
"""Of the error as fitted, K."""


def only_falls(run: Run) -> float:
    """Return the least error, K, of any model by which a spring only cools once its drive is off for good."""
    from scipy.optimize import isotonic_regression  # SciPy 1.12: more than the package asks for

    shown = run.temperature_c[:, 0]
    off = int(np.flatnonzero(run.drive[:, 0] > 0)[-1]) + 1
    off += int(np.argmax(shown[off:]))  # a late thermometer still rises
    cooling = shown[off:]
    return math.sqrt(float(np.sum((cooling - isotonic_regression(cooling, increasing=False).x) ** 2)) / len(shown))


def niti(folder: Path) -> list[dict[str, Any]]:
    """Diagnose the runs of the real actuator, each alone, its alloy declared roughly."""
    out = []
    for file in sorted(folder.glob("*.csv")):
        raw = pd.read_csv(file)
        raw.columns = ["row", "t", "ambient", "force", "pwm", "rate"]
        raw = raw.rolling(15, center=True, min_periods=1).median().iloc[::20]
        columns = {"u1": raw.pwm / 255.0, "t1_c": raw.t, "ambient_c": raw.ambient}
        with tempfile.TemporaryDirectory() as temporary:
            path = Path(temporary) / "log.csv"
            path.write_text(log_text(raw.row.to_numpy() * 0.01, {k: v.to_numpy(float) for k, v in columns.items()}))
            run = read_log(path, 1)
        model = Model(Array(1, 1))
        model.parameters = {"command_power_w": 10.0, "austenite_start_c": 48.0, "austenite_finish_c": 58.0}
        model.parameters |= {"martensite_start_c": 42.0, "martensite_finish_c": 32.0}
        result = diagnosis.diagnose(Array(1, 1), [run], model=model).result
        names = [e["name"] for e in (*result["effects"], *result["runs_differ"])]
        out.append(
            {
                "file": file.name,
                "before": result["baseline"]["rmse_c"],
                "after": result["after"]["rmse_c"],
                "unseen": result.get("unseen", {}),
                "names": names,
                "least": only_falls(run),
            }
        )
    return out


def figures(done: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the figures of all runs."""
    out = []
    for one in done:
        file, named = one["file"], " + ".join(one["names"]) or "nothing"
        said = f"{file}, {named} named: error, {one['before']:.2f} before"
        out.append(row(said, one["after"], "K", ASKED.get(file, "")))
        both = "latent_heat" in one["names"] and "run_ambient_offset" in one["names"]
        out.append(row(f"{file}: latent heat and the room's offset named", float(both), "1", ">= 1"))
        unseen = one["unseen"]
        if unseen:
            better = min(unseen["declared_rmse_c"], unseen["with_lag_rmse_c"])
            out.append(
                row(f"{file}: the last half and third by what came before", unseen["rmse_c"], "K", f"<= {better:.3f}")
            )
        out.append(row(f"{file}: least of any model that only cools once the drive is off", one["least"], "K"))
    return out


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    private = os.environ.get("NINESPRING_PRIVATE")
    tell(figures(niti(Path(private) / "niti_pulse")) if private else [], options.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
