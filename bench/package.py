"""How much of the Python package there is to read: lines without the exploration, and functions that are long.

.venv/bin/python bench/package.py [--json FILE]
"""

from __future__ import annotations

import argparse
import ast
import json
import sys
from pathlib import Path
from typing import Any

PACKAGE = Path(__file__).resolve().parent.parent / "calibrate" / "src" / "ninespring"
LONG, TOO_LONG = 60, 90
"""Lines of a function."""


def figures() -> list[dict[str, Any]]:
    """Return the figures."""
    files = [path for path in PACKAGE.rglob("*.py") if "explore" not in path.parts]
    texts = [path.read_text(encoding="utf-8") for path in files]
    functions = [
        (node.end_lineno or node.lineno) - node.lineno + 1
        for text in texts
        for node in ast.walk(ast.parse(text))
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef))
    ]
    rows = (
        ("lines of Python, `explore` aside", sum(text.count("\n") for text in texts), "<= 11500"),
        ("functions", len(functions), ""),
        (f"functions above {LONG} lines", sum(one > LONG for one in functions), ""),
        (f"functions above {TOO_LONG} lines", sum(one > TOO_LONG for one in functions), "0"),
        ("files", len(files), ""),
    )
    return [
        {"figure": f, "value": v, "unit": "1", "target": t, "command": "python bench/package.py"} for f, v, t in rows
    ]


def main() -> int:
    """Print the figures, and write them where a path is given."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    rows = figures()
    for one in rows:
        print(f"{one['figure']:45} {one['value']:8} {one['target']}")
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
