"""How two heaters on an Arduino are driven in tests: 600 s at 1 Hz."""

from __future__ import annotations

import numpy as np


def levels(rng: np.random.Generator) -> np.ndarray:
    """Return commands (600, 2), 0 to 1: a new one each 70 s, the second heater's 35 s after the first's."""
    out = np.zeros((600, 2))
    for k in range(2):
        for at in range(10 + 35 * k, 600, 70):
            out[at : at + 70, k] = rng.choice([0.0, 0.3, 0.6, 1.0])
    return out
