/* Settings by name and as text; and their record: what is saved is loaded, whatever happens to the
 * power, and a record of another version is read as far as it is known. */
#include <stdio.h>
#include <string.h>

#include "../run_tests.h"
#include "crc16.h"
#include "settings.h"
#include "text.h"

#include "../fakes/eeprom.h"

#define MEMORY_BYTES (2u * SETTINGS_SLOT_BYTES)
#define HEAD         6u /* bytes of a slot before the entries */

static settings_store_t store;
static settings_t settings;
static settings_t loaded;

void setUp(void)
{
    memset(memory, 0xFF, sizeof memory);
    writes_left = UINT32_MAX;
    worn = MEMORY_BYTES;
    memory_end = MEMORY_BYTES;
    settings_load(&store, &storage, &settings);
}

static record_save_t save(void)
{
    settings_save_start(&store, &settings);
    writes = 0;
    for (unsigned step = 0; step < 4u * SETTINGS_SLOT_BYTES; step++) {
        const record_save_t state = record_store_step(&store.record);
        if (state != RECORD_SAVE_BUSY) {
            return state;
        }
    }
    TEST_FAIL_MESSAGE("the save does not end");
    return RECORD_SAVE_FAILED;
}

static void expect_saved(void)
{
    TEST_ASSERT_EQUAL(RECORD_SAVE_DONE, save());
}

static settings_loaded_t load(void)
{
    settings_store_t fresh;
    return settings_load(&fresh, &storage, &loaded);
}

/* Any values within their limits. */
static void fill(uint32_t seed)
{
    for (uint16_t k = 0; k < PARAMETER_COUNT; k++) {
        const parameter_row_t row = parameter_row(k);
        for (uint8_t element = 0; element < row.count; element++) {
            seed = seed * 1664525u + 1013904223u;
            const uint32_t into = (seed >> 8) % ((uint32_t)(row.maximum - row.minimum) + 1u);
            TEST_ASSERT_EQUAL(SETTINGS_OK,
                              settings_set(&settings, k, element, row.minimum + (int32_t)into));
        }
    }
}

static void save_filled(uint32_t seed)
{
    fill(seed);
    expect_saved();
}

static bool same(const settings_t *a, const settings_t *b)
{
    for (uint16_t k = 0; k < PARAMETER_COUNT; k++) {
        for (uint8_t element = 0; element < parameter_row(k).count; element++) {
            if (settings_get(a, k, element) != settings_get(b, k, element)) {
                return false;
            }
        }
    }
    return true;
}

static void expect_defaults(void)
{
    settings_t defaults;
    settings_default(&defaults);
    TEST_ASSERT_TRUE(same(&loaded, &defaults));
}

TEST(every_setting_is_found_by_its_name)
{
    char name[SETTINGS_NAME_SIZE];
    uint16_t row = UINT16_MAX;
    uint8_t at = UINT8_MAX;
    for (uint16_t k = 0; k < PARAMETER_COUNT; k++) {
        for (uint8_t element = 0; element < parameter_row(k).count; element++) {
            settings_name(k, element, name);
            TEST_ASSERT_TRUE_MESSAGE(settings_find(name, &row, &at), name);
            TEST_ASSERT_EQUAL_MESSAGE(k, row, name);
            TEST_ASSERT_EQUAL_MESSAGE(element, at, name);
        }
    }
    /* some end in what is no number, whatever its bytes would come to */
    static const char *const none[] = {
        "loss_scale",    "loss_scale_0",   "loss_scale_01",  "loss_scale_65", "loss_scale_x",
        "loss_scale_1/", "loss_scale_24A", "loss_scale_257", "loss_w_per_kk", ""};
    for (size_t n = 0; n < ROWS(none); n++) {
        TEST_ASSERT_FALSE_MESSAGE(settings_find(none[n], &row, &at), none[n]);
    }
}

