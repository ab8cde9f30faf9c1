"""A model into the chip: which settings the data determined, and whether they drive as well as before."""
