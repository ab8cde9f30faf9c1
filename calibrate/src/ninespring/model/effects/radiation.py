"""Heat radiates away with the fourth power of temperature."""

from collections.abc import Iterator

from .effect import Candidate, Effect, Scene, Steady, linear, one_number, says


def _candidates(scene: Scene) -> Iterator[Candidate]:
    yield one_number(linear("emissivity", 0.0, 1.0, 0.4, 0.3), 0.6, most=1.7)


EFFECT = Effect(
    "radiation",
    _candidates,
    Steady("emissivity", 0.0, 1.0, against="it only adds loss: the undriven spring would be colder, not warmer"),
    says=says("Heat radiates away: emissivity {}.", "emissivity"),
)
