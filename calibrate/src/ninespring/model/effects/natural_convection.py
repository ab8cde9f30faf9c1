"""Still air carries more heat away the hotter a spring is."""

from collections.abc import Iterator

from .effect import Candidate, Effect, Scene, Steady, linear, one_number, says


def _candidates(scene: Scene) -> Iterator[Candidate]:
    yield one_number(linear("convection_exponent", 0.0, 0.6, 0.2, 0.2), 0.2)


EFFECT = Effect(
    "natural_convection",
    _candidates,
    Steady(
        "convection_exponent",
        0.0,
        1.0,
        against="with the fan on the loss is forced and depends little on temperature, yet the error is as large",
    ),
    says=says("In still air the loss rises with the temperature, to the power of {}.", "convection_exponent"),
)
