#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "crc16.h"
#include "settings.h"
#include "text.h"
#include "unity.h"

#define MEMORY_BYTES (2u * SETTINGS_SLOT_BYTES)

static uint8_t memory[MEMORY_BYTES];
static unsigned writes_left; /* before the power goes */
static unsigned writes;
static bool worn; /* bytes are not kept */

static uint8_t memory_read(void *context, uint16_t address)
{
    (void)context;
    return memory[address];
}

static bool memory_ready(void *context)
{
    (void)context;
    return true;
}

static void memory_write(void *context, uint16_t address, uint8_t value)
{
    (void)context;
    writes++;
    if (writes_left == 0 || worn) {
        return;
    }
    writes_left--;
    memory[address] = value;
}

static const settings_storage_t storage = {NULL, memory_read, memory_ready, memory_write};
static settings_store_t store;
static settings_t settings;

void setUp(void)
{
    memset(memory, 0xFF, sizeof memory);
    writes_left = UINT32_MAX;
    worn = false;
    settings_load(&store, &storage, &settings);
}

void tearDown(void) {}

static settings_save_state_t save(uint8_t entries)
{
    settings_save_state_t state;
    settings_save_start(&store, &settings, entries);
    writes = 0;
    for (unsigned step = 0; step < 4u * SETTINGS_SLOT_BYTES; step++) {
        state = settings_save_step(&store);
        if (state != SETTINGS_SAVE_BUSY) {
            return state;
        }
    }
    TEST_FAIL_MESSAGE("the save does not end");
    return state;
}

static void fill(uint32_t seed)
{
    settings_entry_t entry;
    for (uint8_t i = 0; i < settings_count(); i++) {
        settings_entry(i, &entry);
        for (uint8_t k = 0; k < entry.count; k++) {
            seed = seed * 1664525u + 1013904223u;
            const uint32_t span = (uint32_t)(entry.maximum - entry.minimum);
            const uint32_t into = span == 0 ? 0 : (seed >> 8) % (span + 1u);
            TEST_ASSERT_EQUAL(SETTINGS_OK,
                              settings_set(&settings, i, k, entry.minimum + (int32_t)into));
        }
    }
}

static bool same(const settings_t *a, const settings_t *b)
{
    settings_entry_t entry;
    for (uint8_t i = 0; i < settings_count(); i++) {
        settings_entry(i, &entry);
        for (uint8_t k = 0; k < entry.count; k++) {
            if (settings_get(a, i, k) != settings_get(b, i, k)) {
                return false;
            }
        }
    }
    return true;
}

static void defaults_lie_within_the_limits_and_names_are_unique(void)
{
    settings_entry_t entry;
    for (uint8_t i = 0; i < settings_count(); i++) {
        settings_entry(i, &entry);
        uint8_t index = 255;
        uint8_t element = 255;
        char name[SETTINGS_NAME_SIZE + 4];
        for (uint8_t k = 0; k < entry.count; k++) {
            const int32_t value = settings_get(&settings, i, k);
            TEST_ASSERT_TRUE_MESSAGE(value >= entry.minimum && value <= entry.maximum,
                                     settings_name(i));
            if (entry.count > 1) {
                snprintf(name, sizeof name, "%s_%d", settings_name(i), k + 1);
            } else {
                snprintf(name, sizeof name, "%s", settings_name(i));
            }
            TEST_ASSERT_TRUE_MESSAGE(settings_find(name, &index, &element), name);
            TEST_ASSERT_EQUAL_MESSAGE(i, index, name);
            TEST_ASSERT_EQUAL_MESSAGE(k, element, name);
        }
    }
    uint8_t at;
    TEST_ASSERT_FALSE(settings_find("loss_scale", &at, &at));
    TEST_ASSERT_FALSE(settings_find("loss_scale_0", &at, &at));
    TEST_ASSERT_FALSE(settings_find("loss_scale_01", &at, &at));
    TEST_ASSERT_FALSE(settings_find("loss_scale_65", &at, &at));
    TEST_ASSERT_FALSE(settings_find("loss_w_per_kk", &at, &at));
    TEST_ASSERT_FALSE(settings_find("", &at, &at));
}

