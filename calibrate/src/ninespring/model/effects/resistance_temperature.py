"""Resistance rises with temperature within each phase: shown by v / i, and by the heat of a given current."""

from collections.abc import Iterator

from ..spec import Free
from .effect import Candidate, Effect, Numbers, Scene, sized

NAMES = ("resistance_martensite_rise_per_k", "resistance_austenite_rise_per_k")


def _candidates(scene: Scene) -> Iterator[Candidate]:
    if "current" in scene.modes or scene.reads_ohm:
        key = "resistance_rise_per_k"
        yield Candidate(
            "both phases alike",
            (Free(key, 0.001, -0.003, 0.005, "1/K", NAMES, False, scale=0.001),),
            ({key: 0.001},),
            signed=True,
            most=4.0,
        )


def _says(numbers: Numbers, variant: str) -> str:
    sizes = [f"{sized(*number, factor=100.0)} %" for number in numbers.values()]
    return f"Resistance rises by {' and '.join(sizes)} per K."


EFFECT = Effect("resistance_temperature", _candidates, says=_says)
