"""Where a log has no ambient: how warm its room was, told by its first minute.

A run's first readings say how warm its springs are, and how they move from there says what they lose heat to. Beside that stands
what the runs of the fit were like: so much warmer than their coldest spring was at first, and so far apart in that. Where several runs
begin alike they begin at their rooms, and a fit may move those by what rooms move in a run and no further: free, they stand in for what a
model lacks.
"""

from __future__ import annotations

import contextlib
import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..io import statistics
from ..io.logs.run import Run
from ..model import native
from ..model.effects.ambient_drift import MOST_K_PER_H
from ..model.simulate import WARM_K as BEGINS_WARM_K
from ..model.simulate import fades_per_s, hidden_k, simulate_run
from ..model.spec import AMBIENT_OFFSET, AROUND, AROUND_SHARE, SENSOR_OFFSET

FIRST_S = 60.0
"""Of a run, what it is told by."""
FEWER = 6.0
"""Readings that count as one: at first all errors are each other's, of rounding, start and model."""
DRIVE_OFF = 0.03
"""Part by which a drive is usually off, one sigma: it must not count as a room's."""
LOSS_OFF = 0.1
"""Part of a warm spring's loss that may be another node's: a room is told so much worse by one that begins warm."""
SHARE_OFF = 0.5
"""How far what is around springs that begin warm is from what it was in other runs, one sigma: some were warmed for long, others shortly before."""
LOGGED_K = 0.5
"""How far what springs lose heat to is from where it was logged, one sigma."""
ROOMS_K = 3.0
"""How far a room is from what it was on another day, one sigma."""
ANYWHERE_K = 100.0
"""One sigma of a room of which nothing is believed."""
WARM_K = 60.0
"""Within which a spring is of its room that was driven shortly before its run began."""
AS_OTHERS = 0.9
"""How likely a run begins as those did that were fitted, before it is seen."""
COLDEST_RESTED = 0.5
"""The same where its springs are apart: the coldest of them was driven before, or it was not."""
SAME_K = 0.3
"""How well runs that agree know how much warmer than its first reading a room is, at best."""
MOVES_K = 1.0
"""How far from where a rested run begins its room is, one sigma: it moves in the run, and what drives the springs warms it. A fit takes
it for twice that at most."""
TOGETHER_K = 3.0
"""Thermometers at rest in one room differ by less ..."""
HOTTEST_C = 35.0
"""... and show less: nobody works in a hotter room, whatever all runs begin at."""
SURELY = 3.0
"""Of their errors, by how many a thermometer must move before its spring does."""


@dataclass(frozen=True)
class Guess:
    """How warm a room may be, degC, one sigma of it, and the logarithm of how likely that is beside others."""

    nats: float
    room_c: float
    sigma_k: float

    def told(self, room_c: float, variance: float) -> float:
        """Return the logarithm of how likely it is that something with this variance, K^2, says so of the room."""
        spread = self.sigma_k**2 + variance
        return -0.5 * ((room_c - self.room_c) ** 2 / spread + math.log(2.0 * math.pi * spread))

    def with_told(self, room_c: float, variance: float) -> Guess:
        """Return it with what something says of the room."""
        share = self.sigma_k**2 / (self.sigma_k**2 + variance)
        middle = self.room_c + share * (room_c - self.room_c)
        return Guess(self.nats + self.told(room_c, variance), middle, self.sigma_k * math.sqrt(1.0 - share))


def first_c(run: Run) -> float:
    """Return what a run's coldest spring shows before anything is driven, within a first minute, or in its first 5 s, degC."""
    return _begins_at(run)[0]


def _before_driven(run: Run) -> slice:
    """Return the rows of a run's first minute before anything is driven, or at least its first with a reading."""
    driven = np.flatnonzero((run.drive != 0.0).any(axis=1))
    rests_s = min(FIRST_S, run.time_s[driven[0]] - run.time_s[0] if driven.size else FIRST_S)
    read = np.flatnonzero(np.isfinite(run.temperature_c).any(axis=1))
    # what is driven from a row on has not warmed what that row shows
    end = int(np.searchsorted(run.time_s - run.time_s[0], rests_s, side="right"))
    return slice(max(end, 1 + read[0] if read.size else 1))