TEST(assigns_fixed_decimals)
{
    TEST_ASSERT_EQUAL(SETTINGS_OK, settings_assign(&settings, "loss_w_per_k", "0.0058"));
    TEST_ASSERT_EQUAL_UINT16(5800, settings.controller.model.loss_uw_per_k);
    TEST_ASSERT_EQUAL(SETTINGS_OK, settings_assign(&settings, "loss_scale_5", "1.02"));
    TEST_ASSERT_EQUAL_UINT16(1020, settings.controller.model.loss_scale_permille[4]);
    TEST_ASSERT_EQUAL(SETTINGS_OK, settings_assign(&settings, "transformation_shift_k_9", "-8.25"));
    TEST_ASSERT_EQUAL_INT16(-825, settings.controller.model.transformation_shift_cc[8]);
    TEST_ASSERT_EQUAL(SETTINGS_OK, settings_assign(&settings, "ambient_c", "-12.5"));
    TEST_ASSERT_EQUAL_INT16(-1250, settings.board.ambient_cc);
    TEST_ASSERT_EQUAL(SETTINGS_OK, settings_assign(&settings, "stuck_on_a", "0.2"));
    TEST_ASSERT_EQUAL_UINT16(200, settings.controller.safety.stuck_on_ma);
    TEST_ASSERT_EQUAL(SETTINGS_OK, settings_assign(&settings, "shunt_ohm", "0.01"));
    TEST_ASSERT_EQUAL_UINT16(10, settings.controller.current.shunt_mohm);
}

/* What lies between them, too: it is under the checksum of the scrub. */
TEST(defaults_are_the_same_in_every_byte)
{
    static settings_t one, other;
    memset(&one, 0xA5, sizeof one);
    memset(&other, 0x5A, sizeof other);
    settings_default(&one);
    settings_default(&other);
    TEST_ASSERT_EQUAL_MEMORY(&one, &other, sizeof one);
}

TEST(a_refused_value_changes_nothing)
{
    static const struct {
        const char *name;
        const char *value;
        settings_result_t result;
    } cases[] = {
        {"nonsense", "1", SETTINGS_UNKNOWN_NAME},
        {"loss_w_per_k", "0.065536", SETTINGS_OUT_OF_RANGE},
        {"loss_w_per_k", "-0.000001", SETTINGS_OUT_OF_RANGE},
        {"loss_w_per_k", "99999999999", SETTINGS_OUT_OF_RANGE},
        {"loss_w_per_k", "0.0058001234", SETTINGS_NOT_A_NUMBER},
        {"loss_w_per_k", "5e-3", SETTINGS_NOT_A_NUMBER},
        {"loss_w_per_k", "nan", SETTINGS_NOT_A_NUMBER},
        {"loss_w_per_k", "", SETTINGS_NOT_A_NUMBER},
        {"loss_w_per_k", "-", SETTINGS_NOT_A_NUMBER},
        {"loss_w_per_k", "1.2.3", SETTINGS_NOT_A_NUMBER},
        {"rows", "0", SETTINGS_OUT_OF_RANGE},
        {"telemetry_hz", "51", SETTINGS_OUT_OF_RANGE},
    };
    const settings_t before = settings;
    for (unsigned i = 0; i < ROWS(cases); i++) {
        TEST_ASSERT_EQUAL_MESSAGE(cases[i].result,
                                  settings_assign(&settings, cases[i].name, cases[i].value),
                                  cases[i].value);
        TEST_ASSERT_EQUAL_MEMORY(&before, &settings, sizeof before);
    }
}

/* --- the record ----------------------------------------------------------------------------- */

TEST(a_saved_record_is_loaded)
{
    TEST_ASSERT_EQUAL(RECORD_EMPTY, load().found);
    for (uint32_t seed = 1; seed < 6; seed++) {
        save_filled(seed);
        const settings_loaded_t result = load();
        TEST_ASSERT_EQUAL(RECORD_LOADED, result.found);
        TEST_ASSERT_EQUAL_UINT8(0, result.missing);
        TEST_ASSERT_EQUAL_UINT8(0, result.dropped);
        TEST_ASSERT_EQUAL_UINT8(0, result.dropped_id);
        TEST_ASSERT_TRUE(same(&settings, &loaded));
    }
    /* and it holds every row's entry, and nothing else */
    unsigned bytes = 0;
    for (uint16_t k = 0; k < PARAMETER_COUNT; k++) {
        const parameter_row_t row = parameter_row(k);
        bytes += 2u + row.count * (unsigned)parameter_width(row.type);
    }
    TEST_ASSERT_EQUAL_UINT(bytes, record_store_length(&store.record));
}

