"""The phase change takes up heat on the way up and gives it back on the way down."""

from collections.abc import Iterator

from . import alloy
from .effect import Candidate, Effect, Numbers, Scene, Steady, linear, one_number, sized

NAME = "latent_heat_j"


def _candidates(scene: Scene) -> Iterator[Candidate]:
    if scene.transforms:
        yield one_number(linear(NAME, 0.0, 200.0, 5.0, 5.0), 5.0, most=6.0)
    if places := alloy.places(scene):
        size = 16.0 * scene.declared("heat_capacity_j_per_k")  # as the paper's spring has it
        yield Candidate(
            alloy.VARIANT,
            (linear(NAME, 0.0, 200.0, size, size), *alloy.numbers(scene)),
            tuple({NAME: size} | place for place in places),
            most=6.0,
            alternatives=True,
        )


def _says(numbers: Numbers, variant: str) -> str:
    said = f"The transformation takes up {sized(*numbers[NAME], 'J')}"
    if alloy.SHIFT in numbers:
        said += f", and lies {sized(*numbers[alloy.SHIFT], 'K')} from where it is declared"
    return said + "."


EFFECT = Effect("latent_heat", _candidates, Steady(NAME, 0.0, 20.0), says=_says)
