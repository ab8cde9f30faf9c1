"""Calibrate the thermal model of an array of NiTi springs, and say what the model lacks."""

__version__ = "0.1.0"