/* What lies in boards: an id never means another row, nor another number of decimals. Who drops or
 * adds a row states the new sum; who changes one gives it a new id instead. */
TEST(ids_keep_their_meaning)
{
    uint16_t sum = CRC16_START;
    for (unsigned id = 1; id <= 76u; id++) {
        for (uint16_t k = 0; k < PARAMETER_COUNT; k++) {
            const parameter_row_t row = parameter_row(k);
            if (row.id == id) {
                sum = crc16_add_bytes(sum, row.name, (uint16_t)strlen(row.name));
                sum = crc16_add(crc16_add(sum, row.decimals), row.id);
            }
        }
    }
    TEST_ASSERT_EQUAL_HEX16(0x2D64, sum);
}

TEST(sequence_numbers_may_wrap)
{
    save_filled(1);
    store.record.sequence = 0xFFFD;
    for (uint32_t seed = 2; seed < 7; seed++) {
        save_filled(seed);
        if (seed > 2) { /* the first one is beside a record that is not one less */
            TEST_ASSERT_EQUAL(RECORD_LOADED, load().found);
            TEST_ASSERT_TRUE(same(&settings, &loaded));
        }
    }
}

/* For every number of bytes that still reach the memory, the byte under way at the cut being left
 * or holding anything: the old record or the new one, whole. */
TEST(a_cut_at_any_byte_leaves_the_old_or_the_new_record)
{
    static uint8_t before[MEMORY_BYTES];
    save_filled(1);
    save_filled(2);
    const settings_t old_settings = settings;
    memcpy(before, memory, sizeof before);
    fill(3);
    const settings_t new_settings = settings;
    const settings_store_t clean = store;
    expect_saved();
    const unsigned total = writes;
    TEST_ASSERT_GREATER_THAN_UINT(100, total);
    for (unsigned cut = 0; cut <= total; cut++) {
        for (unsigned torn = 0; torn < 2; torn++) {
            memcpy(memory, before, sizeof before);
            store = clean;
            settings = new_settings;
            writes_left = cut;
            save();
            writes_left = UINT32_MAX;
            if (torn != 0 && cut < total) {
                /* clearing writes byte 0, then 1, 2, ..., then byte 0 again; slot 0 is the older */
                memory[cut == 0 || cut + 1u == total ? 0u : cut] = (uint8_t)(cut * 37u + 11u);
            }
            const record_found_t found = load().found;
            TEST_ASSERT_TRUE(found == RECORD_LOADED || found == RECORD_LOADED_OTHER);
            TEST_ASSERT_TRUE(same(&loaded, cut == total ? &new_settings : &old_settings));
            settings_load(&store, &storage, &settings); /* and the next save works */
            settings = new_settings;
            expect_saved();
            (void)load();
            TEST_ASSERT_TRUE(same(&loaded, &new_settings));
        }
    }
}

TEST(every_flipped_bit_is_detected)
{
    save_filled(7);
    const unsigned bytes = writes - 1u; /* clearing, the record from byte 1 on, completing */
    for (unsigned bit = 0; bit < 8u * bytes; bit++) {
        memory[bit / 8u] = (uint8_t)(memory[bit / 8u] ^ (1u << (bit % 8u)));
        const record_found_t found = load().found;
        TEST_ASSERT_TRUE_MESSAGE(found == RECORD_DAMAGED || found == RECORD_FOREIGN,
                                 "a flipped bit passed");
        expect_defaults();
        memory[bit / 8u] = (uint8_t)(memory[bit / 8u] ^ (1u << (bit % 8u)));
    }
    TEST_ASSERT_EQUAL(RECORD_LOADED, load().found);
}

TEST(a_damaged_newest_record_falls_back_to_the_older_and_says_so)
{
    save_filled(1);
    const settings_t old_settings = settings;
    save_filled(2);
    memory[SETTINGS_SLOT_BYTES + 20u] ^= 0x10u;
    TEST_ASSERT_EQUAL(RECORD_LOADED_OTHER, load().found);
    TEST_ASSERT_TRUE(same(&loaded, &old_settings));
}

