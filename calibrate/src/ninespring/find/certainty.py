"""How sure an adopted effect is: what it explains, and whether it explains the same share everywhere and always.

A cause that is there explains its part at every time and at every spring that it acts on. A name that only stands in for
something else fits here better than there. Both are measured on the effect's own signal: what the fitted model shows less
what it shows with this effect switched off and every other number as it is.
"""

from __future__ import annotations

import math

import numpy as np

from ..infer.fit import Fit
from ..infer.problem import Problem
from ..io import results, statistics
from .evidence import excess, log_evidence, relief, strain

STRETCHES = 4
"""Parts of a run in which an effect's size is estimated on its own."""
CERTAIN = 0.9
"""Probability from which an effect is called certain, not probable."""
PROBABLE = CERTAIN - 0.01
"""The most that an effect is sure where something else may be it."""
NAMED = 0.5
"""Probability from which an effect is named at all."""
ENOUGH_NATS = 10.0
"""Evidence beyond which more says nothing more (twenty thousand to one): what stands in for something else has hundreds, too."""
WEIGHTS = {"one": -7.80, "share": 1.84, "in_time": -1.97, "nats": 5.10, "flexible": -3.43}
"""Logistic weights of a witness: fitted by bench/diagnose/certainty.py to developing seeds, checked on reporting ones; that of the nats moved with
ENOUGH_NATS from 30 to 10, so that what has more than enough is as likely as it was."""


class Witness(results.Witness):
    """What speaks for an effect in a fit, weighed."""

    def features(self) -> dict[str, float]:
        """Return what the probability is computed from, each bounded."""
        return {
            "one": 1.0,
            "share": math.log10((self.share + 0.01) / (1.01 - self.share)),
            "in_time": math.log10(0.01 + self.in_time),
            "nats": math.log10(max(1.0, min(self.nats, ENOUGH_NATS))),
            "flexible": float(self.flexible),
        }

    def probability(self) -> float:
        """Return how likely the effect is there."""
        z = sum(WEIGHTS[name] * value for name, value in self.features().items())
        return 1.0 / (1.0 + math.exp(-z))


def scatter(signal: list[np.ndarray], residual: list[np.ndarray], noise_factor: float) -> float:
    """Return how an amplitude fitted in each cell scatters about 1, rms weighted by signal, beyond what noise makes."""
    top = bottom = 0.0
    for s, r in zip(signal, residual, strict=True):
        power = float(s @ s)
        if power <= 0:
            continue
        off = float(s @ r) / power
        top += power * max(0.0, off**2 - noise_factor / power)
        bottom += power
    return math.sqrt(top / bottom) if bottom > 0 else math.inf


def _judged(problem: Problem, fields: list[np.ndarray]) -> list[np.ndarray]:
    """Return fields (per run, degC) as the problem weighs readings: in units of the noise, as innovations where errors last."""
    columns = problem.filtered(np.concatenate(problem.scaled(fields))[:, None])[:, 0]
    out = []
    for mask, part in zip(problem.mask, problem.by_run(columns), strict=True):
        out.append(np.full(mask.shape, np.nan))
        out[-1][mask] = part
    return out


def witness(problem: Problem, fit: Fit, effect: str, without: Fit, flexible: bool) -> Witness:
    """Return what speaks for an effect in a fit; `without` is the best fit that lacks it."""
    beyond = max(1e-9, excess(problem, without))
    bare = problem.predictions_without(fit, effect)
    shown = problem.predictions(fit.spec, fit.values)
    left = problem.without_errors(fit.residual)
    # beside errors that last a stretch tells of a size what their innovations tell of it: least squares would take what
    # lasts for a size that changes
    white = problem.colour.white if problem.colour is not None else None
    signal = _judged(problem, [full - less for full, less in zip(shown, bare, strict=True)])
    rest = _judged(problem, left)
    factor = white or statistics.correlation_factor(rest, problem.longest_lag())
    times: tuple[list[np.ndarray], list[np.ndarray]] = ([], [])
    places: tuple[list[np.ndarray], list[np.ndarray]] = ([], [])
    for one, scaled, mask in zip(signal, rest, problem.mask, strict=True):
        stretch = np.arange(len(one)) * STRETCHES // len(one)
        for k in range(STRETCHES):
            here = mask & (stretch == k)[:, None]
            times[0].append(one[here])
            times[1].append(scaled[here])
        for k in range(one.shape[1]):
            places[0].append(one[mask[:, k], k])
            places[1].append(scaled[mask[:, k], k])
    share = (without.sse - fit.sse) / fit.count / beyond
    if relief(fit, without) > 0.0:
        # of how far random effects lie apart beyond what is believed, it explains a part, too
        numbers = sum(free.effect is not None and free.trust > 0.0 for free in without.spec.free)
        strained = strain(without, fit)
        if (relieved := strained - strain(fit, without)) > 0.0:
            share = max(share, relieved / max(relieved, strained - 0.5 * numbers))
    return Witness(
        log_evidence(problem, fit, without),
        min(1.0, max(0.0, share)),
        min(10.0, scatter(*times, factor)),
        min(10.0, scatter(*places, factor)),
        math.sqrt(excess(problem, fit)),
        flexible,
    )
