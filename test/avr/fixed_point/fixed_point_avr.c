/* Holds the assembly of fixed_point.h to its C form, on the target. */
#include "../report.h"
#include "fixed_point.h"

static uint32_t random_state = 20;

static uint32_t random_bits(void)
{
    random_state ^= random_state << 13;
    random_state ^= random_state >> 17;
    random_state ^= random_state << 5;
    return random_state;
}

static const uint16_t edges_u16[] = {0,      1,      2,      255,    256,   257,
                                     0x7fff, 0x8000, 0xff00, 0xfffe, 0xffff};
static const uint32_t edges_u24[] = {0,        1,        255,      256,      0xffff,  0x10000,
                                     0x7fffff, 0x800000, 0xff00ff, 0xfffffe, 0xffffff};
#define EDGES 11

static uint8_t failures;

static void check(const char *what, uint32_t got, uint32_t wanted)
{
    if (got != wanted) {
        report_text(what);
        report_text(" differs\n");
        failures = 1;
    }
}

static void compare_16(uint32_t sum, uint16_t a, uint16_t b)
{
    check("mac_u16", fixed_point_mac_u16(sum, a, b), fixed_point_mac_u16_in_c(sum, a, b));
    check("subtract_u16", fixed_point_subtract_u16(sum, a, b),
          fixed_point_subtract_u16_in_c(sum, a, b));
    check("mac_s16_u16", fixed_point_mac_s16_u16(sum, (int16_t)a, b),
          fixed_point_mac_s16_u16_in_c(sum, (int16_t)a, b));
}

static void compare_24(uint32_t a, uint32_t b)
{
    int32_t value = (int32_t)(a << 8) >> 8;
    check("scale_s24", (uint32_t)fixed_point_scale_s24(value, b & 0xffffffu),
          (uint32_t)fixed_point_scale_s24_in_c(value, b & 0xffffffu));
}

int main(void)
{
    for (uint8_t i = 0; i < EDGES; i++) {
        for (uint8_t j = 0; j < EDGES; j++) {
            compare_16(0, edges_u16[i], edges_u16[j]);
            compare_16(0xffffffff, edges_u16[i], edges_u16[j]);
            compare_24(edges_u24[i], edges_u24[j]);
        }
    }
    for (uint16_t k = 0; k < 2000; k++) {
        uint32_t bits = random_bits();
        compare_16(random_bits(), (uint16_t)bits, (uint16_t)(bits >> 16));
        compare_24(bits, random_bits());
    }
    volatile uint32_t sum = 5;
    volatile uint16_t a = 40000, b = 50000;
    uint32_t s = sum;
    uint16_t x = a, y = b;
    __asm__ volatile("" : "+r"(s), "+r"(x), "+r"(y));
    COUNT("mac_u16");
    s = fixed_point_mac_u16(s, x, y);
    __asm__ volatile("" : "+r"(s));
    COUNTED();
    sum = s;
    report_end(failures);
}
