"""Logs of the field solution: what the diagnosis names in an array whose air and plates are not lumps.

.venv/bin/python bench/diagnose/field.py [--json FILE] [--markdown FILE]

The truth is conduction in springs, air and plates in three dimensions with a stream that carries heat on (`ninespring couplings`,
coarse mesh), driven by random powers; the thermometers have 0.3 degC of noise. Each array is logged twice for 15 min for the
diagnosis, once with the fan and once without (or twice without, where there is none), and a third time for the judgement.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from ninespring.explore.couplings import fields_of, random_drive
from ninespring.explore.field import MESHES
from ninespring.explore.geometry import geometry_of
from ninespring.find import diagnosis
from ninespring.io.logs import read_log
from ninespring.model import native
from ninespring.model.models import Array
from ninespring.model.simulate import simulate_run

COMMAND = "bench/diagnose/field.py"
NOISE_C, AMBIENT_C, OHM = 0.3, 20.0, 0.219
BLOWN: dict[str, Any] = {"fan_m_per_s": 0.63}
STILL: dict[str, Any] = {"fan_m_per_s": 0.0}
CASES: dict[str, tuple[dict[str, Any], set[str]]] = {
    "Perspex, still": (STILL | {"plate": "perspex"}, {"plate_conduction", "edge_loss"}),
    "Perspex, fan": (BLOWN | {"plate": "perspex"}, {"plate_conduction", "edge_loss", "fan_wake"}),
    "aluminium, still": (STILL | {"plate": "aluminium"}, {"plate_conduction", "edge_loss"}),
    "aluminium, fan": (BLOWN | {"plate": "aluminium"}, {"plate_conduction", "edge_loss", "fan_wake"}),
    "no plate, fan": (BLOWN | {"plate": "none"}, {"edge_loss", "fan_wake"}),
}
"""Cooling, and the effects of the library that stand for something in it. Its shared air does, too, in all of them."""
HEADER = [
    "array",
    "named (certainty)",
    "rivals",
    "unexplained",
    "before, degC",
    "after",
    "third log",
    "structure / noise",
]


def log_of(path: Path, modes: Any, fan: float, seed: int) -> None:
    """Write a log of the field under a random drive."""
    springs = modes.spring.shape[1]
    time_s, power = random_drive(springs, seed)
    shown = AMBIENT_C + modes.simulate(time_s, power)
    shown += np.random.default_rng([seed, 77]).normal(0.0, NOISE_C, shown.shape)
    current = np.sqrt(power / OHM)
    columns = [
        time_s,
        *current.T,
        *(OHM * current).T,
        *shown.T,
        np.full(len(time_s), fan),
        np.full(len(time_s), AMBIENT_C),
    ]
    names = ["time_s"] + [
        f"{letter}{k + 1}_{unit}" for letter, unit in (("i", "a"), ("v", "v"), ("t", "c")) for k in range(springs)
    ]
    header = ",".join([*names, "fan", "ambient_c"])
    np.savetxt(path, np.column_stack(columns), delimiter=",", fmt="%.5g", header=header, comments="")


def diagnose(name: str) -> dict[str, Any]:
    """Make an array's field and logs, diagnose them."""
    given, there = CASES[name]
    array = Array(3, 3, 5.0, cooling=given)
    still, blown = fields_of(geometry_of(array), MESHES["coarse"])
    runs = [(still, 0.0), (still, 0.0), (still, 0.0)] if blown is None else [(still, 0.0), (blown, 1.0), (blown, 1.0)]
    with tempfile.TemporaryDirectory() as folder:
        logs = []
        for k, (modes, fan) in enumerate(runs):
            path = Path(folder) / f"run{k + 1}.csv"
            log_of(path, modes, fan, 100 + k)
            logs.append(read_log(path, array.springs))
    begun = time.monotonic()
    found = diagnosis.diagnose(Array(3, 3, 5.0), logs[:2])
    seconds = time.monotonic() - begun
    plant = native.Plant(3, 3)
    plant.set_effects(found.model.effects)
    plant.set_all(found.model.parameters)
    third = logs[2]
    off = third.temperature_c - simulate_run(plant, third, third.ambient_c)
    result = found.result
    return {
        "name": name,
        "there": there | {"shared_air"},
        "effects": [(one["name"], one["probability"]) for one in result["effects"]],
        "rivals": sorted({one["name"] for one in result["rivals"]}),
        "unexplained": bool(result["unexplained"]),
        "before_c": result["baseline"]["holdout_rmse_c"],
        "after_c": result["after"]["holdout_rmse_c"],
        "third_c": float(np.sqrt(np.nanmean(off**2))),
        "structure": result["residual"]["structure_c"] / result["baseline"]["noise_c"],
        "seconds": seconds,
    }


def row_of(one: dict[str, Any]) -> list[str]:
    """Return a row of the table."""
    named = ", ".join(f"{name} ({p:.2f})" for name, p in one["effects"]) or "nothing"
    numbers = [f"{one[key]:.2f}" for key in ("before_c", "after_c", "third_c", "structure")]
    return [one["name"], named, ", ".join(one["rivals"]), "yes" if one["unexplained"] else "no", *numbers]


def figures_of(found: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the figures."""
    named = [(name in one["there"]) for one in found for name, _ in one["effects"]]
    rows = [
        (f"effects named that the field has, of {len(named)}", sum(named), "", None),
        ("named wrongly", len(named) - sum(named), "", None),
        (
            f"arrays said to be not wholly explained, of {len(found)}",
            sum(one["unexplained"] for one in found),
            "",
            None,
        ),
        ("error in a third log, worst, noise is 0.3", round(max(one["third_c"] for one in found), 3), "degC", None),
        ("structure that remains, worst, over the noise", round(max(one["structure"] for one in found), 2), "1", None),
    ]
    return [
        {"figure": name, "value": value, "unit": unit, "target": target, "command": COMMAND}
        for name, value, unit, target in rows
    ]


def main() -> None:
    """Measure, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    found = []
    lines = ["| " + " | ".join(HEADER) + " |", "|" + "---|" * len(HEADER)]
    print(lines[0], lines[1], sep="\n")
    for name in CASES:
        found.append(diagnose(name))
        lines.append("| " + " | ".join(row_of(found[-1])) + " |")
        print(lines[-1], f"{found[-1]['seconds']:.0f} s", flush=True)
    figures = figures_of(found)
    lines += [
        "",
        "| figure | measured |",
        "|---|---|",
        *(f"| {one['figure']} | {one['value']} {one['unit']} |" for one in figures),
    ]
    print("\n".join(lines[-len(figures) :]))
    if options.json:
        options.json.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    if options.markdown:
        options.markdown.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
