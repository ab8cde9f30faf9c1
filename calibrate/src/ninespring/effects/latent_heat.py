"""The phase change takes up heat on the way up and gives it back on the way down."""

from collections.abc import Iterator

from .effect import Candidate, Effect, Scene, Steady, linear


def _candidates(scene: Scene) -> Iterator[Candidate]:
    if scene.transforms:
        yield Candidate("", (linear("latent_heat_j", 0.0, 200.0, 5.0, 5.0),), ({"latent_heat_j": 5.0},), most=6.0)


EFFECT = Effect("latent_heat", _candidates, Steady("latent_heat_j", 0.0, 20.0))