def _begins_at(run: Run) -> tuple[float, float]:
    """Return what a run's coldest spring shows then, degC, and how far the warmest is above it, K."""
    first = run.temperature_c[_before_driven(run)]
    # a mean: where thermometers step, it is finer than any of them; without what is nonsense
    middle = [statistics.trimmed_mean(one[np.isfinite(one)]) for one in first.T if np.isfinite(one).any()]
    return (float(min(middle)), float(max(middle) - min(middle))) if middle else (math.nan, math.nan)


def moves(run: Run) -> bool:
    """Return whether a run's springs are on their way to their room as it begins.

    What nothing drives rests at its room alone: springs that move by more than their thermometers' errors, and faster than rooms do, are
    warmer than it if they fall, and colder if they rise. So are those that fall later, driven or not, by more than rooms do until then:
    nothing cools them below it. Half of the thermometers must say so, as one may be off.
    """
    since_s, there = run.time_s - run.time_s[0], np.isfinite(run.temperature_c)
    noise = np.fmax(statistics.noise_floor(run.temperature_c, run.starts), statistics.rounding(run.temperature_c))
    end = _before_driven(run).stop
    rates, errors, falls_k = [], [], []
    for k in np.flatnonzero(there.any(axis=0)):
        shown_c, time_s = run.temperature_c[there[:, k], k], since_s[there[:, k]]
        rows = max(1, int(there[:end, k].sum()))
        low_c, at_s = _coldest(time_s, shown_c)
        falls_k.append(float(np.mean(shown_c[:rows])) - low_c - 2.0 * MOVES_K - at_s * MOST_K_PER_H / 3600.0)
        about_s = time_s[:rows] - time_s[:rows].mean()
        if rows > 2 and (square := float(about_s @ about_s)) > 0.0:
            rates.append(float(about_s @ shown_c[:rows]) / square)
            errors.append(float(noise[k]) * math.sqrt(FEWER / square))
    if falls_k and np.median(falls_k) > 0.0:
        return True
    most = SURELY * float(np.median(errors)) / math.sqrt(len(rates)) + MOST_K_PER_H / 3600.0 if rates else math.inf
    return bool(rates) and abs(float(np.median(rates))) > most


def _coldest(time_s: np.ndarray, shown_c: np.ndarray) -> tuple[float, float]:
    """Return the lowest mean of any FIRST_S of what a thermometer shows, degC, and when that was, s; without what is nonsense."""
    edges = np.searchsorted(time_s, np.arange(time_s[0], time_s[-1] + FIRST_S, FIRST_S))
    parts = [(begin, end) for begin, end in itertools.pairwise(edges) if end > begin]
    means = [statistics.trimmed_mean(shown_c[begin:end]) for begin, end in parts]
    least = int(np.argmin(means))
    return float(means[least]), float(np.mean(time_s[slice(*parts[least])]))


def coldest_c(run: Run) -> float:
    """Return the lowest that any thermometer of a run falls to, degC: its room is no warmer, heat only warms."""
    there = np.isfinite(run.temperature_c)
    return min(
        (
            _coldest(run.time_s[one], shown[one])[0]
            for one, shown in zip(there.T, run.temperature_c.T, strict=True)
            if one.any()
        ),
        default=math.inf,
    )


def begins_warm(run: Run) -> bool:
    """Return whether a run begins with a spring that was heated before, by its room, or by the coldest that its thermometers fall to."""
    room_c = coldest_c(run) if run.ambient_c is None else float(run.ambient_c[0])
    return not run.warm and bool(np.nanmax(run.temperature_c[0], initial=room_c) > room_c + BEGINS_WARM_K)


