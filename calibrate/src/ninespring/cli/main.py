"""The command line: what commands there are, and how they end. Each command is a file beside this."""

from __future__ import annotations

import importlib
import os
import signal
import sys
import warnings
from typing import NoReturn

import click

from .. import __version__
from ..errors import InputError, WorkError
from .console import err

COMMANDS = {
    "fit": "fit",
    "diagnose": "diagnose",
    "predict": "predict",
    "replay": "predict",
    "export": "export",
    "verify": "export",
    "import": "import_log",
    "plan": "plan",
    "plot": "plot",
    "couplings": "couplings",
    "sweep": "sweep",
    "scenario": "scenario",
    "schema": "schema",
    "dashboard": "dashboard",
    "calibrate": "calibrate",
    "bringup": "bringup",
    "settings": "settings",
    "console": "terminal",
    "record": "board",
    "upload": "board",
    "monitor": "board",
}
"""Each command's file. A file is loaded when its command is asked for: a console at a board waits for no SciPy."""


class Group(click.Group):
    """The commands."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return their names."""
        return sorted(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return one of them, loaded; None where there is none of this name."""
        if cmd_name not in COMMANDS:
            return None
        module = importlib.import_module(f".{COMMANDS[cmd_name]}", __package__)
        return next(one for one in vars(module).values() if isinstance(one, click.Command) and one.name == cmd_name)


@click.group(
    cls=Group,
    context_settings={"help_option_names": ["-h", "--help"], "show_default": True},
    epilog="Logs, models and their units: docs/files.md. From bench to calibrated chip in one page: docs/calibrating.md. "
    "Exit code 0: done; 1: the work failed; 2: the input or the arguments are wrong, and one line says what and where.",
)
@click.version_option(__version__)
def cli() -> None:
    """Calibrate the thermal model of an array of NiTi springs, and say what the model lacks."""


def _end(message: str, code: int) -> NoReturn:
    err.print(f"ninespring: {message}", style="red", soft_wrap=True)
    sys.exit(code)


def main() -> None:
    """Run the command line: exit code 0 done, 1 the work failed, 2 the input or arguments are wrong."""
    # What a numerical library warns about (an empty column has no mean) says nothing to a user.
    warnings.simplefilter("ignore", RuntimeWarning)
    # Ended from outside: temporary files go, as with Ctrl-C.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        code = cli(standalone_mode=False)
        sys.exit(code if isinstance(code, int) else 0)
    except InputError as error:
        _end(str(error), 2)
    except click.exceptions.NoArgsIsHelpError as error:
        error.show()
        sys.exit(2)
    except click.UsageError as error:
        where = error.ctx.command_path if error.ctx else "ninespring"
        _end(f"{error.format_message()} ({where} --help says more)", 2)
    except click.ClickException as error:
        _end(error.format_message(), 2)
    except (click.Abort, KeyboardInterrupt):
        _end("stopped", 1)
    except (WorkError, RuntimeError, MemoryError, OSError) as error:
        _end(str(error) or type(error).__name__, 1)
    except Exception as error:
        if os.environ.get("NINESPRING_TRACEBACK"):
            raise
        said = (str(error).splitlines() or [""])[0]
        _end(f"a defect of the tool: {type(error).__name__}: {said} (NINESPRING_TRACEBACK=1 shows where)", 1)


if __name__ == "__main__":
    main()
