"""A camera's pixel also sees the neighbours of its spring."""

from collections.abc import Iterator

from .effect import Candidate, Effect, Numbers, Scene, Steady, linear, sized

BEYOND = "neighbours, and the surroundings beyond the array"


def _candidates(scene: Scene) -> Iterator[Candidate]:
    if scene.springs < 2:
        return
    side, corner = "optical_orthogonal", "optical_diagonal"
    free = [linear(side, 0.0, 0.2, 0.02, 0.02)]
    probes = [{side: 0.02, corner: 0.0}]
    if scene.plane:
        free.append(linear(corner, 0.0, 0.05, 0.005, 0.01))
        probes.append({side: 0.0, corner: 0.01})
    still = () if scene.plane else ((corner, 0.0),)
    for variant, beyond in (("neighbours", 0.0), (BEYOND, 1.0)):
        yield Candidate(
            variant,
            tuple(free),
            tuple({f.key: one[f.key] for f in free} for one in probes),
            most=6.0,
            fixed=(*still, ("optical_beyond", beyond)),
        )


def _says(numbers: Numbers, variant: str) -> str:
    beyond = ", and as much of the surroundings beyond the array" if variant == BEYOND else ""
    share = sized(*numbers["optical_orthogonal"], "%", 100.0)
    return f"The camera sees {share} of each neighbour in a spring's place{beyond}."


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