/* Slot 0 holds these entries, as any version writes them. */
static void put_record(const uint8_t *entries, uint16_t length)
{
    memset(memory, 0xFF, sizeof memory);
    const uint8_t head[HEAD] = {0xA5, SETTINGS_RECORD_KIND,      0,
                                0,    (uint8_t)(length & 0xFFu), (uint8_t)(length >> 8)};
    memcpy(memory, head, HEAD);
    memcpy(memory + HEAD, entries, length);
    const uint16_t crc = crc16_add_bytes(CRC16_START, &memory[1], (uint16_t)(HEAD - 1u + length));
    memory[HEAD + length] = (uint8_t)(crc & 0xFFu);
    memory[HEAD + length + 1u] = (uint8_t)(crc >> 8);
}

/* The bytes of each type as they have lain since ids were given. They may not change. */
TEST(a_record_of_an_earlier_version_keeps_what_it_knows)
{
    static const uint8_t entries[] = {
        1,  0,    2,                                  /* rows, U8 */
        4,  1,    0x70, 0x17,                         /* loss_w_per_k, U16: 0.006000 */
        50, 2,    0x18, 0xFC,                         /* ambient_c, S16: -10.00 */
        17, 3,    0xA0, 0x86, 0x01, 0x00,             /* resistance_martensite_ohm, U32: 0.1 */
        26, 0x09, 0xE8, 0x03, 0x4C, 0x04, 0x84, 0x03, /* loss_scale, three of U16 */
    };
    put_record(entries, sizeof entries);
    const settings_loaded_t result = load();
    TEST_ASSERT_EQUAL(RECORD_LOADED, result.found);
    TEST_ASSERT_EQUAL_UINT8(PARAMETER_COUNT - 5, result.missing);
    TEST_ASSERT_EQUAL_UINT8(0, result.dropped);
    settings_t wanted;
    settings_default(&wanted);
    wanted.controller.model.rows = 2;
    wanted.controller.model.loss_uw_per_k = 6000;
    wanted.board.ambient_cc = -1000;
    wanted.controller.model.resistance_martensite_uohm = 100000;
    wanted.controller.model.loss_scale_permille[1] = 1100;
    wanted.controller.model.loss_scale_permille[2] = 900;
    TEST_ASSERT_TRUE(same(&wanted, &loaded));
}

TEST(a_record_of_a_later_version_says_what_was_dropped)
{
    static const uint8_t entries[] = {
        251, 0x06, 1,    2,    3, 4, /* two of a setting that this version does not know */
        50,  2,    0x18, 0xFC,       /* ambient_c -10.00 */
        54,  0,    200,              /* telemetry_hz: beyond the limits of this version */
        1,   4,    2,    1,          /* rows: one more than here */
        45,  3,    0x10, 0,    0, 0, /* maximum_on_s with more bits than here */
    };
    put_record(entries, sizeof entries);
    const settings_loaded_t result = load();
    TEST_ASSERT_EQUAL(RECORD_LOADED, result.found);
    TEST_ASSERT_EQUAL_UINT8(3, result.dropped);
    TEST_ASSERT_EQUAL_UINT8(251, result.dropped_id);
    TEST_ASSERT_EQUAL_UINT8(PARAMETER_COUNT - 4, result.missing);
    TEST_ASSERT_EQUAL_INT16(-1000, loaded.board.ambient_cc);
    TEST_ASSERT_EQUAL_UINT8(5, loaded.board.telemetry_hz);
    TEST_ASSERT_EQUAL_UINT8(2, loaded.controller.model.rows);
    TEST_ASSERT_EQUAL_UINT8(3, loaded.controller.model.columns);
    TEST_ASSERT_EQUAL_UINT16(16, loaded.controller.safety.maximum_on_s);
}

/* Whole by its CRC, but its last entry claims more than there is; and one that is cut at once. */
TEST(an_entry_that_leaves_the_record_is_not_read)
{
    static const uint8_t entries[] = {50, 2, 0x18, 0xFC, 26, 0xFD, 1, 2};
    for (uint16_t length = 5; length <= sizeof entries; length++) {
        put_record(entries, length);
        const settings_loaded_t result = load();
        TEST_ASSERT_EQUAL(RECORD_LOADED, result.found);
        TEST_ASSERT_EQUAL_UINT8(PARAMETER_COUNT - 1, result.missing);
        TEST_ASSERT_EQUAL_INT16(-1000, loaded.board.ambient_cc);
        TEST_ASSERT_EQUAL_UINT16(1000, loaded.controller.model.loss_scale_permille[0]);
    }
    static const uint8_t alone[] = {17, 3, 0xA0, 0x86, 0x01}; /* of four bytes three */
    put_record(alone, sizeof alone);
    TEST_ASSERT_EQUAL_UINT8(PARAMETER_COUNT, load().missing);
    expect_defaults();
}

