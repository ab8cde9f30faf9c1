"""Fit the three numbers of sim_host/plant/paper.h to COMSOL's six centre temperatures.

The plant itself is the model (ctypes, no second implementation): hot springs held at 105 degC, centre
undriven, steady. Printed at the end: the camera's six against the same numbers, which took no part.
"""

from __future__ import annotations

import argparse
import ctypes
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

LOSS_W_PER_K = 0.0058
# pitch mm, fan, centre degC by COMSOL, by the camera
CASES = [(4, 0, 52, 63), (4, 1, 42, 55), (5, 0, 45, 57), (5, 1, 35, 50), (6, 0, 40, 55), (6, 1, 31, 49)]
HELD, POWER = 4, 0


def centre_c(lib: ctypes.CDLL, pitch_mm: float, fan: float, hot_c: float, x: np.ndarray) -> float:
    """Centre temperature (degC) for x = fan factor, orthogonal W/K at 5 mm, spacing exponent."""
    fan_factor, level, exponent = x
    orthogonal = level * (5.0 / pitch_mm) ** exponent
    plant = lib.plant_create(3, 3)
    for name, value in {
        "loss_w_per_k": LOSS_W_PER_K,
        "loss_fan_w_per_k": LOSS_W_PER_K * fan_factor,
        "orthogonal_w_per_k": orthogonal,
        "orthogonal_fan_w_per_k": orthogonal,
        "diagonal_w_per_k": orthogonal / 2,
        "diagonal_fan_w_per_k": orthogonal / 2,
    }.items():
        assert lib.plant_set(plant, name.encode(), value) == 0, name
    assert lib.plant_set_fan(plant, fan) == 0
    for spring in range(9):
        mode, quantity = (POWER, 0.0) if spring == 4 else (HELD, hot_c)
        assert lib.plant_drive(plant, spring, mode, quantity) == 0
    assert lib.plant_settle(plant, 1e5) == 0
    result = lib.plant_temperature_c(plant, 4)
    lib.plant_destroy(plant)
    return float(result)


def load(path: Path) -> ctypes.CDLL:
    """Load the plant and declare the functions used here."""
    lib = ctypes.CDLL(str(path))
    pointer, real, integer, text = ctypes.c_void_p, ctypes.c_double, ctypes.c_int, ctypes.c_char_p
    lib.plant_create.restype = pointer
    lib.plant_destroy.argtypes = [pointer]
    lib.plant_set.argtypes = [pointer, text, real]
    lib.plant_set_fan.argtypes = [pointer, real]
    lib.plant_drive.argtypes = [pointer, integer, integer, real]
    lib.plant_settle.argtypes = [pointer, real]
    lib.plant_temperature_c.argtypes = [pointer, integer]
    lib.plant_temperature_c.restype = real
    return lib


def rms(values: np.ndarray | list) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values, dtype=float))))


def main() -> None:
    """Fit, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--library", type=Path, required=True, help="libplant_shared.so of the build")
    lib = load(parser.parse_args().library)

    def residual(x: np.ndarray) -> np.ndarray:
        return np.array([centre_c(lib, p, f, 105.0, x) - c for p, f, c, _ in CASES])

    fit = least_squares(residual, [2.0, 4e-4, 2.0], x_scale=[1.0, 1e-4, 1.0], diff_step=1e-4)
    print(f"PAPER_FAN_FACTOR       {fit.x[0]:.4f}")
    print(f"PAPER_ORTHOGONAL_5MM   {fit.x[1]:.4e}")
    print(f"PAPER_SPACING_EXPONENT {fit.x[2]:.4f}")
    print("pitch fan  comsol model error   camera model(99) error  model(105) error")
    errors: dict[float, list[float]] = {99.0: [], 105.0: []}
    for (pitch, fan, comsol, camera), error in zip(CASES, fit.fun, strict=True):
        at = {hot: centre_c(lib, pitch, fan, hot, fit.x) for hot in errors}
        for hot, values in errors.items():
            values.append(at[hot] - camera)
        print(
            f"{pitch:5} {fan:3} {comsol:7} {comsol + error:5.2f} {error:+5.2f}  {camera:7} {at[99.0]:9.2f}"
            f" {at[99.0] - camera:+6.2f} {at[105.0]:10.2f} {at[105.0] - camera:+6.2f}"
        )
    print(f"rms: COMSOL {rms(fit.fun):.2f} degC, largest {np.abs(fit.fun).max():.2f}")
    for hot, values in errors.items():
        print(f"rms: camera, hot at {hot:g}: {rms(values):.2f} degC")
    gap = [camera - comsol for _, _, comsol, camera in CASES]
    print(f"rms: camera less COMSOL's own numbers: {rms(gap):.2f} degC")


if __name__ == "__main__":
    main()
