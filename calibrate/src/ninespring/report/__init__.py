"""The report of a diagnosis, one HTML file."""