def rested(runs: Sequence[Run]) -> list[bool]:
    """Return which runs began at their room: thermometers together and still, no hotter than rooms are nor than they differ from the
    coldest such start.

    One such run alone may have begun as no other does: it did not where the others began warmer, and not together. A thermometer alone
    is together with itself however it was warmed, and so are all of an array that is seen to have been warmed: rooms of two days tell, not
    all that rooms can be.
    """
    still = [not run.warm and not moves(run) for run in runs]
    begins = [_begins_at(run) if one else (math.nan, math.inf) for run, one in zip(runs, still, strict=True)]
    cold = [first for first, apart in begins if apart <= TOGETHER_K]
    warmed = [coldest_c(run) for run, one in zip(runs, still, strict=True) if not one and not run.warm]
    apart_k = (4.0 if runs[0].springs > 1 and not warmed else 2.0) * ROOMS_K
    most = min(HOTTEST_C, min(cold + warmed, default=HOTTEST_C) + apart_k)
    found = [apart <= TOGETHER_K and first <= most for first, apart in begins]
    coldest = min((first for first, _ in begins if math.isfinite(first)), default=math.nan)
    one_of_others = len(runs) > 1 and any(
        cold and first <= coldest for cold, (first, _) in zip(found, begins, strict=True)
    )
    return found if sum(found) > 1 or one_of_others else [False] * len(runs)


def rests_alone(runs: Sequence[Run]) -> float | None:
    """Return where the springs of a run alone rest at first, degC; None where they do not, or there are other runs.

    They may have been warmed all alike, which others would show: it is as likely as that a room is so far from another day's, to ROOMS_K,
    and no bound.
    """
    if len(runs) != 1 or runs[0].warm or moves(runs[0]):
        return None
    first, apart = _begins_at(runs[0])
    return first if apart <= TOGETHER_K and first <= HOTTEST_C else None


def above_logged(run: Run) -> float | None:
    """Return by how much a run that begins at rest does so above the room that was logged, K; None where it does not, or none was.

    A spring that nothing has heated is as warm as what it loses heat to.
    """
    if run.ambient_c is None or run.warm or moves(run):
        return None
    first, apart = _begins_at(run)
    above = first - float(run.ambient_c[0])
    return above if apart <= TOGETHER_K and first <= HOTTEST_C and abs(above) <= 3.0 * ROOMS_K else None


def believed(runs: Sequence[Run]) -> list[tuple[float, float]]:
    """Return between which temperatures, degC, a fit may look for each run's room; infinite where nothing is known of it.

    A run that began warm was in a room as warm as those of the others were, and no warmer than its coldest thermometer fell to, by
    more than thermometers in one room differ.
    """
    began = list(zip(runs, map(first_c, runs), rested(runs), strict=True))
    rooms = [first for _, first, cold in began if cold]
    usual, off = (float(np.mean(rooms)), 3.0 * ROOMS_K) if rooms else (0.0, math.inf)
    about = [(first, 2.0 * MOVES_K, math.inf) if cold else (usual, off, coldest_c(run)) for run, first, cold in began]
    return [
        (middle - off, max(middle - off + MOVES_K, min(middle + off, most + TOGETHER_K))) for middle, off, most in about
    ]


def around_share(values: Mapping[str, float]) -> float | None:
    """Return the mean share of warm springs' warmth that was around them as runs began, by a fit's numbers; None where it has none."""
    each = [value for key, value in values.items() if key.partition("@")[0] == AROUND_SHARE]
    return float(np.mean(each)) if each else None


def over_first(runs: Sequence[Run], ambient_c: Sequence[float]) -> tuple[float, float] | None:
    """Return by how much rooms are warmer than what their runs begin at, K, and one sigma of that for another run; None where nothing
    says that runs began at rest."""
    parts = zip(runs, ambient_c, rested(runs), strict=True)
    over = np.array([room - first_c(run) for run, room, cold in parts if cold])
    if not over.size:
        return None
    mean = float(np.mean(over))
    # a run that begins warmer than its room was heated before: how long ago is its own
    apart = max(SAME_K, float(np.std(over, ddof=1)), -mean) if over.size > 1 else MOVES_K
    return mean, apart * math.sqrt(1.0 + 1.0 / over.size)


