"""What a long benchmark has done already, kept beside the build so that it can be stopped and run on: as long as the code is
the same."""

from __future__ import annotations

import concurrent.futures
import hashlib
import json
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
MEASURED = ("calibrate/src", "bench/diagnose", "lib", "sim_host/plant")


def stamp() -> str:
    """Return a digest of all code that the figures depend on."""
    digest = hashlib.sha256()
    for folder in MEASURED:
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix in (".py", ".c", ".h", ".cpp", ".def"):
                digest.update(path.read_bytes())
    return digest.hexdigest()


class Kept:
    """Cases that are done, by key; without a path nothing is kept."""

    def __init__(self, path: Path | None) -> None:
        self.path, self.stamp = path, stamp()
        self.cases: dict[str, dict[str, Any]] = {}
        if path and path.exists():
            found = json.loads(path.read_text(encoding="utf-8"))
            if found["stamp"] == self.stamp:
                self.cases = found["cases"]

    def add(self, key: str, case: dict[str, Any]) -> None:
        """Keep one more."""
        self.cases[key] = case
        if self.path:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            text = json.dumps({"stamp": self.stamp, "cases": self.cases}, indent=1)
            self.path.write_text(text + "\n", encoding="utf-8")

    def all_of(
        self, wanted: Mapping[str, tuple[Callable[[Any], dict[str, Any]], Any]], processes: int, unsaid: str = ""
    ) -> list[dict[str, Any]]:
        """Do what is not done of (call, argument) by key, each told as it ends but for its entry `unsaid`; return all cases."""
        with concurrent.futures.ProcessPoolExecutor(processes) as pool:
            todo = {pool.submit(call, of): key for key, (call, of) in wanted.items() if key not in self.cases}
            for future in concurrent.futures.as_completed(todo):
                one = future.result()
                self.add(todo[future], one)
                print(json.dumps({k: v for k, v in one.items() if k != unsaid}), file=sys.stderr, flush=True)
        return [self.cases[key] for key in wanted]
