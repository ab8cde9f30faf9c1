"""report.html of a calibration: what was found step by step, how the board drove before and after, what it was sent."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from ...io import results
from ...io.logs import read_log
from ...model.models import Array
from ...say.figures import AFTER, BEFORE, INK, MEASURED, as_svg, panels
from ...say.page import error_rows, render
from ...say.plotting import believed
from .chain import DIAGNOSIS, OLD_SETTINGS, SETTINGS
from .progress import Progress

COLOURS = [BEFORE, AFTER, "#8a6d3b"]
NAMES = ("as the board was", "with the new settings")
MEASURES = (
    ("the chip's error, K rms", "error_c", "{:.2f}"),
    ("its worst spring's, K rms", "worst_c", "{:.1f}"),
    ("springs that are on hold, % austenite", "held", "{:.0%}"),
    ("springs that are off reach, % austenite", "undriven", "{:.0%}"),
    ("hottest, degC", "hottest_c", "{:.0f}"),
    ("from the first current until all have transformed, s", "heating_s", "{:.0f}"),
)
"""What is told of a drive: in words, its name in the progress, its form."""


def page(progress: Progress, array: Array) -> str:
    """Return the report of what is done so far, as HTML."""
    done = progress.done
    drives = [done["before"], *done.get("after", {}).get("drives", [])] if "before" in done else []
    shown = [drives[0], drives[-1]] if len(drives) > 1 else drives
    verified = done.get("verify", {})
    errors = [results.read(results.ChipError, verified[when]) for when in ("before", "after") if when in verified]
    found, had = done.get("export", {}).get("settings", {}), progress.data["board"]["settings"]
    return render(
        "calibration.html",
        title="Ninespring calibration",
        calibration=progress.data,
        done=done,
        drives=drives,
        header=["", *NAMES[: len(shown)]],
        rows=[[label, *(form.format(one[key]).rstrip("%") for one in shown)] for label, key, form in MEASURES],
        figure=_picture(progress, array, shown) if shown else None,
        faults=[fault for one in drives for fault in one["faults"]],
        diagnosis=DIAGNOSIS,
        verified=error_rows(*errors) if errors else None,
        sent=[(f"${k}", had.get(k, "–"), new) for k, new in found.items() if float(had.get(k, "nan")) != float(new)],
        new=SETTINGS,
        old=OLD_SETTINGS,
        folder=progress.folder,
    )


def _picture(progress: Progress, array: Array, shown: Sequence[dict[str, Any]]) -> Markup:
    """Draw the worst and the best known spring and one that is off, measured and believed, a panel a drive."""
    runs = [read_log(progress.folder / one["log"], array.springs) for one in shown]
    thought = [believed(run) for run in runs]
    error = np.sqrt(np.nanmean((thought[0] - runs[0].temperature_c) ** 2, axis=0))
    on = [k for k, one in enumerate(progress.option("pattern")) if one == "1"]
    off = [k for k in range(array.springs) if k not in on]
    picked = list(dict.fromkeys([max(on, key=lambda k: error[k]), min(on, key=lambda k: error[k]), *off[:1]]))
    figure, axes = panels(1, len(runs), (4.8, 2.9), (0.65, 0.1, 0.5, 0.3), (0.2, 0.0), sharey=True)
    for axis, run, belief, name in zip(axes[0], runs, thought, NAMES, strict=False):
        since = run.time_s - run.time_s[0]
        for k, colour in zip(picked, COLOURS, strict=False):
            axis.plot(since, run.temperature_c[:, k], color=MEASURED, lw=3.0)
            axis.plot(since, belief[:, k], color=colour, lw=1.2, label=f"spring {k + 1}{'' if k in on else ', off'}")
        axis.set_title(name, fontsize=10, loc="left", color=INK)
        axis.set_xlabel("time, s", fontsize=9)
        axis.grid(alpha=0.25)
        axis.tick_params(labelsize=8)
    axes[0][0].set_ylabel("temperature, °C", fontsize=9)
    axes[0][0].legend(fontsize=8, frameon=False, loc="lower right")
    return as_svg(figure)
