"""Where the command `ninespring` begins: Ctrl-C is one line from its first moment, also while the package is loaded."""

import sys


def main() -> None:
    """Load the command line and run it."""
    try:
        from ninespring.cli import main as run
    except KeyboardInterrupt:
        sys.exit("ninespring: stopped")
    run()
