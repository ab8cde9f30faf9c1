"""From a geometry to a working array: couplings by a field solution, sweeps over designs (docs/exploring.md)."""
