"""The page of results: what misses its target is written as missed, what is broken is not written."""

from __future__ import annotations

import importlib.util
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

SPEC = importlib.util.spec_from_file_location("results", Path(__file__).parents[2] / "bench" / "results.py")
assert SPEC is not None and SPEC.loader is not None
results = importlib.util.module_from_spec(SPEC)
sys.modules["results"] = results  # its dataclasses look themselves up
SPEC.loader.exec_module(results)


@pytest.mark.parametrize(
    ("code", "writes", "kept"), [(0, True, True), (1, True, True), (1, False, False), (2, True, False)]
)
def test_a_benchmark_that_misses_is_kept_and_one_that_is_broken_is_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: int, writes: bool, kept: bool
) -> None:
    monkeypatch.setattr(results, "KEPT", tmp_path)
    does = f"import sys; {writes} and open(sys.argv[2], 'w').write('[]'); sys.exit({code})"
    section = results.Section("one", "One", shlex.join([sys.executable, "-c", does]))
    if kept:
        results.measure(section)
    else:
        with pytest.raises(subprocess.CalledProcessError):
            results.measure(section)
    assert (tmp_path / "one.json").exists() == kept
    assert list(results.when()) == (["one"] if kept else [])
