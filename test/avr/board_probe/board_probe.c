/* Exercises one peripheral of the simulated Mega per letter received, and says what it saw: see
 * test/board_hardware. Registers are driven directly, so that the test is of the board and not of a
 * library. */
#include <avr/io.h>
#include <stdint.h>
#include <util/delay.h>

static void put(uint8_t octet)
{
    while ((UCSR0A & _BV(UDRE0)) == 0) {
    }
    UDR0 = octet;
}

static void put_hex(uint8_t value)
{
    static const char digits[] = "0123456789ABCDEF";
    put((uint8_t)digits[value >> 4]);
    put((uint8_t)digits[value & 15u]);
}

static uint8_t get(void)
{
    while ((UCSR0A & _BV(RXC0)) == 0) {
    }
    return UDR0;
}

static uint8_t i2c(uint8_t control)
{
    TWCR = (uint8_t)(_BV(TWINT) | _BV(TWEN) | control);
    for (uint16_t k = 0; k < 2000; k++) {
        if ((TWCR & _BV(TWINT)) != 0) {
            return TWSR & 0xF8u;
        }
    }
    return 0xFF; /* never done */
}

static uint8_t i2c_send(uint8_t octet)
{
    TWDR = octet;
    return i2c(0);
}

/* Reads a register of a sensor; prints every status of the way and the two bytes. */
static void read_sensor(uint8_t address, uint8_t reg)
{
    TWBR = 12; /* 400 kHz */
    GPIOR0 = 1;
    const uint8_t status[5] = {i2c(_BV(TWSTA)), i2c_send((uint8_t)(address << 1)), i2c_send(reg),
                               i2c(_BV(TWSTA)), i2c_send((uint8_t)(address << 1 | 1))};
    const uint8_t first = i2c(_BV(TWEA));
    const uint8_t high = TWDR;
    const uint8_t second = i2c(0);
    const uint8_t low = TWDR;
    TWCR = _BV(TWINT) | _BV(TWEN) | _BV(TWSTO);
    for (uint16_t k = 0; k < 2000 && (TWCR & _BV(TWSTO)) != 0; k++) {
    }
    GPIOR0 = 2;
    for (uint8_t k = 0; k < 5; k++) {
        put_hex(status[k]);
    }
    put_hex(first);
    put_hex(second);
    put_hex(high);
    put_hex(low);
    TWCR = 0; /* gives a stuck bus up */
}

static void pwm(uint8_t compare_high, uint8_t compare_low, uint8_t on)
{
    ICR3 = 799;
    OCR3A = (uint16_t)(compare_high << 8 | compare_low);
    DDRE |= _BV(3) | _BV(4);
    TCCR3B = _BV(WGM33) | _BV(WGM32) | _BV(CS30);
    TCCR3A = (uint8_t)(_BV(WGM31) | (on ? _BV(COM3A1) : 0));
}

static void write_eeprom(uint16_t address, uint8_t octet)
{
    while ((EECR & _BV(EEPE)) != 0) {
    }
    EEAR = address;
    EEDR = octet;
    GPIOR0 = 3;
    EECR = _BV(EEMPE);
    EECR |= _BV(EEPE);
}

static uint8_t read_eeprom(uint16_t address)
{
    while ((EECR & _BV(EEPE)) != 0) {
    }
    EEAR = address;
    EECR |= _BV(EERE);
    return EEDR;
}

static void obey(uint8_t letter)
{
    switch (letter) {
    case 'i': /* address, register */ {
        const uint8_t address = get();
        read_sensor(address, get());
        break;
    }
    case 'p': /* compare high, compare low, on */ {
        const uint8_t high = get();
        const uint8_t low = get();
        pwm(high, low, get());
        break;
    }
    case 'h': /* output 2 as a plain pin, high */
        PORTE |= _BV(4);
        break;
    case 'l':
        PORTE &= (uint8_t)~_BV(4);
        break;
    case 'b': /* away for 10 ms; how many bytes are there then, and was one lost */
        _delay_ms(10);
        {
            const uint8_t lost = UCSR0A & _BV(DOR0);
            uint8_t count = 0;
            while ((UCSR0A & _BV(RXC0)) != 0) {
                (void)UDR0;
                count++;
            }
            put_hex(count);
            put_hex(lost);
        }
        break;
    case 'E': /* low address, value: starts a write and says whether it is under way */ {
        const uint8_t address = get();
        write_eeprom(address, get());
        put_hex(EECR & _BV(EEPE));
        break;
    }
    case 'W': /* waits for the write to end */
        while ((EECR & _BV(EEPE)) != 0) {
        }
        GPIOR0 = 5;
        break;
    case 'R':
        put_hex(read_eeprom(get()));
        break;
    case 'd': /* pins of the bus: bit 0 SCL, bit 1 SDA */
        put_hex(PIND & 3u);
        break;
    default:
        put('?');
        break;
    }
    put('\n');
}

int main(void)
{
    UBRR0 = 16;
    UCSR0A = _BV(U2X0);
    UCSR0B = _BV(RXEN0) | _BV(TXEN0);
    for (;;) {
        obey(get());
    }
}
