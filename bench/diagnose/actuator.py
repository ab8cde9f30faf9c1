"""A real NiTi actuator, each run alone: what is named, and how far off the model is as fitted and in what it did not see.

    .venv/bin/python bench/diagnose/actuator.py [--json FILE]

Its logs (niti_pulse) are read from NINESPRING_PRIVATE, and nothing is told where that is not set: their licence does not let them be
carried. By hand, by least squares, they come to 0.73 and 0.84 K with latent heat, a lag and a room some 3 K off.

The likelihood does not follow that hand in AB1. What it leaves wanders as quickly as what the declared model leaves (-1239 nats against
-1235; latent heat alone: -1189), because it is 2.6 K off while the spring is heated; and where errors wander by 2 K within a minute, an offset of
the room is worth 0 to 3 nats, whatever it stands beside. Noise that grows with the rate at which temperature changes was tried, as one more number
of the likelihood: it is worth 28 to 33 nats beside the declared model, 1 to 3 beside latent heat. So it stands in for latent heat: AB0
would lose that name, and AB1 would gain none.
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
