"""Temperature Control Lab logs: what the declared model misses, effect by effect, in sample and held out.

.venv/bin/python bench/diagnose/measured.py     prints this section and the paper's
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from ninespring.find import diagnosis
from ninespring.infer.problem import BLOCK_S
from ninespring.io import importing
from ninespring.io.logs import read_log
from ninespring.model.models import Array, Model
from paper import COMMAND, data

LOGS = (
    ("energy_balance_600", "tclab_apm/energy_balance_600.txt", "tclab", "1.26; with lag and ambient 0.63"),
    ("second_order_mimo_201", "tclab_apm/second_order_mimo_201.txt", "tclab", "1.23; with lag and ambient 0.58"),
    ("tclab_prbs", "tclab_mlid_prbs/tclab_prbs.csv", "tclab", ""),
)


def textbook() -> Model:
    """Return what the textbook declares: 4 g, 500 J/kgK, 12 cm2. Losses, powers, ambient are fitted."""
    model = Model(Array(1, 2))
    model.parameters = {
        "heat_capacity_j_per_k": 2.0,
        "surface_mm2": 1200.0,
        "loss_w_per_k": 0.012,
        "orthogonal_w_per_k": 0.003,
        "command_power_w": 1.0,
    }
    return model


def section() -> tuple[str, list[dict[str, Any]]]:
    """Return the section as Markdown, and its figures."""
    folder = data()
    lines: list[str] = []
    figures = []
    lines.append("### Temperature Control Lab: two heaters, command logged, ambient not\n")
    lines.append(
        "Declared: 4 g, 500 J/kgK, two nodes and a coupling; losses, powers and ambient fitted. Errors in K; held out"
    )
    lines.append(
        f"are blocks of {BLOCK_S:g} s, or of a fifth of a shorter run, every fifth in turn: the numbers are fitted to the rest,"
    )
    lines.append(
        "the whole run is simulated from its first reading, and the error counts in the block alone. Effects are listed as"
    )
    lines.append(
        "they add up. 'Chopped loads': the heaters are transistors that share one supply and are switched on and off, so"
    )
    lines.append(
        "what one draws takes power from the other, and its own command takes none from itself (docs/physics.md).\n"
    )
    lines.append(
        "| log | noise | model | error | held out | numbers | textbook, in sample |\n|---|---|---|---|---|---|---|"
    )
    remarks = []
    for name, file, mapping, scale in LOGS:
        with tempfile.TemporaryDirectory() as temporary:
            path = Path(temporary) / f"{name}.csv"
            path.write_text(importing.import_table(folder / file, mapping))
            run = read_log(path, 2)
        found = diagnosis.diagnose(Array(1, 2), [run], model=textbook()).result
        base = found["baseline"]
        lines.append(
            f"| {name} | {base['noise_c']:.3f} | declared | {base['rmse_c']:.3f} | {base['holdout_rmse_c']:.3f} | | {scale} |"
        )
        for effect in found["effects"]:
            numbers = list(effect["parameters"].items())
            text = ", ".join(
                f"{k} {v['value']:.3g}" + ("" if v["stderr"] is None else f" +- {v['stderr']:.1g}") + f" {v['unit']}"
                for k, v in numbers[:3]
            ) + (f" and {len(numbers) - 3} more" if len(numbers) > 3 else "")
            variant = f" ({effect['variant']})" if effect.get("variant") else ""
            lines.append(
                f"| | | + {effect['name']}{variant} | {effect['rmse_c']:.3f} | {effect['holdout_rmse_c']:.3f} | {text} | |"
            )
        for kind in ("rmse_c", "holdout_rmse_c"):
            figures.append(
                {
                    "figure": f"{name}, after, {'held out' if kind.startswith('hold') else 'in sample'}",
                    "value": round(found["after"][kind], 3),
                    "unit": "K",
                    "target": "",
                    "command": COMMAND,
                }
            )
        names = [e["name"] for e in found["effects"]]
        said = f"- **{name}**: missing are {', '.join(names) or 'none of the library'}."
        for rival in found["rivals"]:
            said += f" {rival['instead_of']} or {rival['name']}: not separable here; {rival['separating_experiment']}."
        if found["unexplained"]:
            said += (
                f" Structure of {found['residual']['structure_c']:.2f} K rms remains above the sensor's noise. "
                + found["residual"]["note"].split(". ", 1)[-1]
            )
        bounds = found["identifiability"]["at_bounds"]
        if bounds:
            said += f" At a bound: {', '.join(bounds)}."
        spikes = [w for w in found["warnings"] if "spike" in w]
        if spikes:
            said += f" Handled without being told: {spikes[0].split(': ', 1)[1]}."
        remarks.append(said)
    return "\n".join([*lines, "", *remarks]) + "\n", figures
