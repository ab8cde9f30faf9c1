"""The live page of an array, served on this machine: on a board, a simulated board, or a log."""
