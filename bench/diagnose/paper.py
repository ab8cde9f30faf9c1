"""The paper's six camera values against the model that its six COMSOL values declare.

.venv/bin/python bench/diagnose/measured.py     prints this section and the Temperature Control Lab's
"""

from __future__ import annotations

import math
import os
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from ninespring.find import steady
from ninespring.io import results
from ninespring.io.logs import read_table
from ninespring.model.models import Array
from ninespring.say import page

COMMAND = "python bench/diagnose/measured.py"
ROOT = Path(__file__).resolve().parents[2]


def data() -> Path:
    """Return the folder of measured data, or end saying so."""
    folder = Path(os.environ.get("NINESPRING_DATA", ROOT / "data"))
    if not folder.is_dir():
        sys.exit(f"{folder} is not there: set NINESPRING_DATA to the folder of measured data")
    return folder


def paper_states(path: Path, source: str) -> list[steady.State]:
    """Return the paper's six cases of one source (comsol or camera) as steady states."""
    table = read_table(path, text_columns=("source",))
    out = []
    for _, row in table.frame.iterrows():
        if row["source"] != source:
            continue
        hold = np.full(9, float(row["t_hot_c"]))
        hold[4] = math.nan
        measured = np.full(9, math.nan)
        measured[4] = float(row["t_centre_c"])
        out.append(
            steady.State(
                f"{source} {row['pitch_mm']:g} mm{', fan' if row['fan'] else ''}",
                float(row["pitch_mm"]),
                float(row["fan"]),
                float(row["ambient_c"]),
                hold,
                np.full(9, math.nan),
                measured,
            )
        )
    return out


def section() -> tuple[str, list[dict[str, Any]]]:
    """Return the section as Markdown, and its figures."""
    table = data() / "paper" / "steady.csv"
    camera = paper_states(table, "camera")
    comsol = paper_states(table, "comsol")
    told = steady.diagnose_states(Array(), {}, camera)
    fitted = float((steady.errors(Array(), {}, {}, comsol) ** 2).mean() ** 0.5)
    # the same six model values against the camera's, hot springs at 105 as in COMSOL
    as_comsol = [replace(c, hold_c=k.hold_c) for c, k in zip(camera, comsol, strict=True)]
    at_105 = float((steady.errors(Array(), {}, {}, as_comsol) ** 2).mean() ** 0.5)
    before = told.baseline.rmse_c
    lines = [
        "### The paper: six camera values against the model of its six COMSOL values",
        "",
        (
            f"The model that COMSOL's values declare (it meets them to {fitted:.2f} K rms), frozen, misses the camera's six by "
            f"{at_105:.1f} K rms with the hot springs at COMSOL's 105 degC, and by {before:.1f} K at the 99 degC the camera saw. "
            "Every effect of the library with one number, hot springs at 99, best first:"
        ),
        "",
        "| " + " | ".join(page.HEADER) + " |",
        "|" + "---|" * len(page.HEADER),
    ]
    lines += ["| " + " | ".join(row) + " |" for row in page.candidate_rows(told)]
    lines += ["", "| case | camera | declared | with the best |", "|---|---|---|---|"]
    for case in told.cases:
        after = float("nan") if case.after_c is results.UNSET else case.after_c
        lines.append(f"| {case.case} | {case.measured_c:.0f} | {case.before_c:.1f} | {after:.1f} |")
    if told.rivals:
        lines += [
            "",
            "Six numbers cannot separate these; the experiment that would, computed with both fitted models:",
            "",
        ]
        for rival in told.rivals:
            lines.append(
                f"- {rival.instead_of} or {rival.name} (behind by {rival.evidence:.1f} nats): "
                f"{rival.separating_experiment}."
            )
    figures = [
        ("paper: COMSOL's model against the camera, hot springs at 105", at_105, "14.2"),
        ("paper: the same, hot springs at 99", before, ""),
        (f"paper: with {told.effects[0].name}, one number", told.after.rmse_c, ""),
        ("paper: the same, left one out", told.after.holdout_rmse_c, ""),
    ]
    return "\n".join(lines) + "\n", [
        {"figure": name, "value": round(value, 2), "unit": "K", "target": target, "command": COMMAND}
        for name, value, target in figures
    ]
