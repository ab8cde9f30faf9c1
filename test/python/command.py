"""`ninespring WORDS` in this process: with its exit code and both its outputs, without a second for a Python of its own."""

from __future__ import annotations

import signal
import subprocess
import sys
import warnings
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from unittest.mock import patch

from ninespring.cli import main as cli


def ended(*words: object) -> tuple[int, str]:
    """Return a command's exit code, and what it says to whoever looks: its error, or else what it found."""
    done = ninespring(*words)
    return done.returncode, (done.stderr.removeprefix("ninespring: ") or done.stdout).rstrip("\n")


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
