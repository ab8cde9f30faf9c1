"""Resistance, and with it the heat of a given current, depends on the phase."""

from collections.abc import Iterator

from . import alloy
from .effect import Candidate, Effect, Numbers, Scene, Steady, linear, one_number, sized


def _candidates(scene: Scene) -> Iterator[Candidate]:
    if "current" not in scene.modes:
        return
    name, martensite = "resistance_austenite_ohm", scene.declared("resistance_martensite_ohm")
    number = linear(name, 0.5 * martensite, 2.0 * martensite, 1.2 * martensite, 0.2 * martensite)
    if scene.transforms:
        starts = {name: 0.85 * martensite}, {name: 1.25 * martensite}
        yield one_number(number, 1.15 * martensite, signed=True, neutral=martensite, more_starts=starts)
    if places := alloy.places(scene):
        yield Candidate(
            alloy.VARIANT,
            (number, *alloy.numbers(scene)),
            tuple({name: 1.15 * martensite} | place for place in places),
            signed=True,
            neutral=martensite,
            alternatives=True,
        )


def _says(numbers: Numbers, variant: str) -> str:
    said = f"Austenite has {sized(*numbers['resistance_austenite_ohm'], 'ohm')}"
    if alloy.SHIFT in numbers:
        said += f", and the transformation lies {sized(*numbers[alloy.SHIFT], 'K')} from where it is declared"
    return said + "."


EFFECT = Effect("resistance_phase", _candidates, Steady("resistance_austenite_ohm", 0.1, 0.4), says=_says)
