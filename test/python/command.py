"""`ninespring WORDS` in this process: with its exit code and both its outputs, without a second for a Python of its own."""

from __future__ import annotations

import signal
import subprocess
import sys
import warnings
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from typing import Any
from unittest.mock import patch

from ninespring.cli import main as cli


def ended(*words: object) -> tuple[int, str]:
    """Return a command's exit code, and what it says to whoever looks: its error, or else what it found."""
    done = ninespring(*words)
    return done.returncode, (done.stderr.removeprefix("ninespring: ") or done.stdout).rstrip("\n")


def process(*words: object) -> list[str]:
    """Return the command as a process of its own, which can be told to end."""
    return [sys.executable, "-m", "ninespring", *map(str, words)]


def alone(*words: object, **more: Any) -> subprocess.CompletedProcess[str]:
    """Return how the command ends in a process of its own; `more`: its folder, what it is told."""
    return subprocess.run(process(*words), capture_output=True, text=True, timeout=900, check=False, **more)


def ninespring(*words: object) -> subprocess.CompletedProcess[str]:
    """Return how the command ends, as subprocess.run would."""
    out, errors, code = StringIO(), StringIO(), 0
    command = ["ninespring", *map(str, words)]
    before = signal.getsignal(signal.SIGTERM)
    with patch.object(sys, "argv", command), redirect_stdout(out), redirect_stderr(errors), warnings.catch_warnings():
        try:
            cli.main()
        except SystemExit as end:
            code = end.code
        finally:
            signal.signal(signal.SIGTERM, before)
    return subprocess.CompletedProcess(command, code, out.getvalue(), errors.getvalue())