def without(off: np.ndarray, moves: np.ndarray, sigma_k: float, alike: float) -> np.ndarray:
    """Return errors of a prediction, K, less what its room explains, known to `sigma_k`; `moves` is what one kelvin of it changes.

    So many errors as are `alike` count as one.
    """
    shift = 0.0
    for _ in range(5):  # what is left says how much an error weighs
        weight = 1.0 / (alike * max(float(np.mean((off - shift * moves) ** 2)), 1e-12))
        shift = weight * float(moves @ off) / (weight * float(moves @ moves) + 1.0 / sigma_k**2)
    return off - shift * moves


def over_logged_k(values: Mapping[str, float], errors: Mapping[str, float]) -> float | None:
    """Return by how much what springs lose heat to is warmer than it was logged, K, as runs of a fit, by numbers and their standard errors,
    say of another; None where none does, or none that is more than its own error.

    What makes it so stays from run to run: where the room's thermometer is, heat that nobody logs. Thermometers that all read
    too much show the same. Before it is seen it is 0, to ROOMS_K: runs that disagree, or hardly tell, leave it there.
    """
    over, variance = 0.0, 0.0
    for own in (AMBIENT_OFFSET, SENSOR_OFFSET):
        each = {key: value for key, value in values.items() if key.partition("@")[0] == own}
        if not each:
            continue
        over += float(np.mean(list(each.values())))
        apart = float(np.var(list(each.values()), ddof=1)) if len(each) > 1 else 0.0
        unsure = float(np.mean([errors.get(key, 0.0) ** 2 for key in each]))
        variance += (apart + unsure) / len(each)
    return over * ROOMS_K**2 / (ROOMS_K**2 + variance) if over**2 > variance else None


def beside_log_k(run: Run, over_k: float, seen_s: float, settles_s: float) -> np.ndarray:
    """Return by how much what springs lose heat to is warmer than it was logged, (rows,), K, where it was `over_k` in runs of `seen_s`.

    In runs that are long beside the time in which the array settles with its room, that was seen to be the room. Of shorter ones it may
    be anything that lasted as long as they did, and that what has lasted so long goes on to a later time is as likely as `seen_s` is a part of it.
    """
    since_s = np.maximum(run.time_s - run.time_s[0], 1e-9)
    room = 1.0 - math.exp(-seen_s / settles_s)
    return over_k * (room + (1.0 - room) * np.minimum(1.0, seen_s / since_s))


def spread_k(ambient_c: Sequence[float]) -> float:
    """Return one sigma of another run's room about the mean of these, K: rooms of two days are ROOMS_K apart, until more of them say otherwise."""
    square = 0.5 * ROOMS_K**2 + float(np.sum((np.array(ambient_c) - np.mean(ambient_c)) ** 2))
    return math.sqrt(square * (1.0 + 1.0 / len(ambient_c)) / len(ambient_c))


def guessed(run: Run, usual_c: float, over: tuple[float, float] | None, spread_k: float = ROOMS_K) -> list[Guess]:
    """Return what is believed of a run's room before it moves.

    Rooms of other days say one thing. What other runs began like says another, if this one began so, too: it may have begun warm,
    and is then anywhere within WARM_K above its room. Where its thermometers are apart it did, but for the coldest, perhaps; where they
    move in its first minute it did.
    """
    warm = Guess(0.0, usual_c, spread_k)
    first, apart = _begins_at(run)
    if over is None or not math.isfinite(first) or moves(begun(run) or run):
        return [warm]
    here = first + over[0]
    both = warm.with_told(here, over[1] ** 2)
    likely = AS_OTHERS if apart <= TOGETHER_K else COLDEST_RESTED
    return [replace(both, nats=both.nats + math.log(likely)), replace(warm, nats=math.log((1.0 - likely) / WARM_K))]


