"""The search for missing effects: screening, singles, pairs, backward elimination, swaps, rivals.

Every decision compares two fits by `evidence` (nats, autocorrelation taken into account) and by `gain`: how
much structure, in units of the sensor's noise, the better one explains. Statistical evidence alone adopts
nothing: with 16,000 samples anything is significant.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from . import statistics
from .effects import Candidate
from .fitting import Fit, Problem, Spec

MIN_EVIDENCE = 3.0
"""Nats an effect must win by, after the price of its numbers and of having had many to choose from."""
TOLD_APART = 10.0
"""Nats below which a contender stays a rival."""
MIN_GAIN = 0.38
"""Structure, in units of the noise, an effect must explain. Below half the noise an effect does not matter."""
MIN_SHARE = 0.2
"""Of what the residual holds beyond the noise, the part an effect must explain to be adopted on the way."""
MIN_SHARE_UNEXPLAINED = 0.35
"""The same where structure remains at the end: nothing is adopted just because it helps a little ..."""
MIN_TOTAL_UNEXPLAINED = 0.75
"""... and what is adopted must together explain this part of what the declared model left."""
EQUIVALENT = 0.3
"""Two models whose predictions differ by less than this (rms, in units of the noise) are the same in practice."""
UNEXPLAINED = 0.5
"""Structure left, rms in units of the noise, above which the rest counts as unexplained: less does not matter."""
UNEXPLAINED_LOCAL = 1.0
"""The same for one spring of one run, where the two laws of a phase change may differ for a while."""
MAX_EFFECTS = 4
DRIFTS = ("free", "slow")
"""Variants of ambient_drift that follow anything slow. They must beat a physical cause by TOLD_APART, not just by 0."""
SLOW_NODES = ("shared_air", "plate_conduction")
"""Effects that are tried in the place of such a drift whatever the forecast says."""


def handicap(one: Fit, other: Fit) -> float:
    """Return the nats by which `one` must be ahead of `other`: more where it has a drift in a physical cause's place.

    Negative the other way round; 0 where both have a drift, bent or not.
    """
    drifts = [dict(fit.spec.variant).get("ambient_drift") for fit in (one, other)]
    if None not in drifts:
        return 0.0
    return TOLD_APART * ((drifts[0] in DRIFTS) - (drifts[1] in DRIFTS))


def log_evidence(problem: Problem, better: Fit, other: Fit) -> float:
    """Return by how many nats the data prefer `better`: half the difference of BIC, autocorrelation accounted for.

    Two accounts, the clearer one counts. Slow structure: residuals at their effective sample size. Fast structure:
    the innovations of an autoregression of each residual, which are nearly independent whatever remains slow.
    """
    factor = fit_factor(problem, better)
    n = better.count / factor
    k = len(better.spec.free) - len(better.stuck) - (len(other.spec.free) - len(other.stuck))
    slow = 0.5 * n * math.log(max(other.chi2, 1e-12) / max(better.chi2, 1e-12)) - 0.5 * k * math.log(max(n, 2.0))
    ratio = innovation(problem, other) / innovation(problem, better)
    fast = 0.5 * better.count * math.log(max(ratio, 1e-12)) - 0.5 * k * math.log(better.count)
    return max(slow, fast) if better.chi2 <= other.chi2 else slow


def innovation(problem: Problem, fit: Fit) -> float:
    """Return the variance of a residual's innovations, in units of the noise^2 (Yule-Walker, six lags)."""
    if not math.isfinite(fit.innovation):
        scaled = [left / noise for left, noise in zip(fit.residual, problem.noise, strict=True)]
        rho = statistics.autocorrelation(scaled, 6)
        matrix = rho[np.abs(np.arange(6)[:, None] - np.arange(6))] + 1e-6 * np.eye(6)
        share = float(rho[1:] @ np.linalg.solve(matrix, rho[1:]))
        fit.innovation = fit.sse / fit.count * max(1e-6, 1.0 - share)
    return fit.innovation


def fit_factor(problem: Problem, fit: Fit) -> float:
    """Return samples per independent sample of a fit's residual."""
    if not math.isfinite(fit.factor):
        fit.factor = statistics.correlation_factor(
            [left / noise for left, noise in zip(fit.residual, problem.noise, strict=True)],
            problem.longest_lag(),
        )
    return fit.factor


def gain(better: Fit, other: Fit) -> float:
    """Return the structure that `better` explains and `other` does not, rms in units of the noise."""
    return math.sqrt(max(0.0, other.sse - better.sse) / better.count)


