"""Where the command `ninespring` begins: Ctrl-C is one line from its first moment, also while the package is loaded."""

import os
import sys


def main() -> None:
    """Load the command line and run it."""
    try:
        from ninespring.cli.main import main as run
    except KeyboardInterrupt:
        sys.exit("ninespring: stopped")
    run()


def simulator() -> None:
    """Become the simulator that came with the package, or that the tree has built."""
    from ninespring.errors import WorkError
    from ninespring.io.simulated import simulator as find

    try:
        program = find()
    except WorkError as error:
        sys.exit(f"ninespring-sim: {error}")
    os.execv(program, [str(program), *sys.argv[1:]])
