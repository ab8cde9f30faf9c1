"""A camera's pixel also sees other springs, what lies between them and the room beyond the edge: a point-spread."""

from collections.abc import Iterator
from dataclasses import replace

from .effect import Candidate, Effect, Numbers, Scene, Steady, linear, one_number, positive, sized

SHARE, WIDTH, SHAPE, BEYOND = "optical_share", "optical_width", "optical_shape", "optical_beyond"
WITH_ROOM = "neighbours, and the surroundings beyond the array"
WIDTHS = (0.5, 0.9, 1.5)
"""Pitches, to begin at: the nearest neighbours alone, as a lens a little out of focus, all of a 3 x 3 array."""
NEAREST = 0.1
"""So narrow a spread is the nearest neighbours' alone."""


def _candidates(scene: Scene) -> Iterator[Candidate]:
    if scene.springs < 2 or not scene.camera:
        return
    # springs at one distance tell a share, at two its width, at more its shape
    distances = len({row**2 + col**2 for row in range(scene.rows) for col in range(scene.cols)} - {0})
    if distances == 1:
        for variant, beyond in (("neighbours", 0.0), (WITH_ROOM, 1.0)):
            fixed = (WIDTH, NEAREST), (BEYOND, beyond)
            yield one_number(linear(SHARE, 0.0, 0.8, 0.08, 0.08), 0.08, variant, most=6.0, fixed=fixed)
        return
    spread = (
        # one half to twice what it begins at, as soon as anything says otherwise: a small blur says little of its form
        replace(positive(WIDTH, 0.1, 4.0, 0.8), prior=0.7),
        replace(positive(SHAPE, 0.5, 12.0, 2.0), prior=0.7),
    )[: distances - 1]
    begin = {SHARE: 0.2} | {one.key: one.start for one in spread}
    yield Candidate(
        "",
        (linear(SHARE, 0.0, 0.97, 0.2, 0.05), *spread, replace(linear(BEYOND, 0.0, 1.0, 0.9, 0.2), ends=True)),
        tuple({**begin, WIDTH: width, BEYOND: seen} for seen in (1.0, 0.0) for width in WIDTHS),
        most=4.5,
        alternatives=True,
    )


def _says(numbers: Numbers, variant: str) -> str:
    beyond = variant == WITH_ROOM if variant else numbers[BEYOND][0] > 0.5
    room = ", of the room beyond the array too" if beyond else ""
    blurs = "" if variant else f": it blurs over {sized(*numbers[WIDTH])} pitches"
    return (
        f"Of what the camera shows as a spring, {sized(*numbers[SHARE], '%', 100.0)} is its surroundings'{room}{blurs}."
    )


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
