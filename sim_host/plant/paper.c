#include "paper.h"

#include <math.h>

/* Sekerere, Ndeda, Kabini. The camera's hot value is given once (4 mm, no fan). */
const paper_case_t paper_cases[PAPER_CASE_COUNT] = {
    {"comsol", 4, 0, 20, 105, 52}, {"comsol", 4, 1, 20, 105, 42}, {"comsol", 5, 0, 20, 105, 45},
    {"comsol", 5, 1, 20, 105, 35}, {"comsol", 6, 0, 20, 105, 40}, {"comsol", 6, 1, 20, 105, 31},
    {"camera", 4, 0, 20, 99, 63},  {"camera", 4, 1, 20, 99, 55},  {"camera", 5, 0, 20, 99, 57},
    {"camera", 5, 1, 20, 99, 50},  {"camera", 6, 0, 20, 99, 55},  {"camera", 6, 1, 20, 99, 49},
};

double paper_loss_w_per_k(double fan)
{
    return PAPER_LOSS_W_PER_K * (1.0 + fan * (PAPER_FAN_FACTOR - 1.0));
}

double paper_orthogonal_w_per_k(double pitch_mm)
{
    return PAPER_ORTHOGONAL_5MM * pow(5.0 / pitch_mm, PAPER_SPACING_EXPONENT);
}

double paper_diagonal_w_per_k(double pitch_mm)
{
    return 0.5 * paper_orthogonal_w_per_k(pitch_mm);
}

plant_status_t paper_configure(plant_t *plant, double pitch_mm)
{
    if (!(pitch_mm >= 1.0 && pitch_mm <= 100.0))
        return PLANT_ERROR_RANGE;
    const double orthogonal = paper_orthogonal_w_per_k(pitch_mm);
    const double diagonal = paper_diagonal_w_per_k(pitch_mm);
    plant_set(plant, "loss_w_per_k", paper_loss_w_per_k(0.0));
    plant_set(plant, "loss_fan_w_per_k", paper_loss_w_per_k(1.0));
    plant_set(plant, "orthogonal_w_per_k", orthogonal);
    plant_set(plant, "orthogonal_fan_w_per_k", orthogonal);
    plant_set(plant, "diagonal_w_per_k", diagonal);
    return plant_set(plant, "diagonal_fan_w_per_k", diagonal);
}

plant_status_t paper_centre_c(plant_t *plant, const paper_case_t *which, double *centre_c)
{
    if (plant_spring_count(plant) != 9)
        return PLANT_ERROR_SIZE;
    plant_status_t status = paper_configure(plant, which->pitch_mm);
    if (status == PLANT_OK)
        status = plant_set_ambient(plant, which->ambient_c);
    if (status == PLANT_OK)
        status = plant_set_fan(plant, which->fan);
    for (int i = 0; i < 9 && status == PLANT_OK; i++)
        status = i == 4 ? plant_drive(plant, i, PLANT_DRIVE_POWER, 0.0)
                        : plant_drive(plant, i, PLANT_DRIVE_TEMPERATURE, which->t_hot_c);
    if (status != PLANT_OK)
        return status;
    plant_reset(plant);
    status = plant_settle(plant, 1e5);
    *centre_c = plant_temperature_c(plant, 4);
    return status;
}