static void every_byte_of_the_controller_settings_is_in_the_table(void)
{
    static bool covered[sizeof(settings_t)];
    settings_entry_t entry;
    unsigned count = 0;
    for (uint8_t i = 0; i < settings_count(); i++) {
        settings_entry(i, &entry);
        const uint8_t width = entry.type == PARAMETER_U8 ? 1 : entry.type == PARAMETER_U32 ? 4 : 2;
        for (unsigned b = 0; b < (unsigned)width * entry.count; b++) {
            TEST_ASSERT_FALSE_MESSAGE(covered[entry.offset + b], settings_name(i));
            covered[entry.offset + b] = true;
        }
    }
    for (unsigned b = 0; b < sizeof covered; b++) {
        count += covered[b] ? 0u : 1u;
    }
    /* step_ms is fixed; the rest can only be padding */
    TEST_ASSERT_LESS_THAN_UINT(20, count);
}

static void assigns_fixed_decimals(void)
{
    TEST_ASSERT_EQUAL(SETTINGS_OK, settings_assign(&settings, "loss_w_per_k", "0.0058"));
    TEST_ASSERT_EQUAL_UINT16(5800, settings.controller.model.loss_uw_per_k);
    TEST_ASSERT_EQUAL(SETTINGS_OK, settings_assign(&settings, "loss_scale_5", "1.02"));
    TEST_ASSERT_EQUAL_UINT16(1020, settings.controller.model.loss_scale_permille[4]);
    TEST_ASSERT_EQUAL(SETTINGS_OK, settings_assign(&settings, "ambient_c", "-12.5"));
    TEST_ASSERT_EQUAL_INT16(-1250, settings.board.ambient_cc);
}

static void a_refused_value_changes_nothing(void)
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
    for (unsigned i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        TEST_ASSERT_EQUAL_MESSAGE(cases[i].result,
                                  settings_assign(&settings, cases[i].name, cases[i].value),
                                  cases[i].value);
        TEST_ASSERT_EQUAL_MEMORY(&before, &settings, sizeof before);
    }
}

static void offset_names_the_setting(void)
{
    uint8_t index;
    uint8_t element;
    settings_entry_t entry;
    TEST_ASSERT_TRUE(settings_find_offset(
        (uint16_t)offsetof(controller_settings_t, model.loss_scale_permille[3]), &index, &element));
    settings_entry(index, &entry);
    TEST_ASSERT_EQUAL_STRING("loss_scale", settings_name(index));
    TEST_ASSERT_EQUAL_UINT8(3, element);
    TEST_ASSERT_FALSE(settings_find_offset(60000, &index, &element));
}

static void a_saved_record_is_loaded(void)
{
    TEST_ASSERT_EQUAL(SETTINGS_EMPTY, settings_load(&store, &storage, &settings));
    for (uint32_t seed = 1; seed < 6; seed++) {
        fill(seed);
        TEST_ASSERT_EQUAL(SETTINGS_SAVE_DONE, save(0));
        settings_t loaded;
        settings_store_t fresh;
        TEST_ASSERT_EQUAL(SETTINGS_LOADED, settings_load(&fresh, &storage, &loaded));
        TEST_ASSERT_TRUE(same(&settings, &loaded));
    }
}

static void sequence_numbers_may_wrap(void)
{
    store.sequence = 0xFFFE;
    for (uint32_t seed = 1; seed < 6; seed++) {
        fill(seed);
        TEST_ASSERT_EQUAL(SETTINGS_SAVE_DONE, save(0));
        settings_t loaded;
        TEST_ASSERT_EQUAL(SETTINGS_LOADED, settings_load(&store, &storage, &loaded));
        TEST_ASSERT_TRUE(same(&settings, &loaded));
    }
}

