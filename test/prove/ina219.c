/* sources: firmware/ina219.c
 * options: -eva-split-return full */
#include "ina219.h"

#include "prove.h"
#include "two_wire.h"

/* The bus gives any answer, and any bytes with it. */
controller_sensor_status_t two_wire_transfer(uint8_t address, two_wire_direction_t direction,
                                             uint8_t *bytes, uint8_t count)
{
    (void)address;
    for (uint8_t k = 0; k < count; k++) {
        bytes[k] = direction == TWO_WIRE_READ ? any_u8() : bytes[k];
    }
    return (controller_sensor_status_t)any_between(0, 4);
}

void main(void)
{
    uint16_t value;
    const uint8_t address = (uint8_t)any_between(0x40, 0x4F);
    (void)ina219_read(address, any_u8(), &value);
    (void)ina219_read_again(address, &value);
    (void)ina219_write(address, any_u8(), any_u16());
    (void)ina219_configure(address, any_u8());
    (void)ina219_check(address, any_u8(), any_u8());
}
