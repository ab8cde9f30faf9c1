"""Hours of log: is a run that the fit never saw predicted, and is nothing named where heat only wanders?

    .venv/bin/python bench/diagnose/hours.py [--cases N] [--first SEED] [--parts unseen,finned,wander,halves,half_a_day] [--json FILE]

The data are of `boards.py` and `finned.py`, which share nothing with the product, and the boards in data/.
"""

from __future__ import annotations

import argparse
import os
import resource
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import boards
import finned as fins
import numpy as np
import pandas as pd
from cases import NOISE_C
from kept import Kept
from ninespring.find import diagnosis
from ninespring.infer import problem as fitting
from ninespring.infer.predict import predict
from ninespring.infer.result import model_of
from ninespring.io import importing
from ninespring.io.logs import log_text, read_log
from ninespring.io.logs.run import Run
from ninespring.model.models import Array, Model
from paper import data
from tclab import LOGS, textbook
from tell import Figures, tell
from world import SPRINGS, World, random_inputs, simulate

HOURS = 2.0
NONSENSE_K = 20.0
"""A thermometer that is so far off shows nonsense: no model is to blame."""
FIGURES = Figures("python bench/diagnose/hours.py")
row, percent = FIGURES.row, FIGURES.percent
PARTS = "unseen", "finned", "wander", "halves", "half_a_day"
BOXES = ("shared_air", "plate_conduction")
"""Effects that are heat kept beside the heaters."""


def read(columns: dict[str, np.ndarray], folder: Path, name: str) -> Run:
    """Return a log of a board as it is read from its file."""
    table = pd.DataFrame({"time_s": np.arange(float(len(columns["u1"])))} | columns)
    path = folder / f"{name}.csv"
    path.write_text(table.to_csv(index=False))
    return read_log(path, boards.HEATERS)


def off(run: Run, shown: np.ndarray) -> float:
    """Return how far a prediction is from a run's readings, K rms, nonsense left out."""
    left = (run.temperature_c - shown)[np.isfinite(run.temperature_c)]
    left = left[np.abs(left) < NONSENSE_K]
    return float(np.sqrt(np.mean(left**2)))


def declared() -> Model:
    """Return what is told of such a board: roughly its heat, its losses, its power."""
    model = Model(Array(1, boards.HEATERS))
    model.parameters = {
        "heat_capacity_j_per_k": 2.0,
        "loss_w_per_k": 0.012,
        "orthogonal_w_per_k": 0.003,
        "command_power_w": 1.0,
    }
    return model


def baseline(runs: list[Run], given: Model, error: Callable[[Model], float]) -> float:
    """Return the error of the better of two models fitted to runs: the given one, and that with a lag."""
    array = Array(1, boards.HEATERS)
    fits = [diagnosis.fit_effects(array, runs, wanted, model=given)[:2] for wanted in ([], ["sensor_lag"])]
    return min(error(model_of(problem, fit, runs)) for problem, fit in fits)


def set_of(seed: int, part: int, wander: float, board: boards.Board | None = None) -> tuple[list[Run], Run, float]:
    """Return three runs of a board (each heater, both), another of both, and the true model's own error of that."""
    rng = np.random.default_rng([seed, part])
    board = board or boards.random_board(rng, wander)
    runs, rows = [], int(HOURS * boards.HOUR_S)
    with tempfile.TemporaryDirectory() as folder:
        for number, which in enumerate(((0,), (1,), (0, 1), (0, 1))):
            command = boards.random_steps(rng, rows, which)
            columns, truth = boards.log_of(rng, board, command, float(rng.uniform(18.0, 25.0)))
            runs.append(read(columns, Path(folder), f"run{number}"))
    return runs[:3], runs[3], off(runs[3], truth)


