"""How much there is to read: the Python package without the exploration, its long functions, belief and drive, the tests.

.venv/bin/python bench/size.py [--json FILE]
"""

from __future__ import annotations

import argparse
import ast
import json
import re
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "calibrate" / "src" / "ninespring"
NUMBER = re.compile(r"^#define +\w+ +\(?-?[0-9.]", re.MULTILINE)
"""A constant of C with a number of its own; one that is made of others is none."""
LONG, TOO_LONG = 60, 90
"""Lines of a function."""


def read(folders: tuple[str, ...], endings: set[str]) -> list[str]:
    """Return the texts of folders of the repository."""
    paths = [path for folder in folders for path in sorted((ROOT / folder).rglob("*")) if path.suffix in endings]
    return [path.read_text(encoding="utf-8") for path in paths]


def lines(texts: list[str]) -> int:
    """Return how many there are."""
    return sum(text.count("\n") for text in texts)


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
    belief = read(("lib/spring_estimator", "lib/drive_policy"), {".c", ".h"})
    tests = read(("test",), {".c", ".h", ".cpp", ".hpp", ".py", ".ts", ".js"})
    rows = (
        ("lines of Python, `explore` aside", lines(texts), "<= 11500"),
        ("functions", len(functions), ""),
        (f"functions above {LONG} lines", sum(one > LONG for one in functions), ""),
        (f"functions above {TOO_LONG} lines", sum(one > TOO_LONG for one in functions), "0"),
        ("files", len(files), ""),
        ("lines of lib/spring_estimator and lib/drive_policy", lines(belief), "<= 2000"),
        ("numbers in them", sum(len(NUMBER.findall(text)) for text in belief), "<= 50"),
        ("words of docs/believing.md", len((ROOT / "docs" / "believing.md").read_text("utf-8").split()), "<= 3078"),
        ("lines of test/", lines(tests), "<= 21000"),
    )
    return [{"figure": f, "value": v, "unit": "1", "target": t, "command": "python bench/size.py"} for f, v, t in rows]


def main() -> int:
    """Print the figures, and write them where a path is given."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    rows = figures()
    for one in rows:
        print(f"{one['figure']:52} {one['value']:8} {one['target']}")
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
