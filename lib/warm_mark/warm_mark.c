#include "warm_mark.h"

#define ERASED 0xFFu
#define MARKED 0x00u

/* Of the first cell that is marked; WARM_MARK_BYTES: none is. */
static uint16_t marked(const record_storage_t *storage, uint16_t base)
{
    uint16_t cell = 0;
    while (cell < WARM_MARK_BYTES &&
           storage->read(storage->context, (uint16_t)(base + cell)) == ERASED) {
        cell++;
    }
    return cell;
}

bool warm_mark_is_set(const record_storage_t *storage, uint16_t base)
{
    return marked(storage, base) != WARM_MARK_BYTES;
}

void warm_mark_second(const record_storage_t *storage, uint16_t base, bool warm, uint32_t turn)
{
    if (!storage->ready(storage->context)) { /* nor could it be read at once */
        return;
    }
    const uint16_t cell = marked(storage, base);
    if (warm && cell == WARM_MARK_BYTES) {
        storage->write(storage->context, (uint16_t)(base + turn % WARM_MARK_BYTES), MARKED);
    } else if (!warm && cell != WARM_MARK_BYTES) {
        storage->write(storage->context, (uint16_t)(base + cell), ERASED);
    }
}
