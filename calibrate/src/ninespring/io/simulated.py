"""The simulated board: finds `ninespring-sim`, starts it, and says at which port it is."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

from ..errors import WorkError

NITI = "plant.effects=latent_heat,resistance_phase"
"""What every NiTi spring does."""


def simulator() -> Path:
    """Return the program: NINESPRING_SIM, this source tree's build, what came with the package, or the PATH."""
    named = os.environ.get("NINESPRING_SIM")
    here = Path(__file__).resolve()
    tree = here.parents[4] / "build" / "host" / "ninespring-sim"
    packed = here.parents[1] / "simulator" / "bin" / "ninespring-sim"
    for one in (named, tree, packed, shutil.which("ninespring-sim")):
        if one and os.access(one, os.X_OK) and not _is_this_package(Path(one)):
            return Path(one)
    if os.name == "nt":
        raise WorkError("the simulated board needs a pseudo-terminal, which Windows has not: use WSL, or a board")
    raise WorkError(
        "ninespring-sim is not there: this wheel came without it (the release's Linux wheel has it), script/build builds it, or "
        "set NINESPRING_SIM to it"
    )


def _is_this_package(path: Path) -> bool:
    """Return whether a program on the PATH is only the way back to here: the script that pip makes."""
    try:
        with path.open("rb") as file:
            return file.read(2) == b"#!"
    except OSError:
        return True


def simulated_board(more: Sequence[str] = ()) -> tuple[subprocess.Popen[str], str, str]:
    """Start a simulated board; return its process, to be terminated, its port, and that of its thermometers.

    In a session of its own: Ctrl-C in the terminal ends this program first, which switches the springs off.
    """
    words = [str(simulator()), "board", "--thermometers", "pty", "--set", NITI]
    if elf := os.environ.get("NINESPRING_AVR_DIR"):
        words += ["--elf", str(Path(elf) / "firmware.elf")]
    words += more
    process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True)
    assert process.stdout is not None and process.stderr is not None
    port = process.stdout.readline().strip()
    if not port.startswith("/dev/"):
        said = process.stderr.read().strip().splitlines()
        process.wait(10)
        raise WorkError(
            f"the simulated board does not start: {said[-1] if said else 'it says nothing'} (script/build builds it and its firmware)"
        )
    return process, port, process.stdout.readline().strip()
