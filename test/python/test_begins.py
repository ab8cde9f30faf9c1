"""How a run began, as far as nobody logged it: what is around springs that were hot."""

from __future__ import annotations

import numpy as np
import pytest
from ninespring.infer import predict as prediction
from ninespring.io.logs.run import Run
from ninespring.model import native
from ninespring.model.models import Array, Model

ROWS, ROOM_C, HELD_W = 900, 20.0, 0.35


def cooling(effects: dict[str, dict[str, float]]) -> tuple[Model, Run]:
    """Return two springs that were held hot for long and cool as their log begins, one of them driven again later."""
    model = Model(Array(1, 2))
    model.effects = list(effects)
    model.parameters = {name: one for each in effects.values() for name, one in each.items()} | {"ambient_c": ROOM_C}
    plant = prediction.plant_of(model)
    plant.reset()
    for k in range(2):
        plant.drive(k, native.POWER, HELD_W)
    plant.settle(1e6)
    drive = np.zeros((ROWS, 2))
    drive[400:700, 0] = HELD_W
    time_s = np.arange(float(len(drive)))
    shown = plant.simulate(time_s, native.POWER, drive, np.zeros(len(drive)), np.full(len(drive), ROOM_C))
    return model, Run("run", "", time_s, "power", drive, shown, np.zeros(ROWS), np.full(ROWS, ROOM_C))


@pytest.mark.parametrize(
    "around",
    [
        {"shared_air": {"air_heat_capacity_j_per_k": 40.0, "air_exchange_w_per_k": 0.02}},
        {
            "plate_conduction": {
                "plate_coupling_w_per_k": 0.004,
                "plate_heat_capacity_j_per_k": 40.0,
                "plate_loss_w_per_k": 0.02,
            }
        },
    ],
    ids=["air", "plate"],
)
def test_what_is_around_springs_that_begin_hot_is_warm(around: dict[str, dict[str, float]]) -> None:
    model, run = cooling(around)
    assert np.abs(run.temperature_c - prediction.predict(model, run)).max() < 0.05
    # with no heat around them at first they would be colder for minutes
    plant = prediction.plant_of(model)
    plant.reset()
    plant.start_from_measured(run.temperature_c[0])
    bare = plant.simulate(run.time_s, native.POWER, run.drive, run.fan, run.ambient_c)
    assert np.abs(run.temperature_c - bare).max() > 1.5


def test_a_box_that_loses_next_to_nothing_is_as_warm_as_it_would_be_after_days() -> None:
    """A fit may take it for one: it is in balance with nothing in twelve days, and simulated all the same."""
    kept = {"air_heat_capacity_j_per_k": 1e4, "air_exchange_w_per_k": 1e-4}
    model, run = cooling({"shared_air": kept | {"air_exchange_w_per_k": 1.0}})
    model.parameters |= kept
    assert np.isfinite(prediction.predict(model, run)).all()
