"""The fan at half its command gives another part than half of its cooling."""

from collections.abc import Iterator

from .effect import Candidate, Effect, Numbers, Scene, linear, sized

NAME = "fan_half_share"


def _candidates(scene: Scene) -> Iterator[Candidate]:
    if scene.fan_between:
        yield Candidate(
            "",
            (linear(NAME, 0.1, 0.9, 0.735, 0.05),),
            ({NAME: 0.735},),
            signed=True,
            neutral=0.5,
        )


def _says(numbers: Numbers, variant: str) -> str:
    return f"At half its command the fan gives {sized(*numbers[NAME], '%', 100.0)} of what it adds at full."


EFFECT = Effect("fan_curve", _candidates, says=_says)
