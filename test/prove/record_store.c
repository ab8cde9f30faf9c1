/* sources: lib/record_store/record_store.c lib/crc16/crc16.c */
#include "record_store.h"

#include "prove.h"

/* An EEPROM that may hold and give anything, and must not be asked beyond its end. */
#define BASE   64u
#define SLOT   96u
#define EEPROM (BASE + 2u * SLOT)

static uint8_t read_byte(void *context, uint16_t address)
{
    (void)context;
    /*@ assert within: BASE <= address < EEPROM; */
    return any_u8();
}

static bool is_ready(void *context)
{
    (void)context;
    return any_bool();
}

static void write_byte(void *context, uint16_t address, uint8_t value)
{
    (void)context;
    (void)value;
    /*@ assert within: BASE <= address < EEPROM; */
}

static uint8_t next_byte_of(void *context, uint16_t position)
{
    (void)context;
    (void)position;
    return any_u8();
}

void main(void)
{
    const record_storage_t storage = {NULL, read_byte, is_ready, write_byte};
    record_store_t store;
    (void)record_store_open(&store, &storage, BASE, SLOT, any_u8());
    (void)record_store_step(&store);
    record_store_save(&store, next_byte_of, NULL, 0);
    /*@ loop widen_hints "all", 1, 88, 95, 96; */
    while (any_bool()) {
        /* of what was found when the store was opened; the storage may give another length now */
        (void)record_store_length(&store);
        (void)record_store_read(&store, (uint16_t)any_between(0, SLOT - RECORD_OVERHEAD_BYTES - 1));
        if (any_bool()) {
            record_store_save(&store, next_byte_of, NULL,
                              (uint16_t)any_between(0, SLOT - RECORD_OVERHEAD_BYTES));
        }
        (void)record_store_step(&store);
    }
}