def begun(run: Run) -> Run | None:
    """Return a run's first minute, None where it has nothing to tell a room by."""
    end = int(np.searchsorted(run.time_s - run.time_s[0], FIRST_S, side="right"))
    if len(run.starts) > 1:
        end = min(end, run.starts[1])
    if end < 5 or not np.isfinite(run.temperature_c[:end]).any():
        return None
    return run.part(slice(end))


Shows = Callable[[Run, float, np.ndarray], np.ndarray]
"""Simulates a run with a room, degC, and errors of its first readings, (springs,), K."""


def _by_first_minute(
    part: Run, room_c: float, other: Sequence[np.ndarray], trust: Sequence[float], shows: Shows, fades: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return how much of what numbers change, which makes of a first minute these `other` ones, its readings show, and the covariance.

    Least squares of these, believed to be 0 as firmly as `trust` says, of the drive's errors, which are believed to be small, and of those
    of the start: noise, and what a thermometer that lags hides of a spring that `fades` (1/s) towards its room.
    """
    noise = np.nan_to_num(statistics.noise_floor(part.temperature_c), nan=0.1)
    noise = np.maximum(np.maximum(noise, statistics.rounding(part.temperature_c)), 0.02)
    there, springs = np.isfinite(part.temperature_c), part.springs
    base = shows(part, room_c, np.zeros(springs))
    moved = [one - base for one in other]
    weaker = replace(part, drive=part.drive * (1.0 - DRIVE_OFF))  # a command is 1 at most
    moved.append((base - shows(weaker, room_c, np.zeros(springs))) / DRIVE_OFF)
    moved += [shows(part, room_c, one) - base for one in np.eye(springs)]
    start = np.hypot(noise, hidden_k(part, room_c, fades))
    weight = np.array([*trust, 1.0 / DRIVE_OFF, *(1.0 / start)])
    scale = noise * math.sqrt(FEWER)
    columns = np.column_stack([(one / scale)[there] for one in moved])
    left = ((part.temperature_c - base) / scale)[there]
    spread = np.linalg.inv(columns.T @ columns + np.diag(weight**2))
    return spread @ (columns.T @ left), spread


def around_of(run: Run, plant: native.Plant, room_c: float, sigma_k: float) -> float:
    """Return what part of its springs' warmth what is around them had as a run began warm, by its first minute and what is believed before
    it (the run's `around_share`), its room known to `sigma_k`: a spring beside what is cold loses more at first."""
    part, believed = begun(run), run.around_share
    hottest_c = float(np.nanmax(run.temperature_c[0], initial=room_c))
    if part is None or run.warm or hottest_c <= room_c + BEGINS_WARM_K or not any(map(plant.has, AROUND)):
        return believed
    shows = _shows(plant)
    far = 0.0 if believed > 0.5 else 1.0
    none = np.zeros(run.springs)
    other = [shows(replace(part, around_share=far), room_c, none), shows(part, room_c + 1.0, none)]
    trust = [abs(far - believed) / SHARE_OFF, 1.0 / sigma_k]
    off, _ = _by_first_minute(part, room_c, other, trust, shows, fades_per_s(plant))
    return float(np.clip(believed + off[0] * (far - believed), 0.0, 1.0))


def of_run(
    run: Run,
    guess: Sequence[Guess],
    shows: Shows,
    fades: float,
    misses_k: float = 0.0,
    unsure: Sequence[Shows] = (),
) -> tuple[float, float]:
    """Return how warm the room of a run is and one sigma of it, by its first minute, which tells rooms no better than to `misses_k`,
    and guesses before it.

    `shows` simulates a run with a room (degC) and errors of the first readings (springs,), K; so does each of `unsure`, a number of
    the model as far off as one sigma of it.
    """
    part, usual = begun(run), _moments(guess)
    if part is None:
        return usual
    value, sigma = usual
    for _ in range(2):  # what heats is not straight, but nearly
        none = np.zeros(run.springs)
        other = [shows(part, value + 1.0, none), *(one(part, value, none) for one in unsure)]
        # nothing is believed of the room: what the readings alone say
        off, spread = _by_first_minute(part, value, other, [1e-6, *[1.0] * len(unsure)], shows, fades)
        said = value + float(off[0])
        variance = (
            float(spread[0, 0]) + (LOSS_OFF * max(0.0, np.nanmax(part.temperature_c[0]) - usual[0])) ** 2 + misses_k**2
        )
        value, sigma = _moments([one.with_told(said, variance) for one in guess])
        # what is only heated does not begin colder than its room, which moves no further
        value = float(np.clip(value, -35.0, min(75.0, first_c(run) + 2.0 * MOVES_K)))
    return value, sigma


def _moments(parts: Sequence[Guess]) -> tuple[float, float]:
    most = max(one.nats for one in parts)
    weight = [math.exp(one.nats - most) for one in parts]
    middle = sum(w * one.room_c for w, one in zip(weight, parts, strict=True)) / sum(weight)
    square = sum(w * (one.sigma_k**2 + (one.room_c - middle) ** 2) for w, one in zip(weight, parts, strict=True)) / sum(
        weight
    )
    return middle, math.sqrt(square)


@dataclass(frozen=True)
class Rooms:
    """What the runs that a model was fitted to tell of another run's room."""

    usual_c: float
    spread_k: float = ROOMS_K
    """As `spread_k` has it."""
    over: tuple[float, float] | None = None
    """As `over_first` has it."""
    misses_k: float = 0.0
    """By how much their first minutes, as the model shows them, tell other rooms than all of them did, rms: a model is off by
    more than noise, and mostly so where a spring begins to warm."""
    errors: Mapping[str, float] = field(default_factory=dict)
    """Of the plant's parameters, as well as the fit knows them: what they may be off by must not count as a room's."""

    @staticmethod
    def of(
        runs: Sequence[Run], ambient_c: Sequence[float], plant: native.Plant, errors: Mapping[str, float] | None = None
    ) -> Rooms:
        """Return that for runs whose rooms were fitted, and the plant that was."""
        if not runs:
            return Rooms(plant.get("ambient_c"))
        usual = float(np.mean(ambient_c))
        unknown = [Guess(0.0, usual, ANYWHERE_K)]
        parts = zip(runs, ambient_c, strict=True)
        off = [_shown(run, plant, unknown)[0] - fitted for run, fitted in parts if begun(run) is not None]
        misses_k = statistics.rms([np.array(off)]) if off else 0.0
        return Rooms(usual, spread_k(ambient_c), over_first(runs, ambient_c), misses_k, errors or {})

    def told(self, run: Run, plant: native.Plant) -> tuple[float, float, float]:
        """Return how warm the room of a run is and one sigma of it, as a fitted plant shows its first minute, and how warm what is around
        springs that begin warm."""
        guess = guessed(run, self.usual_c, self.over, self.spread_k)
        unsure = _unsure(plant, self.errors)
        value, sigma = _shown(run, plant, guess, self.misses_k, unsure)
        if (share := around_of(run, plant, value, sigma)) != run.around_share:
            value, sigma = _shown(replace(run, around_share=share), plant, guess, self.misses_k, unsure)
        return value, sigma, share


def _unsure(plant: native.Plant, errors: Mapping[str, float]) -> list[native.Plant]:
    """Return plants in which one parameter each is off by its error; less, where no plant has more."""
    out = []
    for name, error in errors.items():
        for off in (error, -error):
            moved = plant.copy()
            with contextlib.suppress(native.NativeError):
                moved.set(name, plant.get(name) + off)
                if moved.check() is None:
                    out.append(moved)
                    break
    return out


def _shown(
    run: Run,
    plant: native.Plant,
    guess: Sequence[Guess],
    misses_k: float = 0.0,
    unsure: Sequence[native.Plant] = (),
) -> tuple[float, float]:
    return of_run(run, guess, _shows(plant), fades_per_s(plant), misses_k, [_shows(one) for one in unsure])


def _shows(plant: native.Plant) -> Shows:
    def shows(part: Run, room_c: float, offset: np.ndarray) -> np.ndarray:
        return simulate_run(plant.copy(), part, np.full(len(part.time_s), room_c), offset)

    return shows
