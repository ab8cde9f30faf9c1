"""A linear forecast around a fit: what each candidate, and each pair of them, would explain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..infer.fit import Fit
from ..model.effects import Candidate


@dataclass
class Screen:
    """Linear forecast around a fit: what each candidate variant, and each pair of them, would explain."""

    fit: Fit
    candidates: list[Candidate]
    owner: np.ndarray
    """Candidate of each direction."""
    gram: np.ndarray
    moment: np.ndarray
    probe: dict[int, list[int]]
    """Of candidates whose probes are alternatives: those that promise most, the one that was taken first."""

    def forecast(self, chosen: Sequence[int]) -> tuple[float, dict[int, float]]:
        """Return the drop of chi2 with these candidates, and each one's size (1 is its typical size)."""
        columns = np.flatnonzero(np.isin(self.owner, chosen))
        columns = columns[np.diag(self.gram)[columns] > 1e-6]
        while columns.size:
            matrix = self.gram[np.ix_(columns, columns)]
            ridge = 1e-6 * np.diag(np.diag(matrix))
            size = np.linalg.solve(matrix + ridge, self.moment[columns])
            wrong = np.array(
                [not self.candidates[self.owner[c]].signed and s < 0 for c, s in zip(columns, size, strict=True)]
            )
            if not wrong.any():
                limit = np.array([self.candidates[self.owner[c]].most for c in columns])
                clipped = np.clip(size, -limit, limit)
                drop = 2 * clipped @ self.moment[columns] - clipped @ matrix @ clipped
                sizes: dict[int, float] = {}
                for c, s in zip(columns, clipped, strict=True):
                    key = int(self.owner[c])
                    if abs(s) > abs(sizes.get(key, 0.0)):
                        sizes[key] = float(s)
                return max(0.0, float(drop)), sizes
            columns = columns[~wrong]
        return 0.0, {}
