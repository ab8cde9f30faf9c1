"""The field solution against closed forms, on finer and finer meshes.

.venv/bin/python bench/explore/closed_forms.py [--json FILE]
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from ninespring.explore.closed_forms import PROBLEMS
from ninespring.explore.field import Mesh

CORNERS = (8, 12, 18, 24)


def main() -> None:
    """Solve, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    figures = []
    print(f"{'error, % at corners of a circle':>32}" + "".join(f"{one:9}" for one in CORNERS))
    for name, problem in PROBLEMS.items():
        errors = []
        for corners in CORNERS:
            found, exact = problem(Mesh(corners, 1, 1))
            errors.append(100 * (found / exact - 1))
        print(f"{name:>32}" + "".join(f"{one:9.3f}" for one in errors), flush=True)
        figures.append(
            {"figure": f"{name}, finest mesh", "value": round(abs(errors[-1]), 3), "unit": "%", "target": "<= 1"}
        )
    if options.json:
        command = "bench/explore/closed_forms.py"
        options.json.write_text(json.dumps([one | {"command": command} for one in figures], indent=1) + "\n")


if __name__ == "__main__":
    main()
