"""The paper's six COMSOL temperatures from geometry alone, beside today's fit and the camera. Nothing here is fitted.

    .venv/bin/python bench/explore/paper.py [--mesh fine] [--json FILE]

Eight springs at COMSOL's 105 degC (the camera's were at 99), the centre undriven, steady: the full field, not the network.
A 4 mm pitch overlaps coils of 3.45 mm mean diameter (4.25 mm outside), so there are two readings: 3.45 mm is the OUTER
diameter (mean 2.65: exists at 4, 5, 6 mm), or the mean one (exists at 5 and 6 mm only).
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
from ninespring.errors import InputError
from ninespring.explore.couplings import fields_of, model_of, plant_of
from ninespring.explore.field import MESHES
from ninespring.explore.geometry import geometry_of
from ninespring.explore.lumped import lumped_of
from ninespring.explore.modes import Modes
from ninespring.model import native
from ninespring.model.models import Array

HOT_C, AMBIENT_C, CENTRE = 105.0, 20.0, 4
COMSOL = {(4, 0): 52, (4, 1): 42, (5, 0): 45, (5, 1): 35, (6, 0): 40, (6, 1): 31}
CAMERA = {(4, 0): 63, (4, 1): 55, (5, 0): 57, (5, 1): 50, (6, 0): 55, (6, 1): 49}
LARGER = (8, 16)
READINGS = {"outer 3.45": 2.65, "mean 3.45": 3.45}


def centre_c(modes: Modes) -> tuple[float, float]:
    """Return the centre's temperature (degC) where the other eight are held, and what holds a corner (W)."""
    response = modes.response()
    hot = [k for k in range(9) if k != CENTRE]
    power = np.linalg.solve(response[np.ix_(hot, hot)], np.full(8, HOT_C - AMBIENT_C))
    return AMBIENT_C + float(response[CENTRE, hot] @ power), float(power[0])


def fitted_c(pitch_mm: float, fan: int, size: int = 3) -> float:
    """Return what the paper's spacing law, fitted to these six, makes of it, or of more springs."""
    plant = native.Plant(size, size)
    native.paper_configure(plant, pitch_mm)
    return middle_c(plant, fan)


def middle_c(plant: native.Plant, fan: int) -> float:
    """Return the middle spring's steady temperature where all others are held."""
    middle = plant.rows // 2 * plant.cols + plant.cols // 2
    plant.set_fan(fan)
    for k in range(plant.springs):
        plant.drive(k, *((native.POWER, 0.0) if k == middle else (native.TEMPERATURE, HOT_C)))
    plant.settle()
    return float(plant.temperature_c()[middle])


def main() -> None:
    """Reckon, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mesh", choices=MESHES, default="normal")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    figures = []
    print(
        f"{'reading':>12} {'pitch':>5} {'fan':>3} {'COMSOL':>7} {'fit':>6} {'geometry':>9} {'camera':>7} {'corner W':>9}"
    )
    for reading, coil in READINGS.items():
        off: dict[str, list[float]] = {"COMSOL": [], "camera": []}
        for pitch in (4, 5, 6):
            try:
                geometry = geometry_of(Array(3, 3, float(pitch), {"coil_diameter_mm": coil}))
            except InputError as error:
                print(f"{reading:>12} {pitch:5}  {error}")
                continue
            fields = fields_of(geometry, MESHES[options.mesh])
            for fan, modes in enumerate(fields):
                assert modes is not None
                found, corner_w = centre_c(modes)
                case = pitch, fan
                off["COMSOL"].append(found - COMSOL[case])
                off["camera"].append(found - CAMERA[case])
                print(
                    f"{reading:>12} {pitch:5} {fan:3} {COMSOL[case]:7} {fitted_c(pitch, fan):6.1f} {found:9.1f} "
                    f"{CAMERA[case]:7} {corner_w:9.3f}",
                    flush=True,
                )
                figures.append(
                    {"figure": f"centre, {reading} mm, pitch {pitch} mm, {'fan' if fan else 'still'}"}
                    | {"value": round(found, 1), "unit": "degC", "target": None}
                )
            lumped = lumped_of(geometry, *fields)
            for size in LARGER:  # the network: its middle, sides and corners are those of the field
                array = Array(size, size, float(pitch), {"coil_diameter_mm": coil})
                plant = plant_of(model_of(array, geometry_of(array), geometry, lumped, {}))
                for fan, air in enumerate(("still", "fan")):
                    figures.append(
                        {"figure": f"centre, {reading} mm, {size} x {size}, pitch {pitch} mm, {air}"}
                        | {"value": round(middle_c(plant, fan), 1), "unit": "degC", "target": None}
                    )
                    print(
                        f"{reading:>12} {pitch:5} {fan:3} {size} x {size}, network: {figures[-1]['value']}", flush=True
                    )
        for against, errors in off.items():
            rms = float(np.sqrt(np.mean(np.square(errors))))
            print(f"{reading:>12} rms from {against}: {rms:.1f} K over {len(errors)} cases")
            figures.append(
                {"figure": f"rms from {against}, {reading} mm", "value": round(rms, 1), "unit": "K", "target": None}
            )
    if options.json:
        command = f"bench/explore/paper.py --mesh {options.mesh}"
        options.json.write_text(json.dumps([one | {"command": command} for one in figures], indent=1) + "\n")


if __name__ == "__main__":
    main()