TEST(a_record_in_another_format_gives_defaults_and_says_so)
{
    save_filled(9);
    memory[1] = SETTINGS_RECORD_KIND - 1u;
    TEST_ASSERT_EQUAL(RECORD_FOREIGN, load().found);
    expect_defaults();
}

TEST(a_memory_that_does_not_keep_is_reported)
{
    save_filled(4);
    const settings_t kept = settings;
    fill(5);
    const settings_t wanted = settings;
    unsigned failed = 0;
    for (unsigned cell = SETTINGS_SLOT_BYTES; cell < SETTINGS_SLOT_BYTES + 300u; cell++) {
        memset(memory + SETTINGS_SLOT_BYTES, 0xFF, SETTINGS_SLOT_BYTES);
        settings_load(&store, &storage, &settings);
        settings = wanted;
        worn = cell;
        memory[worn] = 0x5A; /* which may happen to be what it is to hold */
        const bool kept_it = save() == RECORD_SAVE_DONE;
        failed += kept_it ? 0u : 1u;
        (void)load();
        TEST_ASSERT_TRUE(same(&loaded, kept_it ? &wanted : &kept));
    }
    TEST_ASSERT_GREATER_THAN_UINT(250, failed);
}

/* --- another kind of record ------------------------------------------------------------------ */

static uint8_t short_byte(void *context, uint16_t position)
{
    return ((const uint8_t *)context)[position];
}

TEST(another_record_has_its_own_slots)
{
    uint8_t bytes[248];
    record_store_t other;
    const uint16_t base = 100;
    TEST_ASSERT_EQUAL(RECORD_EMPTY, record_store_open(&other, &storage, base, 256, 3));
    for (unsigned round = 0; round < 3; round++) {
        const uint16_t length = (uint16_t)(sizeof bytes - round);
        memset(bytes, (int)(round + 1u), sizeof bytes);
        record_store_save(&other, short_byte, bytes, length);
        while (record_store_step(&other) == RECORD_SAVE_BUSY) {
        }
        record_store_t found;
        TEST_ASSERT_EQUAL(RECORD_LOADED, record_store_open(&found, &storage, base, 256, 3));
        TEST_ASSERT_EQUAL_UINT16(length, record_store_length(&found));
        TEST_ASSERT_EQUAL_UINT8(round + 1u, record_store_read(&found, (uint16_t)(length - 1u)));
        TEST_ASSERT_EQUAL_UINT8(round + 1u, record_store_read(&other, 0));
    }
    TEST_ASSERT_EQUAL_HEX8(0xFF, memory[base - 1u]);
    TEST_ASSERT_EQUAL_HEX8(0xFF, memory[base + 512u]);
    TEST_ASSERT_EQUAL(RECORD_FOREIGN, record_store_open(&other, &storage, base, 256, 4));
}

/* A record that claims more than its slot holds is damaged, whatever its CRC says: what lies behind
 * the slot is another's. The longest that fits is one. */
TEST(a_length_beyond_the_slot_is_no_record)
{
    uint8_t bytes[256];
    const uint16_t base = 100;
    memset(bytes, 7, sizeof bytes);
    for (unsigned length = 247; length <= 249; length++) {
        record_store_t other;
        memset(memory + base, 0xFF, 512);
        (void)record_store_open(&other, &storage, base, 256, 3);
        record_store_save(&other, short_byte, bytes, (uint16_t)length);
        while (record_store_step(&other) == RECORD_SAVE_BUSY) {
        }
        /* of 249 the crc's last byte lies in the second slot, and is right there */
        TEST_ASSERT_EQUAL(length <= 248 ? RECORD_LOADED : RECORD_DAMAGED,
                          record_store_open(&other, &storage, base, 256, 3));
    }
}
