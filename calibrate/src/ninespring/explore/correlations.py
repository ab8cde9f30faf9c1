"""Heat transfer coefficients, W/m2K, each with its source. Air's properties and the wire's laws are the plant's (C)."""

from __future__ import annotations

import ctypes
import math

from ..model.native import library

KELVIN = 273.15
STEFAN_BOLTZMANN = 5.670374419e-8
PRANDTL = 0.70
GRAVITY = 9.81


def _plant(name: str, *arguments: float) -> float:
    call = getattr(library(), name)
    call.restype = ctypes.c_double
    call.argtypes = (ctypes.c_double,) * len(arguments)
    return float(call(*arguments))


def air_conductivity(film_c: float) -> float:
    """Return W/mK (sim_host/plant/convection.h)."""
    return _plant("convection_air_conductivity_w_per_mk", film_c + KELVIN)


def air_viscosity(film_c: float) -> float:
    """Return m2/s."""
    return _plant("convection_air_viscosity_m2_per_s", film_c + KELVIN)


def air_heat_per_m3k(film_c: float) -> float:
    """Return J/m3K: an ideal gas at 1 atm, 1007 J/kgK."""
    return 1007.0 * 101325.0 / (287.05 * (film_c + KELVIN))


def natural_upright_cylinder(diameter_m: float, height_m: float, surface_c: float, air_c: float) -> float:
    """Return h of an upright slender cylinder in still air.

    Plate: Churchill and Chu, Int. J. Heat Mass Transfer 18 (1975) 1323, laminar. Its curvature: Cebeci (5th Int. Heat
    Transfer Conf., 1974) for Pr 0.72 as fitted by Popiel (Heat Transfer Eng. 29 (2008) 521).
    """
    film_c = 0.5 * (surface_c + air_c)
    viscosity = air_viscosity(film_c)
    grashof = GRAVITY / (film_c + KELVIN) * abs(surface_c - air_c) * height_m**3 / viscosity**2
    plate = 0.68 + 0.670 * (grashof * PRANDTL) ** 0.25 / (1 + (0.492 / PRANDTL) ** (9 / 16)) ** (4 / 9)
    curved = 1 + 0.300 * (math.sqrt(32) * grashof**-0.25 * height_m / diameter_m) ** 0.909
    return plate * curved * air_conductivity(film_c) / height_m


def cross_flow_cylinder(diameter_m: float, velocity_m_per_s: float, surface_c: float, air_c: float) -> float:
    """Return h of a cylinder in cross flow: Churchill and Bernstein, J. Heat Transfer 99 (1977) 300."""
    return _plant("convection_forced_w_per_m2k", diameter_m, velocity_m_per_s, surface_c, air_c)


def mixed(natural: float, forced: float) -> float:
    """Return both at once, transverse (Incropera and DeWitt, section 9.9)."""
    return _plant("convection_mixed", natural, forced)


def natural_plate(side_m: float, surface_c: float, air_c: float) -> float:
    """Return the mean h of the upper and the lower side of a horizontal square plate.

    Upper 0.54 Ra^(1/4) (Lloyd and Moran 1974), lower 0.27 Ra^(1/4) (McAdams 1954), on side / 4.
    """
    film_c = 0.5 * (surface_c + air_c)
    length = side_m / 4.0
    rayleigh = GRAVITY / (film_c + KELVIN) * abs(surface_c - air_c) * length**3 * PRANDTL / air_viscosity(film_c) ** 2
    return 0.5 * (0.54 + 0.27) * rayleigh**0.25 * air_conductivity(film_c) / length


def radiation(emissivity: float, surface_c: float, air_c: float) -> float:
    """Return the secant of eps sigma T^4 between surface and air."""
    hot, cold = surface_c + KELVIN, air_c + KELVIN
    return emissivity * STEFAN_BOLTZMANN * (hot**2 + cold**2) * (hot + cold)


def view_of_neighbour(diameter: float, pitch: float) -> float:
    """Return the share of a long cylinder's radiation that meets its neighbour: Hottel's crossed strings."""
    x = pitch / diameter
    return (math.sqrt(x * x - 1) + math.asin(1 / x) - x) / math.pi
