"""The springs heat a common plate, which is slow and heats them in turn; what a spring alone is mounted on is its plate."""

from collections.abc import Iterator

from .effect import Candidate, Effect, Numbers, Scene, Steady, positive, says

COUPLING, ALONE = "plate_coupling_w_per_k", "of a spring alone"
ALONE_IN_WORDS = "what the spring is mounted on warms up"


def _candidates(scene: Scene) -> Iterator[Candidate]:
    own_loss = scene.declared("loss_w_per_k")
    # A plate that answers faster than a spring's tenth is in balance with them: its bounds end there.
    least = 0.1 * scene.springs * scene.declared("heat_capacity_j_per_k")
    coupling, heat, away = COUPLING, "plate_heat_capacity_j_per_k", "plate_loss_w_per_k"
    yield Candidate(
        "" if scene.springs > 1 else ALONE,
        (
            positive(coupling, 1e-6, 20.0 * own_loss, 1e-3),
            positive(heat, least, 5000.0, 8.0),
            positive(away, 1e-5, 50.0 * scene.springs * own_loss, 0.02),
        ),
        ({coupling: 1e-3, heat: 6.0, away: 0.01}, {coupling: 1e-3, heat: 40.0, away: 0.02}),
        more_starts=({coupling: 1e-3, heat: 1.0 * scene.springs, away: 3e-3},),
        slow_node=True,
    )


def _says(numbers: Numbers, variant: str) -> str:
    words = "Behind the spring a plate or a holder warms up" if variant == ALONE else "The springs share a plate"
    each = "from it" if variant == ALONE else "from each to it"
    return says(f"{words}: {{}} {each}.", COUPLING, "mW/K", 1e3)(numbers, variant)


EFFECT = Effect(
    "plate_conduction",
    _candidates,
    Steady(COUPLING, 0.0, 0.05, {"plate_loss_w_per_k": 0.01}),
    says=_says,
)