def unseen(seed: int) -> dict[str, Any]:
    """Fit three two-hour runs of a board with a box and a lag; return how well another is predicted."""
    runs, other, true_model = set_of(seed, 1, 0.005)
    begun = time.process_time()
    found = diagnosis.diagnose(Array(1, boards.HEATERS), runs, model=declared())
    names = [one["name"] for one in found.result["effects"]]
    return {
        "part": "unseen",
        "seed": seed,
        "names": names,
        "lag": "sensor_lag" in names,
        "box": any(name in names for name in BOXES),
        "said": found.result.get("unseen", {}).get("rmse_c"),
        "error": off(other, predict(found.model, other)),
        "true_model": true_model,
        "cpu_s": time.process_time() - begun,
    }


def finned(seed: int) -> dict[str, Any]:
    """Fit three runs of a finned board in a box; return how well two others are predicted, by both baselines too."""
    rng = np.random.default_rng([seed, 7])
    board, runs, usual = fins.random_board(rng), [], []
    with tempfile.TemporaryDirectory() as folder:
        for number, which in enumerate(((0,), (1,), (0, 1), (0, 1), (0, 1))):
            columns, shown = fins.log_of(rng, board, which)
            runs.append(read(columns, Path(folder), f"run{number}"))
            usual.append(shown)

    def error(model: Model) -> float:
        return float(np.sqrt(np.mean([off(run, predict(model, run)) ** 2 for run in runs[3:]])))

    found = diagnosis.diagnose(Array(1, boards.HEATERS), runs[:3], model=declared())
    return {
        "part": "finned",
        "seed": seed,
        "names": [one["name"] for one in found.result["effects"]],
        "error": error(found.model),
        "baseline": baseline(runs[:3], declared(), error),
        "true_model": float(np.sqrt(np.mean([off(r, s) ** 2 for r, s in zip(runs[3:], usual[3:], strict=True)]))),
    }


def wander(seed: int) -> dict[str, Any]:
    """Fit two one-node boards whose heat wanders, nothing else missing; return what was named."""
    rng = np.random.default_rng([seed, 3])
    plain = replace(boards.random_board(rng), lag_s=0.0, box_s=0.0)
    runs, _, _ = set_of(seed, 2, 0.005, plain)
    found = diagnosis.diagnose(Array(1, boards.HEATERS), runs[1:], model=declared())
    return {"part": "wander", "seed": seed, "names": [one["name"] for one in found.result["effects"]]}


def part_of(run: Run, begin: float, end: float) -> Run:
    """Return what of a run lies between two parts of its duration."""
    since = (run.time_s - run.time_s[0]) / run.duration_s
    here = (since >= begin) & (since <= end)
    part = run.part(here)
    return replace(part, time_s=part.time_s - part.time_s[0])


def halves(number: int) -> dict[str, Any]:
    """Fit the first half of one of the boards in data/; return how well its second half is predicted."""
    name, file, mapping, _ = LOGS[number]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{name}.csv"
        path.write_text(importing.import_table(data() / file, mapping))
        run = read_log(path, boards.HEATERS)
    first, second = part_of(run, 0.0, 0.5), part_of(run, 0.5, 1.0)

    def error(model: Model) -> float:
        return off(second, predict(model, second))

    found = diagnosis.diagnose(Array(1, boards.HEATERS), [first], model=textbook())
    return {
        "part": "halves",
        "name": name,
        "names": [one["name"] for one in found.result["effects"]],
        "error": error(found.model),
        "baseline": baseline([first], textbook(), error),
    }


def half_a_day(seed: int) -> dict[str, Any]:
    """Diagnose nine springs with a box and a lag, twelve hours at 1 Hz; return what it took, the making of the log aside."""
    rng = np.random.default_rng([seed, 5])
    world = World(effects={"shared_air": {"capacity": 5.0, "exchange": 0.1}, "sensor_lag": {"tau_s": 5.0}})
    inputs = random_inputs(rng, int(12 * boards.HOUR_S), fan=True)
    out = simulate(world, [inputs])
    columns = {f"i{k + 1}_a": out["current"][0][:, k] for k in range(SPRINGS)}
    columns |= {f"v{k + 1}_v": out["voltage"][0][:, k] for k in range(SPRINGS)}
    shown = out["shown"][0] + rng.normal(0.0, NOISE_C, out["shown"][0].shape)
    columns |= {f"t{k + 1}_c": shown[:, k] for k in range(SPRINGS)}
    columns |= {"fan": inputs.fan, "ambient_c": inputs.ambient}
    del out
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.csv"
        path.write_text(log_text(inputs.time_s, columns))
        begun = time.process_time()
        found = diagnosis.diagnose(Array(), [read_log(path, SPRINGS)])
    return {
        "part": "half_a_day",
        "names": [one["name"] for one in found.result["effects"]],
        "cpu_s": time.process_time() - begun,
        "peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0,
    }


