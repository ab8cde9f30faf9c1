/* sources: lib/fixed_point/fixed_point.c */
#include "fixed_point.h"

#include "prove.h"

void main(void)
{
    (void)fixed_point_mac_u16(any_u32(), any_u16(), any_u16());
    (void)fixed_point_mac_s16_u16(any_u32(), any_s16(), any_u16());
    const int32_t a = any_s32();
    const int32_t b = any_between(-INT32_MAX, INT32_MAX); /* not both -2^31 */
    (void)fixed_point_scale_q31(a, b);
    (void)fixed_point_high_u16(any_u16(), any_u16());
    (void)fixed_point_add_saturated(any_s32(), any_s32());
    (void)fixed_point_multiply_divide(any_u32(), any_u32(), any_u32());
    (void)fixed_point_c7_from_cc((int16_t)any_between(-25500, 25500));
}
