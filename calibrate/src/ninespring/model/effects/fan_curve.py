"""The fan at half its command gives another part than half of its cooling."""

from collections.abc import Iterator

from .effect import Candidate, Effect, Scene, linear, one_number, says

NAME = "fan_half_share"


def _candidates(scene: Scene) -> Iterator[Candidate]:
    if scene.fan_between:
        yield one_number(linear(NAME, 0.1, 0.9, 0.735, 0.05), 0.735, signed=True, neutral=0.5)


EFFECT = Effect(
    "fan_curve",
    _candidates,
    says=says("At half its command the fan gives {} of what it adds at full.", NAME, "%", 100.0),
)
