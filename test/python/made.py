"""What several tests begin with: programs that may not be built, a search of a log, results as a diagnosis would say them."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ninespring.find import diagnosis, search
from ninespring.infer.declared import base_spec
from ninespring.infer.problem import Problem
from ninespring.infer.scene import scene_of
from ninespring.io import results
from ninespring.io.logs.run import Run
from ninespring.model import effects
from ninespring.model.models import Array

ROOT = Path(__file__).resolve().parents[2]
SIM = Path(os.environ.get("NINESPRING_SIM", ROOT / "build" / "host" / "ninespring-sim"))
ELF = Path(os.environ.get("NINESPRING_AVR_DIR", ROOT / "build" / "avr")) / "firmware.elf"
needs_simulator = pytest.mark.skipif(not SIM.exists(), reason=f"SKIPPED: {SIM} is not there: script/build makes it")
needs_board = pytest.mark.skipif(
    not (SIM.exists() and ELF.exists()), reason=f"SKIPPED: {SIM} or {ELF} is not there: script/build makes them"
)


@contextmanager
def simulated_board(*more: str) -> Iterator[tuple[str, ...]]:
    """Yield the port of a simulated board, and that of its thermometers where it has some; it is ended as Ctrl-C would."""
    words = [SIM, "board", "--elf", ELF, *more]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        ports = tuple(process.stdout.readline().strip() for _ in range(1 + ("--thermometers" in more)))
        assert all(port.startswith("/dev/") for port in ports), "no pty"
        yield ports
        process.send_signal(signal.SIGINT)


def searched(run: Run) -> search.Search:
    """Return a search on a log of the paper's array, the declared model fitted."""
    problem = Problem(Array(), [run])
    base = diagnosis.first_fit(problem, base_spec(problem))
    return search.Search(problem, effects.candidates(scene_of(problem)), base)


def keep_rows(columns: dict[str, np.ndarray], rows: np.ndarray) -> None:
    """Leave only some rows in a log that is made."""
    columns["time_s"] = np.arange(float(len(columns["fan"])))
    for name in list(columns):
        columns[name] = columns[name][rows]


def an_effect(name: str, **fields: Any) -> results.Effect:
    """Return an effect with these fields; what is not given is of no interest."""
    plain: dict[str, Any] = {
        "rmse_c": 0.3,
        "holdout_rmse_c": 0.3,
        "evidence": 100.0,
        "parameters": {},
        "on_chip": True,
        "in_words": "",
    }
    return results.Effect(name=name, **(plain | fields))