def excess(problem: Problem, fit: Fit) -> float:
    """Return what the residual holds beyond white noise, as a mean square in units of the noise (>= 0)."""
    return max(0.0, float(np.nanmax(structure_by_width(problem, fit))))


def structure_by_width(problem: Problem, fit: Fit) -> np.ndarray:
    """Return pooled structure (mean square, noise units) at block widths of 4, 12 and 40 rows."""
    out = []
    residual = problem.without_starts(fit.residual)
    for width in (4, 12, 40):
        part = statistics.structure(residual, problem.noise, width, [run.starts for run in problem.runs])
        weight = np.array([mask.sum(axis=0) for mask in problem.mask], dtype=float)
        weight = np.where(np.isfinite(part), weight, 0.0)
        out.append(float(np.nansum(np.nan_to_num(part) * weight) / max(1.0, weight.sum())))
    return np.array(out)


def difference(problem: Problem, a: Fit, b: Fit) -> float:
    """Return the rms difference of what two fits predict, in units of the noise."""
    total = 0.0
    for one, two, noise, mask in zip(a.residual, b.residual, problem.noise, problem.mask, strict=True):
        total += float((((one - two) / noise)[mask] ** 2).sum())
    return math.sqrt(total / a.count)


@dataclass
class Screen:
    """Linear forecast around a fit: what each candidate variant, and each pair of them, would explain."""

    fit: Fit
    candidates: list[Candidate]
    directions: np.ndarray
    """(count, total directions), base numbers projected out."""
    owner: np.ndarray
    """Candidate of each direction."""
    gram: np.ndarray
    moment: np.ndarray

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


