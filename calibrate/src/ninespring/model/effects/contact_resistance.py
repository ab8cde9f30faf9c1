"""A contact in series with a spring takes part of its voltage: shown by v / i alone (find/resistance.py)."""

from collections.abc import Iterator

from .effect import Candidate, Effect, Numbers, Scene, sized


def _candidates(scene: Scene) -> Iterator[Candidate]:
    yield from ()


def _says(numbers: Numbers, variant: str) -> str:
    (value, error), *_ = numbers.values()
    return f"A contact of {variant}: {sized(value, error, 'mohm', 1e3)}."


EFFECT = Effect("contact_resistance", _candidates, says=_says)
