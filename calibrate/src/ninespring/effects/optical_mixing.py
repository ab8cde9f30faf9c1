"""A camera's pixel also sees other springs, what lies between them and the room beyond the edge: a point-spread."""

from collections.abc import Iterator
from dataclasses import replace

from .effect import Candidate, Effect, Numbers, Scene, Steady, linear, positive, sized

SHARE, WIDTH, SHAPE, BEYOND = "optical_share", "optical_width", "optical_shape", "optical_beyond"
WIDTHS = (0.5, 0.9, 1.5)
"""Pitches, to begin at: the nearest neighbours alone, as a lens a little out of focus, all of a 3 x 3 array."""


def _candidates(scene: Scene) -> Iterator[Candidate]:
    if scene.springs < 2:
        return
    free = (
        linear(SHARE, 0.0, 0.97, 0.2, 0.05),
        # one half to twice what it begins at, as soon as anything says otherwise: a small blur says little of its form
        replace(positive(WIDTH, 0.1, 4.0, 0.8), prior=0.7),
        replace(positive(SHAPE, 0.5, 12.0, 2.0), prior=0.7),
        replace(linear(BEYOND, 0.0, 1.0, 0.9, 0.2), ends=True),
    )
    yield Candidate(
        "",
        free,
        tuple({SHARE: 0.2, WIDTH: width, SHAPE: 2.0, BEYOND: seen} for seen in (1.0, 0.0) for width in WIDTHS),
        most=4.5,
        alternatives=True,
    )


def _says(numbers: Numbers, variant: str) -> str:
    share, width = sized(*numbers[SHARE], "%", 100.0), sized(*numbers[WIDTH])
    beyond = numbers[BEYOND][0]
    room = ", of the room beyond the array too" if beyond > 0.5 else ""
    return f"Of what the camera shows as a spring, {share} is its surroundings'{room}: it blurs over {width} pitches."


EFFECT = Effect(
    "optical_mixing",
    _candidates,
    Steady(
        SHARE,
        0.0,
        0.9,
        against="Perspex is opaque from 8 to 14 um: the camera sees the plate's surface, which itself blurs the springs; "
        "a share per neighbour would also fall with the pitch",
    ),
    says=_says,
)
