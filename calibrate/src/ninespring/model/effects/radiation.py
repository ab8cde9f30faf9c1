"""Heat radiates away with the fourth power of temperature."""

from collections.abc import Iterator

from .effect import Candidate, Effect, Scene, Steady, linear, says


def _candidates(scene: Scene) -> Iterator[Candidate]:
    yield Candidate("", (linear("emissivity", 0.0, 1.0, 0.4, 0.3),), ({"emissivity": 0.6},), most=1.7)


EFFECT = Effect(
    "radiation",
    _candidates,
    Steady("emissivity", 0.0, 1.0, against="it only adds loss: the undriven spring would be colder, not warmer"),
    says=says("Heat radiates away: emissivity {}.", "emissivity"),
)
