"""`python -m ninespring`."""

from .cli import main

main()
