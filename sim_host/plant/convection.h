/* What it is for: heat transfer coefficients of a thin horizontal wire in air, from correlations.
 * What it owns: the properties of air and the formulas of Churchill with Chu and with Bernstein.
 * What it never does: know springs, arrays or parameters. */
#ifndef CONVECTION_H
#define CONVECTION_H

#ifdef __cplusplus
extern "C" {
#endif

/* Air at 1 atm and film_k = 300..400 K, within 0.5 % of Incropera and DeWitt, table A.4. */
double convection_air_viscosity_m2_per_s(double film_k);
double convection_air_conductivity_w_per_mk(double film_k);
#define CONVECTION_PRANDTL 0.70

/* Churchill and Chu, Int. J. Heat Mass Transfer 18 (1975) 1049, long horizontal cylinder, Ra <=
 * 1e12: Nu = (0.60 + 0.387 Ra^(1/6) / (1 + (0.559 / Pr)^(9/16))^(8/27))^2.   Returns W/m2K. */
double convection_natural_w_per_m2k(double diameter_m, double surface_c, double air_c);

/* Churchill and Bernstein, J. Heat Transfer 99 (1977) 300, cylinder in cross flow, Re Pr > 0.2:
 *     Nu = 0.3 + 0.62 Re^(1/2) Pr^(1/3) / (1 + (0.4 / Pr)^(2/3))^(1/4) (1 + (Re /
 * 282000)^(5/8))^(4/5). W/m2K; 0 where the air stands still. */
double convection_forced_w_per_m2k(double diameter_m, double velocity_m_per_s, double surface_c,
                                   double air_c);

/* Both at once, transverse: (natural^4 + forced^4)^(1/4) (Incropera and DeWitt, section 9.9). */
double convection_mixed(double natural, double forced);

#ifdef __cplusplus
}
#endif
#endif
