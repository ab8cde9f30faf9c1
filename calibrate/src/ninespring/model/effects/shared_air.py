"""The air between the springs warms up and reaches all of them."""

from collections.abc import Iterator

from .effect import Candidate, Effect, Scene, Steady, positive, says


def _candidates(scene: Scene) -> Iterator[Candidate]:
    if scene.springs < 2:
        return
    loss = scene.springs * scene.declared("loss_w_per_k")
    # Air that answers faster than a spring's tenth is in balance with them: its bounds end there.
    least = 0.1 * scene.springs * scene.declared("heat_capacity_j_per_k")
    capacity, exchange = "air_heat_capacity_j_per_k", "air_exchange_w_per_k"
    yield Candidate(
        "",
        (positive(capacity, least, 3000.0, 3.0), positive(exchange, 0.01 * loss, 50.0 * loss, 2 * loss)),
        ({capacity: 3.0, exchange: 3.0 * loss}, {capacity: 20.0, exchange: 3.0 * loss}),
        more_starts=({capacity: 0.5 * scene.springs, exchange: 2.0 * loss},),
        slow_node=True,
    )


EFFECT = Effect(
    "shared_air",
    _candidates,
    Steady(
        "air_exchange_w_per_k",
        0.005,
        10.0,
        against="a fan flushes the air between the springs, yet the error is as large with the fan as without",
    ),
    says=says("The air between the springs warms: {} to the room.", "air_exchange_w_per_k", "mW/K", 1e3),
)