/* For every number of bytes that still reach the memory: the old record or the new one. */
static void a_cut_at_any_byte_leaves_the_old_or_the_new_record(void)
{
    static uint8_t before[MEMORY_BYTES];
    settings_t old_settings;
    settings_t new_settings;
    settings_t loaded;
    fill(1);
    TEST_ASSERT_EQUAL(SETTINGS_SAVE_DONE, save(0));
    fill(2);
    TEST_ASSERT_EQUAL(SETTINGS_SAVE_DONE, save(0));
    old_settings = settings;
    memcpy(before, memory, sizeof before);
    fill(3);
    new_settings = settings;
    const settings_store_t clean = store;
    TEST_ASSERT_EQUAL(SETTINGS_SAVE_DONE, save(0));
    const unsigned total = writes;
    TEST_ASSERT_GREATER_THAN_UINT(100, total);
    for (unsigned cut = 0; cut <= total; cut++) {
        memcpy(memory, before, sizeof before);
        store = clean;
        settings = new_settings;
        writes_left = cut;
        save(0);
        writes_left = UINT32_MAX;
        settings_store_t after;
        const settings_loaded_t result = settings_load(&after, &storage, &loaded);
        TEST_ASSERT_TRUE(result == SETTINGS_LOADED || result == SETTINGS_LOADED_OTHER);
        TEST_ASSERT_TRUE(same(&loaded, cut == total ? &new_settings : &old_settings));
        /* and the next save works */
        store = after;
        TEST_ASSERT_EQUAL(SETTINGS_SAVE_DONE, save(0));
        settings_load(&after, &storage, &loaded);
        TEST_ASSERT_TRUE(same(&loaded, &new_settings));
    }
}

/* The byte under way at the cut holds anything. */
static void a_torn_byte_leaves_the_old_or_the_new_record(void)
{
    static uint8_t before[MEMORY_BYTES];
    settings_t old_settings;
    settings_t loaded;
    fill(2);
    TEST_ASSERT_EQUAL(SETTINGS_SAVE_DONE, save(0));
    old_settings = settings;
    memcpy(before, memory, sizeof before);
    const settings_store_t clean = store;
    fill(3);
    const settings_t new_settings = settings;
    save(0);
    const unsigned total = writes;
    for (unsigned cut = 0; cut < total; cut++) {
        memcpy(memory, before, sizeof before);
        store = clean;
        settings = new_settings;
        writes_left = cut;
        save(0);
        /* the byte whose write was cut */
        const uint16_t address =
            cut == 0 || cut + 1u == total ? clean.base : (uint16_t)(clean.base + cut);
        memory[address] = (uint8_t)(cut * 37u + 11u);
        writes_left = UINT32_MAX;
        settings_load(&store, &storage, &loaded);
        TEST_ASSERT_TRUE(same(&loaded, &old_settings) || same(&loaded, &new_settings));
    }
}

static void every_flipped_bit_is_detected(void)
{
    settings_t loaded;
    fill(7);
    TEST_ASSERT_EQUAL(SETTINGS_SAVE_DONE, save(0));
    const unsigned bytes = writes; /* clearing, the record from byte 1 on, completing */
    for (unsigned bit = 0; bit < 8u * (bytes - 1u); bit++) {
        memory[bit / 8u] = (uint8_t)(memory[bit / 8u] ^ (1u << (bit % 8u)));
        settings_store_t fresh;
        const settings_loaded_t result = settings_load(&fresh, &storage, &loaded);
        TEST_ASSERT_TRUE_MESSAGE(result == SETTINGS_DAMAGED || result == SETTINGS_FOREIGN,
                                 "a flipped bit passed");
        memory[bit / 8u] = (uint8_t)(memory[bit / 8u] ^ (1u << (bit % 8u)));
    }
    settings_store_t fresh;
    TEST_ASSERT_EQUAL(SETTINGS_LOADED, settings_load(&fresh, &storage, &loaded));
}

