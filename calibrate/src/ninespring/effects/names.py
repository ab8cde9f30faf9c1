"""Sentences of the effects, and where each acts: until the table of effects is read from the native module."""

from __future__ import annotations

ON_CHIP = frozenset(
    (
        "radiation",
        "natural_convection",
        "latent_heat",
        "resistance_phase",
        "shared_air",
        "plate_conduction",
        "fan_wake",
        "edge_loss",
        "spring_mismatch",
    )
)
MEASUREMENT = frozenset(("ambient_drift", "sensor_lag", "sensor_gain", "optical_mixing"))
WHY_NOT_ON_CHIP = {
    "ambient_drift": "the surroundings of this run, not the array: the chip takes ambient as an input",
    "sensor_lag": "belongs to the thermometer, not to the array: the chip must not be corrected with it",
    "sensor_gain": "belongs to the thermometer, not to the array: the chip must not be corrected with it",
    "optical_mixing": "belongs to the camera, not to the array: the chip must not be corrected with it",
    "supply_sag": "the chip measures voltage and current of each spring: it sees the real power",
}
IN_WORDS = {
    "radiation": "heat radiates away, more than in proportion",
    "natural_convection": "still air carries more heat away the hotter a spring is",
    "latent_heat": "the phase change takes up and gives back heat",
    "resistance_phase": "the resistance, and with it the heat, depends on the phase",
    "shared_air": "the air between the springs warms up",
    "plate_conduction": "the springs heat a common plate",
    "fan_wake": "the fan's air carries heat from one spring to the next",
    "edge_loss": "outer springs lose more heat",
    "spring_mismatch": "one spring differs from the others",
    "supply_sag": "the supply gives less while other springs draw",
    "ambient_drift": "the surroundings change during the run",
    "sensor_lag": "the thermometers follow late",
    "sensor_gain": "the thermometers read in a wrong proportion or with an offset",
    "optical_mixing": "the camera's pixels also see neighbours or a background",
}
