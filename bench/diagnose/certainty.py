"""Fit the weights by which an effect's certainty follows from what speaks for it, and check them.

    .venv/bin/python bench/diagnose/run.py --development --collect --cases dev.json ...
    .venv/bin/python bench/diagnose/certainty.py dev.json [more.json ...]

Cases must come from developing seeds. Ridge-penalised logistic regression; the penalty keeps a feature that tells nothing
at zero. Prints the weights for `search/certainty.py`, and how often effects of each probability were there.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
from ninespring.find.certainty import WEIGHTS, Witness
from scipy.optimize import minimize

RIDGE = 0.05


def rows(paths: list[Path]) -> tuple[np.ndarray, np.ndarray]:
    """Return features (effects, features) and whether each effect was there."""
    features, true = [], []
    for path in paths:
        for case in json.loads(path.read_text())["cases"].values():
            for one in case["witnesses"]:
                features.append(list(Witness(**one["witness"]).features().values()))
                true.append(one["true"])
    return np.array(features), np.array(true, dtype=float)


def fit(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the weights."""

    def cost(w: np.ndarray) -> float:
        z = x @ w
        return float(np.logaddexp(0.0, z).sum() - y @ z + RIDGE * (w[1:] @ w[1:]))

    return np.asarray(minimize(cost, np.zeros(x.shape[1])).x)


def curve(p: np.ndarray, y: np.ndarray) -> list[tuple[float, float, int, float]]:
    """Return (from, to, effects, share that was there) for each fifth of the probabilities."""
    out = []
    for low in (0.0, 0.2, 0.4, 0.6, 0.8):
        here = (p >= low) & (p < low + 0.2 + 1e-9 * (low == 0.8))
        if here.any():
            out.append((low, low + 0.2, int(here.sum()), float(y[here].mean())))
    return out


def main() -> int:
    """Fit, print."""
    x, y = rows([Path(one) for one in sys.argv[1:]])
    weights = fit(x, y)
    print(f"{len(y)} effects, {y.mean():.0%} of them there")
    for name, weight in zip(WEIGHTS, weights, strict=True):
        print(f'    "{name}": {weight:.2f},')
    held = np.empty(len(y))
    for fold in range(5):
        out = np.arange(len(y)) % 5 == fold
        held[out] = 1.0 / (1.0 + np.exp(-x[out] @ fit(x[~out], y[~out])))
    for low, high, count, share in curve(held, y):
        print(f"called {low:.1f} to {high:.1f}: {count:3d}, there {share:.0%} (held out)")
    return 0


if __name__ == "__main__":
    sys.exit(main())
