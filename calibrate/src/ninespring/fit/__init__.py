"""Fits of the plant to logs."""
