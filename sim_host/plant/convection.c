#include "convection.h"

#include <math.h>

#define GRAVITY 9.81
#define KELVIN  273.15

double convection_air_viscosity_m2_per_s(double film_k)
{
    return 15.89e-6 * pow(film_k / 300.0, 1.77);
}

double convection_air_conductivity_w_per_mk(double film_k)
{
    return 26.3e-3 * pow(film_k / 300.0, 0.873);
}

double convection_natural_w_per_m2k(double diameter_m, double surface_c, double air_c)
{
    const double film_k = 0.5 * (surface_c + air_c) + KELVIN;
    const double nu = convection_air_viscosity_m2_per_s(film_k);
    const double rayleigh = GRAVITY / film_k * fabs(surface_c - air_c) * diameter_m * diameter_m *
                            diameter_m * CONVECTION_PRANDTL / (nu * nu);
    /* (1 + (0.559 / 0.70)^(9/16))^(8/27) = 1.2059 */
    const double root = 0.60 + 0.387 * cbrt(sqrt(rayleigh)) / 1.205899;
    return root * root * convection_air_conductivity_w_per_mk(film_k) / diameter_m;
}

double convection_forced_w_per_m2k(double diameter_m, double velocity_m_per_s, double surface_c,
                                   double air_c)
{
    if (!(velocity_m_per_s > 0.0))
        return 0.0;
    const double film_k = 0.5 * (surface_c + air_c) + KELVIN;
    const double reynolds =
        velocity_m_per_s * diameter_m / convection_air_viscosity_m2_per_s(film_k);
    /* 0.70^(1/3) / (1 + (0.4 / 0.70)^(2/3))^(1/4) */
    const double nusselt =
        0.3 + 0.62 * sqrt(reynolds) * 0.778903 * pow(1.0 + pow(reynolds / 282000.0, 0.625), 0.8);
    return nusselt * convection_air_conductivity_w_per_mk(film_k) / diameter_m;
}

double convection_mixed(double natural, double forced)
{
    const double a = natural * natural, b = forced * forced;
    return sqrt(sqrt(a * a + b * b));
}
