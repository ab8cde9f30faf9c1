"""A camera's pixel also sees the neighbours of its spring."""

from collections.abc import Iterator

from .effect import Candidate, Effect, Numbers, Scene, Steady, linear, sized


def _candidates(scene: Scene) -> Iterator[Candidate]:
    if scene.springs < 2:
        return
    side, corner = "optical_orthogonal", "optical_diagonal"
    free = [linear(side, 0.0, 0.2, 0.02, 0.02)]
    probes = [{side: 0.02, corner: 0.0}]
    if scene.plane:
        free.append(linear(corner, 0.0, 0.05, 0.005, 0.01))
        probes.append({side: 0.0, corner: 0.01})
    yield Candidate(
        "neighbours",
        tuple(free),
        tuple({f.key: one[f.key] for f in free} for one in probes),
        most=6.0,
        fixed=() if scene.plane else ((corner, 0.0),),
    )


def _says(numbers: Numbers, variant: str) -> str:
    return f"The camera sees {sized(*numbers['optical_orthogonal'], '%', 100.0)} of each neighbour in a spring's place."


EFFECT = Effect(
    "optical_mixing",
    _candidates,
    Steady(
        "optical_orthogonal",
        0.0,
        0.2,
        follows={"optical_diagonal": 0.25},  # as the plant's defaults have it
        against="Perspex is opaque from 8 to 14 um: the camera sees the plate's surface, which itself blurs the springs; "
        "a share per neighbour would also fall with the pitch",
    ),
    says=_says,
)
