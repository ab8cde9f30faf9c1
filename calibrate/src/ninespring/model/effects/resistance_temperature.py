"""Resistance rises with temperature within each phase: shown by v / i, and by the heat of a given current."""

from collections.abc import Iterator

from ..spec import Free
from .effect import Candidate, Effect, Numbers, Scene, one_number, sized

NAMES = ("resistance_martensite_rise_per_k", "resistance_austenite_rise_per_k")


def _candidates(scene: Scene) -> Iterator[Candidate]:
    if "current" in scene.modes or scene.reads_ohm:
        number = Free("resistance_rise_per_k", 0.001, -0.003, 0.005, "1/K", NAMES, False, scale=0.001)
        yield one_number(number, 0.001, "both phases alike", signed=True, most=4.0)


def _says(numbers: Numbers, variant: str) -> str:
    sizes = [sized(*number, unit="%", factor=100.0) for number in numbers.values()]
    if len(sizes) == 1:
        return f"Resistance rises by {sizes[0]} per K."
    return f"Per kelvin resistance rises by {sizes[0]} as martensite, by {sizes[1]} as austenite."


EFFECT = Effect("resistance_temperature", _candidates, says=_says)
