"""Whether new settings drive an array worse than the old ones: both are tried on the array as it is best known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..errors import WorkError
from ..io import results
from ..model import native
from ..model.models import Model
from .settings import Settings, best_plant, draw, settings_of

DRAWS = 4
"""Further arrays, drawn from the uncertainty of the model's numbers. Which spring is heated before which is chaotic, by seconds:
by chance alone all of five get slower once in 32 times."""
TRANSFORMED = 0.9
"""Austenite from which a spring counts as heated."""
ENOUGH_K = 12.0
"""Above its austenite finish, what a spring may reach without being called hotter: the margin that the chip keeps above its
own target while it is unsure (`unsure_margin_k`)."""
SAFE_C = 120.0
"""What no spring may pass (docs/safety.md), whatever it holds by that."""


@dataclass(frozen=True)
class Measure:
    """What can be worse about a drive: by how much it must differ, and how it is said."""

    limit: float
    words: str
    part: float = 0.0
    """Of what it was: less is no difference either."""
    chance: bool = False
    """One array says nothing of it: worse is what is so on every one."""


WORSE: dict[results.Measure, Measure] = {
    "held": Measure(
        0.03, "springs that are on hold {old:.0%} austenite as the chip is now, {new:.0%} with the new settings"
    ),
    "heating_s": Measure(
        5.0, "heating takes {old:.0f} s as the chip is now, {new:.0f} s with the new settings", part=0.1, chance=True
    ),
    "hottest_c": Measure(
        3.0, "the hottest spring reaches {old:.0f} degC as the chip is now, {new:.0f} with the new settings"
    ),
    "undriven": Measure(
        0.03, "springs that are off reach {old:.0%} austenite as the chip is now, {new:.0%} with the new settings"
    ),
}
"""What is compared, by the least that counts: `held` and `undriven` three hundredths of a stroke, the noise of a hold;
`heating_s` 5 s and a tenth of the heating; `hottest_c` 3 K, a tenth of the way to the limit."""


@dataclass
class Drive:
    """How a pattern was driven."""

    held: float
    """Mean austenite of the driven springs over the second half of the time that they are on."""
    heating_s: float
    """Until the last driven spring has transformed; all the time where one never does."""
    hottest_c: float
    enough_c: float
    """What a spring that is heated through may reach."""
    undriven: float
    """Highest austenite of a spring that is off."""
    done: float
    """Mean austenite of the driven springs over all the time that they are on."""

    @staticmethod
    def phases(austenite: np.ndarray, pattern: np.ndarray, since_s: np.ndarray, never_s: float) -> dict[str, float]:
        """Return what austenite, (rows, springs), says of a pattern's drive: it is on in the rows with a time `since_s`, the last."""
        on, off = austenite[-len(since_s) :, pattern], austenite[:, ~pattern]
        heated = np.minimum.reduce(on, axis=1) >= TRANSFORMED
        return {
            "held": float(on[len(on) // 2 :].mean()),
            "heating_s": float(since_s[np.argmax(heated)]) if heated.any() else never_s,
            "undriven": float(off.max()) if off.size else 0.0,
            "done": float(on.mean()),
        }


def patterns(springs: int) -> list[np.ndarray]:
    """Return what is tried: all but the middle one, and the first alone."""
    everyone = np.ones(springs, dtype=bool)
    if springs == 1:
        return [everyone]
    middle = everyone.copy()
    middle[springs // 2] = False
    return [middle, np.arange(springs) == 0]


def drive(plant: native.Plant, lines: str, pattern: np.ndarray) -> Drive:
    """Drive a plant from cold with settings; the longer the slower its springs are."""
    slowest = plant.get("heat_capacity_j_per_k") / max(1e-4, plant.get("loss_w_per_k"))
    on = int(np.clip(5.0 * slowest, 200.0, 1800.0))
    plant = plant.copy()
    plant.reset()
    temperature, austenite = native.chip_drive(plant, lines, list(pattern), on, on)
    return Drive(
        hottest_c=float(temperature.max()),
        enough_c=plant.get("austenite_finish_c") + ENOUGH_K,
        **Drive.phases(austenite, pattern, np.arange(float(on)), float(on)),
    )


def worse_than(old: Drive, new: Drive) -> list[results.Measure]:
    """Return the measures in which one drive is worse than another.

    A spring that is heated further takes longer and gets hotter: that is no fault of settings that hold more of it, and heating
    later none of those with which the springs do no less in all. Nor is it one to heat a spring through that was not quite; but
    nothing excuses what passes SAFE_C.
    """
    out = []
    excused = {
        "hottest_c": new.held - old.held > WORSE["held"].limit and new.hottest_c <= SAFE_C,
        "heating_s": new.done >= old.done,
    }
    for measure, one in WORSE.items():
        a, b = getattr(old, measure), getattr(new, measure)
        if measure == "hottest_c":
            a = max(a, old.enough_c)
        more = a - b if measure == "held" else b - a
        if more > max(one.limit, one.part * a) and not excused.get(measure):
            out.append(measure)
    return out


def compare(
    model: Model, old: str, new: str, say: Callable[[str], None] = lambda text: None
) -> tuple[list[str], list[results.Drive]]:
    """Return what gets worse with the new settings, in words, and every measure of every drive.

    Tried on the array as it is best known, and on others drawn from the model's uncertainty; worse is what is worse on
    the first, or on most of all of them; what is by chance on one, on every one.
    """
    rng = np.random.default_rng(0)
    plants = [best_plant(model), *(best_plant(model, draw(model, rng)) for _ in range(DRAWS))]
    said: list[str] = []
    gained: list[str] = []
    rows = []
    for pattern in patterns(model.array.springs):
        pairs = []
        for k, plant in enumerate(plants):
            say(f"driving array {k + 1} of {len(plants)}")
            pairs.append((drive(plant, old, pattern), drive(plant, new, pattern)))
        judged = [worse_than(a, b) for a, b in pairs]
        for measure, one in WORSE.items():
            values = [(getattr(a, measure), getattr(b, measure)) for a, b in pairs]
            worse = [measure in found for found in judged]
            rows += [results.Drive(array=k + 1, measure=measure, old=a, new=b) for k, (a, b) in enumerate(values)]
            if all(worse) or (not one.chance and (worse[0] or sum(worse) > len(worse) / 2)):
                a, b = values[0] if worse[0] else values[worse.index(True)]
                said.append(one.words.format(old=a, new=b))
        best = pairs[0]
        if said and "undriven" in worse_than(best[1], best[0]):
            # a pattern that this array cannot hold without heating the springs that are off
            words = WORSE["undriven"].words.format(old=best[0].undriven, new=best[1].undriven)
            gained.append(f"for it {words}: that pattern cannot have both here")
    return list(dict.fromkeys([*said, *gained])), rows


def checked_settings(
    model: Model, old: str, force: bool = False, say: Callable[..., None] = lambda text, done=None: None
) -> tuple[Settings, list[str], list[results.Drive]]:
    """Return a model's settings, in what they drive worse than the lines `old`, and both drives; WorkError where they should not be used."""
    if (doubts := model.provenance.get("doubts", [])) and not force:
        raise WorkError(
            f"the log of this model is doubted, nothing is written: {'; '.join(doubts)} (--force writes it all the same)"
        )
    made = settings_of(model)
    worse, drives = compare(model, old, f"{old}\n{made.lines}", say)
    if worse and not force:
        raise WorkError(
            f"these settings would drive worse, nothing is written: {'; '.join(worse)} (--force writes them all the same)"
        )
    return made, worse, drives
