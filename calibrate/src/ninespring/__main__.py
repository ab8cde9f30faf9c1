"""`python -m ninespring`."""

from .cli.main import main

main()
