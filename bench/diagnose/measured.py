"""The measured data: the paper's six camera values and three Temperature Control Lab logs.

.venv/bin/python bench/diagnose/measured.py [--markdown [FILE]] [--json FILE]
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import paper
import tclab


def main() -> None:
    """Print both sections."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--markdown", nargs="?", const="-", help="write a Markdown fragment here")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    parts = [paper.section(), tclab.section()]
    text = "\n".join(part for part, _ in parts)
    print(text)
    if options.markdown not in (None, "-"):
        Path(options.markdown).write_text(text)
    if options.json:
        options.json.write_text(json.dumps([one for _, figures in parts for one in figures], indent=1) + "\n")


if __name__ == "__main__":
    main()
