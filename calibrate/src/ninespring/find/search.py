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

from ..infer.fit import Fit
from ..infer.problem import Problem
from ..model import effects
from ..model.effects import Candidate
from ..model.spec import Spec
from .evidence import difference, excess, fit_factor, gain, log_evidence, relief
from .screen import Screen

MIN_EVIDENCE = 3.0
"""Nats an effect must win by, after the price of its numbers and of having had many to choose from."""
TOLD_APART = 10.0
"""Nats below which a contender stays a rival."""
MIN_GAIN = 0.38
"""Structure, in units of the noise, an effect must explain. Below half the noise an effect does not matter."""
MIN_SHARE = 0.1
"""Of what the residual holds beyond the noise, the part an effect must explain to be adopted on the way."""
PLACES = 3
"""Of a candidate's alternative places, how many are fitted in earnest."""
BEAM = 6
"""Sets of causes that the search downwards keeps at each size ..."""
REFITTED = 3
"""... and of the best of all sizes, how many are fitted in earnest."""
STEPS = 14
"""Of one fit, at most ..."""
SPRINT = 5
"""... and of each of several starts, before the best of them goes on."""

MAX_EFFECTS = 4


@dataclass
class Search:
    """State of one search: every fit made, by its effects."""

    problem: Problem
    candidates: list[Candidate]
    base: Fit
    progress: Callable[[str], None] = lambda text: None
    fits: dict[tuple[tuple[str, str], ...], Fit] = field(default_factory=dict)
    screens: dict[tuple[tuple[str, str], ...], Screen] = field(default_factory=dict)
    directions: np.ndarray = field(init=False)
    """Of the last screen alone, (count, total directions), base numbers projected out: in a long log one is 40 MB."""
    until: int = field(init=False)
    """Simulations of the problem after which no further step is begun."""

    def __post_init__(self) -> None:
        self.until = self.problem.budget.share()

    def goes_on(self) -> bool:
        """Return whether another step may begin."""
        return self.problem.budget.allows() and self.problem.simulations <= self.until

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
                spec = candidate.added_to(fit.spec)
                start = fit.as_dict() | dict(probe)
                values = [start.get(f.key, f.start) for f in spec.free]
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
        changes = [[shown[d * many + r] - predicted[r] for r in runs] for d in range(len(owner))]
        vectors = problem.vectors(changes)
        directions = (vectors - (vectors @ q) @ q.T).T
        vector = fit.vector if fit.vector is not None else problem.vector(fit.residual)
        vector = vector - q @ (q.T @ vector)
        moment, size = directions.T @ vector, np.maximum((directions**2).sum(axis=0), 1e-12)
        owners = np.array(owner, dtype=int)
        keep = np.ones(len(owners), dtype=bool)
        places: dict[int, list[int]] = {}
        for k, candidate in enumerate(open_):
            if candidate.alternatives:
                columns = np.flatnonzero(owners == k)
                right = candidate.signed | (moment[columns] > 0)
                promise = np.where(right, moment[columns] ** 2 / size[columns], 0.0)
                places[k] = [int(j) for j in np.argsort(-promise)[:PLACES]]
                keep[columns] = False
                keep[columns[places[k][0]]] = True
        self.directions, moment = directions[:, keep], moment[keep]
        gram = self.directions.T @ self.directions
        screen = Screen(fit, open_, owners[keep], gram, moment, places)
        self.screens[key] = screen
        return screen

    def absent(self, fit: Fit) -> dict[str, tuple[float, float]]:
        """Return what the data say of the one number of effects that are not in the fit and would do nothing at zero.

        (value, standard error), for effects with no more than one variant: a chip that has another value is wrong.
        """
        screen = self.screen(fit)
        spread = math.sqrt(max(1.0, fit_factor(self.problem, fit) * fit.chi2 / fit.count))
        out = {}
        for k, one in enumerate(screen.candidates):
            if one.variant or len(one.free) != 1 or one.free[0].log or one.neutral or one.effect not in effects.ON_CHIP:
                continue
            free, column = one.free[0], int(np.flatnonzero(screen.owner == k)[0])
            if (size := float(screen.gram[column, column])) > 0:
                unit = one.probes[0][free.key]
                value = unit * float(screen.moment[column]) / size
                out[free.key] = (min(free.high, max(free.low, value)), abs(unit) * spread / math.sqrt(size))
        return out

    def refit(self, fit: Fit, added: Sequence[Candidate], sizes: Sequence[float]) -> Fit:
        """Fit `fit`'s model with candidates added, from their forecast sizes and other starts."""
        spec = fit.spec
        for candidate in added:
            spec = candidate.added_to(spec)
        key = self.key(spec)
        if key not in self.fits:
            self.fits[key] = self._raced(fit, spec, added, sizes)
        return self.fits[key]

    def _raced(self, fit: Fit, spec: Spec, added: Sequence[Candidate], sizes: Sequence[float]) -> Fit:
        """Fit a spec, which adds candidates to `fit`'s, from all their starts."""
        start = fit.as_dict()
        for candidate, size in zip(added, sizes, strict=True):
            start |= candidate.start_at(size, self.places(fit, candidate)[0])
        starts = [start]
        for candidate in added:
            others = [candidate.start_at(1.0, place) for place in self.places(fit, candidate)[1:]]
            starts += [{**start, **other} for other in (*candidate.more_starts, *others)]
        # several starts race: all begin, the one that is ahead goes on
        race = len(starts) > 1
        steps = SPRINT if race else STEPS
        begun = [
            self.problem.fit(spec, one, tolerance=1e-3, max_steps=steps, near=fit, settle=not race) for one in starts
        ]
        best = min(begun, key=lambda one: one.chi2)
        if race:
            best = self.problem.fit(spec, best.as_dict(), tolerance=1e-3, max_steps=STEPS, near=best)
        for mirror in (one.mirror for one in added if one.mirror):
            start = {**best.as_dict(), **mirror(best.as_dict(), self.problem.base_value)}
            other = self.problem.fit(spec, start, tolerance=1e-3, max_steps=STEPS)
            best = min(best, other, key=lambda one: one.chi2)
        if best.chi2 > fit.chi2:  # it lost on the way what it began with: with next to nothing added it has all of it
            start = fit.as_dict()
            for candidate in added:
                start |= candidate.start_at(0.0, self.places(fit, candidate)[0])
            again = self.problem.fit(spec, start, tolerance=1e-3, max_steps=STEPS, near=fit)
            best = min(best, again, key=lambda one: one.chi2)
        return best

    def begun_again(self, fit: Fit, before: Fit) -> Fit:
        """Return a fit that has grown from `before`, what has several places to begin at begun anew at each of them: without what
        came later it may have gone astray, and does not come back by itself."""
        for effect in fit.spec.effects:
            one = self.candidate_of(fit, effect)
            if one is None or not one.alternatives or effect in self.base.spec.effects or not self.goes_on():
                continue
            other = self.reduced(fit, effect)
            if self.key(other.spec) == self.key(before.spec):
                continue  # there it has just begun
            screen = self.screen(other)
            k = screen.candidates.index(one)
            self.progress(f"{effect} again")
            again = self._raced(other, one.added_to(other.spec), [one], [screen.forecast([k])[1].get(k, 1.0)])
            if again.chi2 < fit.chi2:
                fit = self.fits[self.key(again.spec)] = again
        return fit

    def places(self, fit: Fit, candidate: Candidate) -> list[int]:
        """Return the probes of a candidate that promise most on top of a fit, best first."""
        screen = self.screens.get(self.key(fit.spec))
        if screen is None or candidate not in screen.candidates:
            return [0]
        return screen.probe.get(screen.candidates.index(candidate), [0])

    def price(self, added: int = 1) -> float:
        """Return the nats that the freedom to choose among candidates costs."""
        return added * math.log(max(1, len(self.candidates)))

    def worth(self, better: Fit, other: Fit, added: int = 1, share: float = MIN_SHARE) -> bool:
        """Return whether `better` earns its place over `other`: no effect does whose numbers the data cannot fix at all."""
        fixed = {free.effect for free in better.spec.free if free.key not in better.stuck}
        if any(effect not in fixed for effect in better.spec.effects if effect not in other.spec.effects):
            return False
        price = self.price(added)
        if log_evidence(self.problem, better, other) - price < MIN_EVIDENCE:
            return False
        if relief(better, other) - price >= MIN_EVIDENCE:
            return True  # springs of their own would explain as much, and would have to lie further apart than they do
        if self.problem.colour is not None:
            # what is taken for noise that lasts may be any part of the error: what counts is that predictions change
            return difference(self.problem, better, other) >= MIN_GAIN
        beyond = excess(self.problem, other)
        explained = (other.sse - better.sse) / better.count
        return gain(better, other) >= MIN_GAIN and explained >= share * beyond

    def preferred(self, one: Fit, other: Fit) -> bool:
        """Return whether `one` takes the place of `other`, which has as many effects."""
        return log_evidence(self.problem, one, other) > self.handicap(one, other)

    def candidate_of(self, fit: Fit, effect: str) -> Candidate | None:
        """Return the candidate by which a fit has an effect."""
        wanted = (effect, dict(fit.spec.variant).get(effect))
        return next((c for c in self.candidates if (c.effect, c.variant) == wanted), None)

    def is_flexible(self, fit: Fit, effect: str) -> bool:
        """Return whether a fit has an effect in a variant that follows anything slow."""
        one = self.candidate_of(fit, effect)
        return one is not None and one.flexible

    def handicap(self, one: Fit, other: Fit) -> float:
        """Return the nats by which `one` must be ahead: TOLD_APART where it alone has a flexible cause, and the other
        something else in its place.

        Negative the other way round; 0 where both have that effect, bent or not.
        """
        flexible = {c.effect for c in self.candidates if c.flexible}
        shared = flexible & set(one.spec.effects) & set(other.spec.effects)
        bends = [any(self.is_flexible(fit, name) for name in set(fit.spec.effects) - shared) for fit in (one, other)]
        return TOLD_APART * (bends[0] - bends[1])

    def holds_out(self, better: Fit, other: Fit) -> bool:
        """Return whether `better` also predicts blocks better that neither was fitted to."""
        if self.problem.colour is not None:
            return True  # the likelihood of innovations is that of each reading by those before it
        noise = self.problem.noise_c
        gained = self.problem.holdout_rmse(other) ** 2 - self.problem.holdout_rmse(better) ** 2
        return gained > (0.6 * MIN_GAIN * noise) ** 2

    def floor(self) -> float:
        """Return the squares that an addition must explain: what matters, or, of innovations, what is evidence."""
        if self.problem.colour is not None:
            return 2.0 * (MIN_EVIDENCE + self.price())
        return MIN_GAIN**2 * self.problem.count

    def extend(self, fit: Fit, singles: int = 6, pairs: int = 2) -> list[tuple[Fit, int]]:
        """Return refits of the most promising single and paired additions to `fit`, with how many were added."""
        screen = self.screen(fit)
        count = len(screen.candidates)
        alone = [screen.forecast([k]) for k in range(count)]
        floor = self.floor()
        out: list[tuple[Fit, int]] = []
        # one variant an effect (the best by forecast), several where close
        order = sorted(range(count), key=lambda k: -alone[k][0])
        best_drop = alone[order[0]][0] if order else 0.0
        tried: dict[str, int] = {}
        for k in order:
            effect = screen.candidates[k].effect
            if tried.get(effect, 0) >= (2 if alone[k][0] > 0.9 * best_drop else 1):
                continue
            if len(out) >= singles or alone[k][0] < max(0.3 * floor, 0.05 * best_drop) or not self.goes_on():
                break
            tried[effect] = tried.get(effect, 0) + 1
            self.progress(f"fitting {effect}")
            out.append((self.refit(fit, [screen.candidates[k]], [alone[k][1].get(k, 1.0)]), 1))
        if not pairs:
            return out
        best_single = min((f.chi2 for f, _ in out), default=fit.chi2)
        top: dict[str, list[int]] = {}
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
            if len(done) >= pairs or fit.chi2 - drop > best_single - floor or not self.goes_on():
                break
            names = frozenset((screen.candidates[a].effect, screen.candidates[b].effect))
            if names in done:
                continue
            done.add(names)
            self.progress(f"fitting {' + '.join(sorted(names))}")
            out.append((self.refit(fit, [screen.candidates[a], screen.candidates[b]], [sizes[a], sizes[b]]), 2))
        return out

    def forward(self, current: Fit) -> Fit:
        """Add effects, one or two at a time, while they earn their place."""
        while len(current.spec.effects) - len(self.base.spec.effects) < MAX_EFFECTS:
            if not self.goes_on() or excess(self.problem, current) < 0.5 * MIN_GAIN**2:
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
            current = self.begun_again(best, current)
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
            self.fits[key] = self.problem.fit(spec, fit.as_dict(), tolerance=1e-3, max_steps=STEPS, near=fit)
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
            own = self.candidate_of(fit, effect)
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
                # where something flexible took up something slow, a linear forecast says too little of a slow node
                slow = own is not None and own.flexible and screen.candidates[k].slow_node
                # and of what was fitted on the way its fit says more
                fitted = self.fits.get(self.key(screen.candidates[k].added_to(other.spec)))
                wanted = slow or (len(seen) < most and drop >= 0.5 * needed)
                known = fitted is not None and other.chi2 - fitted.chi2 >= 0.5 * needed
                if name in seen or not (known or (wanted and self.goes_on())):
                    continue
                seen.add(name)
                self.progress(f"could it be {name} instead of {effect}?")
                out.append((effect, self.refit(other, [screen.candidates[k]], [sizes.get(k, 1.0)])))
        return out

    def other_laws(self, fit: Fit, without: dict[str, Fit]) -> list[tuple[str, Fit]]:
        """Return models in which one of `fit`'s effects follows another law that may explain as much, however long was searched."""
        out = []
        for effect, other in without.items():
            own = self.candidate_of(fit, effect)
            if own is None or not own.law:
                continue
            screen = self.screen(other)
            # a law that bends explains more than a line along it: lines are compared
            line = screen.forecast([screen.candidates.index(own)])[0]
            for k, one in enumerate(screen.candidates):
                if one.effect != effect or one is own or screen.forecast([k])[0] < 0.5 * line:
                    continue
                spec = one.added_to(other.spec)
                if (key := self.key(spec)) not in self.fits:
                    self.progress(f"{effect}: {one.variant}?")
                    self.fits[key] = self.problem.fit(spec, fit.as_dict(), tolerance=1e-3, max_steps=STEPS)
                out.append((effect, self.fits[key]))
        return out

    def settle(
        self, fit: Fit, share: float = MIN_SHARE, grow: bool = True
    ) -> tuple[Fit, dict[str, Fit], list[tuple[str, Fit]]]:
        """Drop what is not needed and swap what another explains better, until neither changes anything.

        Return the fit that stays, the fits without each effect, and the contenders.
        """
        before: tuple[Fit, dict[str, Fit], list[tuple[str, Fit]]] | None = None
        for turn in range(4):
            fit, without = self.backward(fit, share)
            if before is not None and set(fit.spec.effects) < set(before[0].spec.effects):
                return before  # what took a place did not stay: it is no better there
            contenders = [*self.rivals(fit, without), *self.other_laws(fit, without)]
            better = [(other.chi2, k) for k, (_, other) in enumerate(contenders) if self.preferred(other, fit)]
            if turn == 3 or not better:
                break
            before = fit, without, contenders
            fit = contenders[min(better)[1]][1]
            if grow:
                fit = self.forward(fit)
        return fit, without, contenders

    def together(self, fit: Fit) -> list[list[int]]:
        """Return sets of candidates that would explain most together by linear forecast, whether or not each helps alone.

        From every pair on, sets grow by one in a beam, priced for their numbers and for what they were chosen from.
        """
        screen = self.screen(fit)
        numbers = [len(one.free) for one in screen.candidates]
        beam: list[tuple[float, frozenset[int]]] = [(0.0, frozenset())]
        best: dict[frozenset[int], float] = {}
        for _ in range(MAX_EFFECTS):
            grown: dict[frozenset[int], float] = {}
            for _, chosen in beam:
                there = {screen.candidates[k].effect for k in chosen}
                for k, one in enumerate(screen.candidates):
                    if one.effect in there or one.flexible or (more := chosen | {k}) in grown:
                        continue
                    drop, _ = screen.forecast(sorted(more))
                    price = sum(numbers[j] for j in more) * 0.5 * math.log(fit.count) + self.price(len(more))
                    grown[more] = 0.5 * drop / fit_factor(self.problem, fit) - price
            beam = sorted(((score, chosen) for chosen, score in grown.items()), key=lambda one: -one[0])[:BEAM]
            best |= {chosen: score for score, chosen in beam}
        order = sorted((chosen for chosen in best if len(chosen) > 1), key=lambda one: -best[one])
        return [sorted(one) for one in order[:REFITTED] if best[one] > 0]

    @staticmethod
    def _anywhere(candidates: Sequence[Candidate], sets: Sequence[Sequence[int]]) -> list[list[int]]:
        """Return sets with what may be in any of several places among them, not only where it is declared: of that a linear forecast
        without its company says too little."""
        out: list[list[int]] = []
        for k, one in enumerate(candidates):
            for chosen in sets if one.alternatives else ():
                rest = [j for j in chosen if candidates[j].effect != one.effect]
                if (more := sorted([*rest, k])) not in [*sets, *out] and len(more) <= MAX_EFFECTS:
                    out.append(more)
        return out

    def downward(self, current: Fit) -> Fit:
        """Return the best fit of causes that only help together, pruned; `current` where none is better."""
        screen = self.screen(self.base)
        sets = [one for one in self.together(self.base) if len(screen.forecast(one)[1]) == len(one)]
        for chosen in [*sets, *self._anywhere(screen.candidates, sets)]:
            if not self.goes_on() or excess(self.problem, current) < MIN_GAIN**2:
                break
            sizes = dict.fromkeys(chosen, 1.0) | screen.forecast(chosen)[1]
            self.progress(f"fitting {' + '.join(screen.candidates[k].effect for k in chosen)}")
            fit = self.refit(self.base, [screen.candidates[k] for k in chosen], [sizes[k] for k in chosen])
            fit = self.begun_again(fit, self.base)
            if fit.chi2 >= current.chi2:
                continue  # and so is every part of it
            fit = self.begun_again(self.backward(fit)[0], self.base)
            if fit is not current and fit.chi2 < current.chi2 and self.preferred(fit, current):
                more = len(fit.spec.effects) - len(current.spec.effects)
                if more <= 0 or self.worth(fit, current, more):
                    current = fit
        return current

    def run(self, downwards: bool = True) -> tuple[Fit, dict[str, Fit], list[tuple[str, Fit]]]:
        """Search upwards, and where structure remains downwards too, if wanted.

        Return the chosen fit, the fits without each effect, and the contenders.
        """
        found = self.forward(self.base)
        if downwards and self.goes_on() and excess(self.problem, found) >= MIN_GAIN**2:
            found = self.forward(self.downward(found))
        return self.settle(found)