def figures(done: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the figures of what was done."""
    out = []
    of = {part: [one for one in done if one["part"] == part] for part in PARTS}
    if sets := of["unseen"]:
        out.append(percent("two-hour logs: the lag named", [one["lag"] for one in sets], ">= 90"))
        out.append(percent("two-hour logs: the box named", [one["box"] for one in sets], ">= 90"))
        worse = np.array([one["error"] / one["true_model"] for one in sets])
        out.append(percent("two-hour logs: unseen run within 1.15 of the true model's error", list(worse <= 1.15), ""))
        out.append(
            row("two-hour logs: unseen run, of the true model's error, median", float(np.median(worse)), "x", "<= 1.15")
        )
        out.append(row("two-hour logs: unseen run, error, median", float(np.median([o["error"] for o in sets])), "K"))
        out.append(
            row("two-hour logs: a diagnosis, longest", max(one["cpu_s"] for one in sets), "s of one core", "<= 20")
        )
    if sets := of["finned"]:
        better = np.array([one["error"] / one["baseline"] for one in sets])
        out.append(
            percent("finned boards in a box: unseen runs no worse than the better baseline", list(better <= 1.05), "")
        )
        out.append(
            row(
                "finned boards in a box: unseen runs, of the better baseline's error, median",
                float(np.median(better)),
                "x",
            )
        )
        for who, key in (("", "error"), ("; the true model's", "true_model"), ("; the better baseline's", "baseline")):
            said = f"finned boards in a box: unseen runs, error, median{who}"
            out.append(row(said, float(np.median([one[key] for one in sets])), "K"))
    if sets := of["wander"]:
        out.append(
            percent("heat that wanders and nothing else: nothing named", [not one["names"] for one in sets], ">= 97")
        )
    for one in of["halves"]:
        named = " + ".join(one["names"]) or "nothing"
        out.append(
            row(f"{one['name']}: second half by its first ({named})", one["error"], "K", f"<= {one['baseline']:.3f}")
        )
    for one in of["half_a_day"]:
        named = " + ".join(one["names"]) or "nothing"
        out.append(row(f"nine springs, 12 h at 1 Hz ({named}): a diagnosis", one["cpu_s"], "s of one core", "<= 90"))
        out.append(row("the same: memory at most, the making of the log with it", one["peak_mb"], "MB", "<= 1000"))
    return out


def main() -> int:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=30, help="of unseen and finned; of wander twice as many")
    parser.add_argument("--first", type=int, default=320000)
    parser.add_argument("--parts", default=",".join(PARTS))
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 2)
    parser.add_argument("--json", type=Path)
    parser.add_argument(
        "--resume", type=Path, help="keep each case here; what it has of this very code is not done again"
    )
    options = parser.parse_args()
    seeds = {
        "unseen": options.cases,
        "finned": options.cases,
        "wander": 2 * options.cases,
        "halves": len(LOGS),
        "half_a_day": 1,
    }
    parts: dict[str, Callable[[int], dict[str, Any]]] = {
        f.__name__: f for f in (unseen, finned, wander, halves, half_a_day)
    }
    wanted = {
        f"{name} {seed}": (parts[name], seed)
        for name in options.parts.split(",")
        for seed in (range(len(LOGS)) if name == "halves" else range(options.first, options.first + seeds[name]))
    }
    fitting.WORKERS = 1
    tell(figures(Kept(options.resume).all_of(wanted, options.processes)), options.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