@dataclass
class Search:
    """State of one search: every fit made, by its effects."""

    problem: Problem
    candidates: list[Candidate]
    base: Fit
    progress: Callable[[str], None] = lambda text: None
    fits: dict[tuple[tuple[str, str], ...], Fit] = field(default_factory=dict)
    screens: dict[tuple[tuple[str, str], ...], Screen] = field(default_factory=dict)
    thorough: bool = True

    @staticmethod
    def key(spec: Spec) -> tuple[tuple[str, str], ...]:
        """Return what identifies a model here: effects and their variants."""
        return tuple(sorted(spec.variant))

    def screen(self, fit: Fit) -> Screen:
        """Simulate every candidate at its typical size on top of `fit`, once."""
        key = self.key(fit.spec)
        if key in self.screens:
            return self.screens[key]
        problem = self.problem
        taken = set(fit.spec.effects)
        open_ = [c for c in self.candidates if c.effect not in taken]
        jobs, owner = [], []
        runs = range(len(problem.runs))
        for k, candidate in enumerate(open_):
            for probe in candidate.probes:
                spec = fit.spec.with_effect(
                    candidate.effect,
                    candidate.free,
                    candidate.fixed,
                    candidate.variant,
                    candidate.also_on,
                )
                values = np.concatenate([fit.values, [probe.get(f.key, f.start) for f in candidate.free]])
                jobs += [(spec, values, r) for r in runs]
                owner.append(k)
        shown = problem.simulate_many(jobs) if jobs else []
        predicted = problem.predictions(fit.spec, fit.values)
        many = len(problem.runs)
        jac = fit.jacobian
        if jac is None:
            jac = problem.jacobian(fit.spec, fit.values, predicted)
        used = jac[:, np.linalg.norm(jac, axis=0) > 1e-6]
        q = np.linalg.qr(used)[0] if used.shape[1] else np.zeros((problem.count, 0))
        directions = np.empty((problem.count, len(owner)))
        for d in range(len(owner)):
            change = [shown[d * many + r] - predicted[r] for r in runs]
            vector = problem.vector(change)
            directions[:, d] = vector - q @ (q.T @ vector)
        vector = fit.vector if fit.vector is not None else problem.vector(fit.residual)
        vector = vector - q @ (q.T @ vector)
        screen = Screen(
            fit,
            open_,
            directions,
            np.array(owner, dtype=int),
            directions.T @ directions,
            directions.T @ vector,
        )
        self.screens[key] = screen
        return screen

    def refit(self, fit: Fit, added: Sequence[Candidate], sizes: Sequence[float]) -> Fit:
        """Fit `fit`'s model with candidates added, from their forecast sizes and other starts."""
        spec = fit.spec
        start = fit.as_dict()
        for candidate, size in zip(added, sizes, strict=True):
            spec = spec.with_effect(
                candidate.effect,
                candidate.free,
                candidate.fixed,
                candidate.variant,
                candidate.also_on,
            )
            start |= candidate.start_at(size)
        key = self.key(spec)
        if key in self.fits:
            return self.fits[key]
        best = self.problem.fit(spec, start, tolerance=1e-3, max_steps=14)
        for candidate in added:
            for other in candidate.more_starts:
                if self.thorough or len(added) == 1:
                    again = self.problem.fit(spec, start | other, tolerance=1e-3, max_steps=14)
                    best = min(best, again, key=lambda one: one.chi2)
        self.fits[key] = best
        return best

    def price(self, added: int = 1) -> float:
        """Return the nats that the freedom to choose among candidates costs."""
        return added * math.log(max(1, len(self.candidates)))

    def worth(self, better: Fit, other: Fit, added: int = 1, share: float = MIN_SHARE) -> bool:
        """Return whether `better` earns its place over `other`."""
        beyond = excess(self.problem, other)
        explained = (other.sse - better.sse) / better.count
        return (
            log_evidence(self.problem, better, other) - self.price(added) >= MIN_EVIDENCE
            and gain(better, other) >= MIN_GAIN
            and explained >= share * beyond
        )

    def preferred(self, one: Fit, other: Fit) -> bool:
        """Return whether `one` takes the place of `other`, which has as many effects."""
        ahead = (
            log_evidence(self.problem, one, other) if one.chi2 < other.chi2 else -log_evidence(self.problem, other, one)
        )
        return ahead > handicap(one, other)

    def holds_out(self, better: Fit, other: Fit) -> bool:
        """Return whether `better` also predicts blocks better that neither was fitted to."""
        noise = self.problem.noise_c
        gained = self.problem.holdout_rmse(other) ** 2 - self.problem.holdout_rmse(better) ** 2
        return gained > (0.6 * MIN_GAIN * noise) ** 2

    def extend(self, fit: Fit, singles: int = 8, pairs: int = 4) -> list[tuple[Fit, int]]:
        """Return refits of the most promising single and paired additions to `fit`, with how many were added."""
        screen = self.screen(fit)
        count = len(screen.candidates)
        alone = [screen.forecast([k]) for k in range(count)]
        floor = MIN_GAIN**2 * self.problem.count
        out: list[tuple[Fit, int]] = []
        # one variant an effect (the best by forecast), several where close
        order = sorted(range(count), key=lambda k: -alone[k][0])
        best_drop = alone[order[0]][0] if order else 0.0
        tried: dict[str, int] = {}
        for k in order:
            effect = screen.candidates[k].effect
            if tried.get(effect, 0) >= (2 if alone[k][0] > 0.9 * best_drop else 1):
                continue
            if len(out) >= singles or alone[k][0] < max(0.3 * floor, 0.02 * best_drop):
                break
            tried[effect] = tried.get(effect, 0) + 1
            self.progress(f"fitting {effect}")
            out.append((self.refit(fit, [screen.candidates[k]], [alone[k][1].get(k, 1.0)]), 1))
        if not pairs:
            return out
        best_single = min((f.chi2 for f, _ in out), default=fit.chi2)
        top = {}
        for k in range(count):
            top.setdefault(screen.candidates[k].effect, []).append(k)
        keep = [k for ks in top.values() for k in sorted(ks, key=lambda k: -alone[k][0])[: 3 if len(ks) > 4 else 2]]
        forecasts = []
        for a, b in itertools.combinations(keep, 2):
            if screen.candidates[a].effect == screen.candidates[b].effect:
                continue
            drop, sizes = screen.forecast([a, b])
            if len(sizes) == 2:
                forecasts.append((drop, a, b, sizes))
        forecasts.sort(key=lambda one: -one[0])
        done: set[frozenset[str]] = set()
        for drop, a, b, sizes in forecasts:
            if len(done) >= pairs or fit.chi2 - drop > best_single - floor:
                break
            names = frozenset((screen.candidates[a].effect, screen.candidates[b].effect))
            if names in done:
                continue
            done.add(names)
            self.progress(f"fitting {' + '.join(sorted(names))}")
            out.append(
                (
                    self.refit(
                        fit,
                        [screen.candidates[a], screen.candidates[b]],
                        [sizes[a], sizes[b]],
                    ),
                    2,
                )
            )
        return out

    def forward(self, current: Fit) -> Fit:
        """Add effects, one or two at a time, while they earn their place."""
        while len(current.spec.effects) - len(self.base.spec.effects) < MAX_EFFECTS:
            if excess(self.problem, current) < 0.5 * MIN_GAIN**2:
                break
            options = self.extend(current)
            if not options:
                break
            best: Fit | None = None
            best_added = 0
            for fit, added in sorted(options, key=lambda one: one[1]):
                if best is None:
                    if self.worth(fit, current, added):
                        best, best_added = fit, added
                elif added == best_added:
                    if self.preferred(fit, best):
                        best = fit
                elif self.worth(fit, best, 1):
                    best, best_added = fit, added
            if best is None or not self.holds_out(best, current):
                break
            current = best
        return current

    def backward(self, fit: Fit, share: float = MIN_SHARE) -> tuple[Fit, dict[str, Fit]]:
        """Drop what is no longer needed; return what stays and, per effect, the fit without it."""
        base = set(self.base.spec.effects)
        while True:
            without: dict[str, Fit] = {}
            for effect in fit.spec.effects:
                if effect not in base:
                    self.progress(f"is {effect} still needed?")
                    without[effect] = self.reduced(fit, effect)
            useless = [
                (log_evidence(self.problem, fit, other), effect)
                for effect, other in without.items()
                if not self.worth(fit, other, 1, share)
            ]
            if not useless:
                return fit, without
            fit = without[min(useless)[1]]

    def reduced(self, fit: Fit, effect: str) -> Fit:
        """Return the fit without one effect."""
        spec = fit.spec.without(effect)
        key = self.key(spec)
        if key == self.key(self.base.spec):
            return self.base
        if key not in self.fits:
            self.fits[key] = self.problem.fit(spec, fit.as_dict(), tolerance=1e-3, max_steps=14)
        return self.fits[key]

    def rivals(self, fit: Fit, without: dict[str, Fit], most: int = 3) -> list[tuple[str, Fit]]:
        """Return models that put another effect in the place of one of `fit`'s, best first, whatever their merit.

        Another variant of the same effect counts too: what was the better start is not always the better end.
        """
        out = []
        for effect, other in without.items():
            screen = self.screen(other)
            forecasts = []
            variant = dict(fit.spec.variant)[effect]
            for k, candidate in enumerate(screen.candidates):
                if (candidate.effect, candidate.variant) == (effect, variant):
                    continue
                if candidate.effect != effect and candidate.effect in fit.spec.effects:
                    continue
                drop, sizes = screen.forecast([k])
                forecasts.append((drop, k, sizes))
            forecasts.sort(key=lambda one: -one[0])
            needed = other.chi2 - fit.chi2
            seen: set[str] = set()
            for drop, k, sizes in forecasts:
                name = screen.candidates[k].effect
                # where a drift took up something slow, a linear forecast says too little of a slow node
                slow = variant in DRIFTS and effect == "ambient_drift" and name in SLOW_NODES
                if name in seen or (not slow and (len(seen) >= most or drop < 0.5 * needed)):
                    continue
                seen.add(name)
                self.progress(f"could it be {name} instead of {effect}?")
                out.append(
                    (
                        effect,
                        self.refit(other, [screen.candidates[k]], [sizes.get(k, 1.0)]),
                    )
                )
        return out

    def settle(
        self, fit: Fit, share: float = MIN_SHARE, grow: bool = True
    ) -> tuple[Fit, dict[str, Fit], list[tuple[str, Fit]]]:
        """Drop what is not needed and swap what another explains better, until neither changes anything.

        Return the fit that stays, the fits without each effect, and the contenders.
        """
        for turn in range(4):
            fit, without = self.backward(fit, share)
            contenders = self.rivals(fit, without)
            better = [(other.chi2, k) for k, (_, other) in enumerate(contenders) if self.preferred(other, fit)]
            if turn == 3 or not better:
                break
            fit = contenders[min(better)[1]][1]
            if grow:
                fit = self.forward(fit)
        return fit, without, contenders

    def run(self) -> tuple[Fit, dict[str, Fit], list[tuple[str, Fit]]]:
        """Search; return the chosen fit, the fits without each effect, and the contenders."""
        return self.settle(self.forward(self.base))


def unexplained(problem: Problem, fit: Fit) -> bool:
    """Return whether structure well above the noise is left in a fit's residual."""
    pooled = structure_by_width(problem, fit)
    if math.sqrt(max(0.0, float(pooled.max()))) > UNEXPLAINED:
        return True
    residual = problem.without_starts(fit.residual)
    for width in (12, 40):
        local = statistics.structure(residual, problem.noise, width, [run.starts for run in problem.runs])
        blocks = np.array([mask.sum(axis=0) for mask in problem.mask]) / width
        spread = np.sqrt(2.0 / np.maximum(blocks, 1.0)) / width
        if np.any(local > np.maximum(UNEXPLAINED_LOCAL**2, 6 * spread)):
            return True
    return False
