"""Behind each spring a holder of its own - crimp, terminal, heat sink, patch of a board - warms up, and warms it in turn.

A holder that loses heat itself shows as nothing else: coupling g, heat capacity C and loss l are in every reading g^2 / (g + l),
C (g / (g + l))^2 and 0, with g l / (g + l) more loss of the spring's own. So it has two numbers, and what it loses is the spring's.
"""

from collections.abc import Iterator

from .effect import Candidate, Effect, Scene, positive, says

HEAT, COUPLING = "holder_heat_capacity_j_per_k", "holder_coupling_w_per_k"


def _candidates(scene: Scene) -> Iterator[Candidate]:
    # of a spring alone it is its plate, which the chip has
    if scene.springs < 2:
        return
    own, loss = scene.declared("heat_capacity_j_per_k"), scene.declared("loss_w_per_k")
    # One that holds less than a tenth of its spring, or follows it at once, is part of it: its bounds end there.
    heat, coupling = positive(HEAT, 0.1 * own, 1e3 * own, own), positive(COUPLING, 0.01 * loss, 20.0 * loss, loss)
    yield Candidate(
        "",
        (heat, coupling),
        ({HEAT: 2.0 * own, COUPLING: 0.5 * loss}, {HEAT: 0.5 * own, COUPLING: loss}),
        more_starts=({HEAT: 2.0 * own, COUPLING: loss},),
        flexible=True,  # a temperature for each spring that nobody sees: what one for all of them explains is that
    )


EFFECT = Effect(
    "holder_mass", _candidates, says=says("Behind each spring a holder warms up: {} to it.", COUPLING, "mW/K", 1e3)
)
