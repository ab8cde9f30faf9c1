"""`ninespring calibrate`: from a board as it is to one that knows its array, in one command that can be gone on with."""
