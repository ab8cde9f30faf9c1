"""How warm a taxel's other spring gets: an array with a stiffness layer, from its geometry alone, a board for each layer.

.venv/bin/python bench/explore/stiffness.py [--json FILE]

The array is docs/exploring/stiffness.toml; runs are like a sweep's points, but half an hour on: nothing gets warmer. Policy
precompensate. Patterns are elongation/stiffness.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from ninespring.explore.couplings import couplings
from ninespring.explore.point import metrics_of
from ninespring.explore.spec import Spec
from ninespring.model.models import read_array

ROOT = Path(__file__).resolve().parents[2]
AUSTENITE_START_C = 88
PATTERNS = {
    "all/none": "none driven below, all above: the hottest below",
    "none/all": "none driven above, all below: the hottest above",
    "all_but_middle/none": "the paper's pattern above, none below: the hottest undriven",
    "all_but_middle/all": "all driven but the middle above: that one",
}


def main() -> None:
    """Solve, run, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    array = read_array(ROOT / "docs" / "exploring" / "stiffness.toml")
    found = couplings(array, "coarse")
    figures: list[dict[str, Any]] = []

    def say(figure: str, value: float, unit: str, target: str = "") -> None:
        print(f"{figure}: {value} {unit}", flush=True)
        figures.append({"figure": figure, "value": value, "unit": unit, "target": target})

    name = f"{array.rows} x {array.cols} x 2, {array.pitch_mm:g} mm"
    say(f"{name}: network against field, random drive of 15 min", round(100 * found.drive_error, 2), "%", "<= 3")
    for key in ("series_w_per_k", "series_fan_w_per_k", "orthogonal_w_per_k", "orthogonal_fan_w_per_k"):
        say(f"{name}: {key}", round(1e3 * found.model.parameters[key], 3), "mW/K")
    spec = Spec(duration_s=1810, on_s=1800, couplings="field")
    for pattern, what in PATTERNS.items():
        for fan in (0.0, 1.0):
            point = {"pitch_mm": array.pitch_mm, "layers": 2, "pattern": pattern, "fan": fan}
            run = metrics_of(spec, point, 1)
            air = "fan" if fan else "still"
            say(f"{name}, {air}, {what}", round(run["undriven_c"], 1), "degC", f"< {AUSTENITE_START_C}")
            say(f"{name}, {air}, {pattern}: driven springs that start", round(100 * run["started"], 1), "%")
    if options.json:
        command = "bench/explore/stiffness.py"
        options.json.write_text(json.dumps([one | {"command": command} for one in figures], indent=1) + "\n")


if __name__ == "__main__":
    main()