static void a_damaged_newest_record_falls_back_to_the_older_and_says_so(void)
{
    settings_t old_settings;
    settings_t loaded;
    fill(1);
    save(0);
    old_settings = settings;
    fill(2);
    save(0);
    memory[SETTINGS_SLOT_BYTES + 20u] ^= 0x10u;
    TEST_ASSERT_EQUAL(SETTINGS_LOADED_OTHER, settings_load(&store, &storage, &loaded));
    TEST_ASSERT_TRUE(same(&loaded, &old_settings));
}

static void an_earlier_version_migrates(void)
{
    settings_t loaded;
    settings_t defaults;
    const uint8_t fewer = (uint8_t)(settings_count() - 5u);
    fill(9);
    TEST_ASSERT_EQUAL(SETTINGS_SAVE_DONE, save(fewer));
    TEST_ASSERT_EQUAL(SETTINGS_LOADED_MIGRATED, settings_load(&store, &storage, &loaded));
    settings_default(&defaults);
    for (uint8_t i = 0; i < settings_count(); i++) {
        TEST_ASSERT_EQUAL_INT32(settings_get(i < fewer ? &settings : &defaults, i, 0),
                                settings_get(&loaded, i, 0));
    }
}

static void a_later_version_gives_defaults_and_says_so(void)
{
    settings_t loaded;
    settings_t defaults;
    fill(9);
    save(0);
    memory[1] = 2;
    TEST_ASSERT_EQUAL(SETTINGS_FOREIGN, settings_load(&store, &storage, &loaded));
    settings_default(&defaults);
    TEST_ASSERT_TRUE(same(&loaded, &defaults));
}

/* As a firmware would have left it whose table has as many entries, one of them another: whole, and
 * each byte of it could be read as a value of ours. */
static void a_record_of_another_table_is_not_read(void)
{
    settings_t loaded;
    settings_t defaults;
    settings_entry_t entry;
    uint16_t size = 7;
    fill(9);
    save(0);
    for (uint8_t i = 0; i < settings_count(); i++) {
        settings_entry(i, &entry);
        size = (uint16_t)(size + entry.count * parameter_width(entry.type));
    }
    memory[4] ^= 1u; /* the fingerprint */
    const uint16_t crc = crc16_add_bytes(CRC16_START, &memory[1], (uint16_t)(size - 1u));
    memory[size] = (uint8_t)(crc & 0xFFu);
    memory[size + 1u] = (uint8_t)(crc >> 8);
    TEST_ASSERT_EQUAL(SETTINGS_FOREIGN, settings_load(&store, &storage, &loaded));
    settings_default(&defaults);
    TEST_ASSERT_TRUE(same(&loaded, &defaults));
}

static void a_memory_that_does_not_keep_is_reported(void)
{
    fill(4);
    worn = true;
    TEST_ASSERT_EQUAL(SETTINGS_SAVE_FAILED, save(0));
}

int main(void)
{
    UNITY_BEGIN();
    RUN_TEST(defaults_lie_within_the_limits_and_names_are_unique);
    RUN_TEST(every_byte_of_the_controller_settings_is_in_the_table);
    RUN_TEST(assigns_fixed_decimals);
    RUN_TEST(a_refused_value_changes_nothing);
    RUN_TEST(offset_names_the_setting);
    RUN_TEST(a_saved_record_is_loaded);
    RUN_TEST(sequence_numbers_may_wrap);
    RUN_TEST(a_cut_at_any_byte_leaves_the_old_or_the_new_record);
    RUN_TEST(a_torn_byte_leaves_the_old_or_the_new_record);
    RUN_TEST(every_flipped_bit_is_detected);
    RUN_TEST(a_damaged_newest_record_falls_back_to_the_older_and_says_so);
    RUN_TEST(an_earlier_version_migrates);
    RUN_TEST(a_later_version_gives_defaults_and_says_so);
    RUN_TEST(a_record_of_another_table_is_not_read);
    RUN_TEST(a_memory_that_does_not_keep_is_reported);
    return UNITY_END();
}
