#include "console_internal.h"

#include <stddef.h>

/* As spring_sight_kind_t has them. */
static const char kinds[] FLASH_MEMORY = "it begins to transform\0"
                                         "it has transformed\0"
                                         "its heating ends, no finish seen\0"
                                         "it loses phase\0"
                                         "it loses no phase: no colder than that\0"
                                         "it still transforms: no hotter than that\0"
                                         "its contact or sensor jumps\0"
                                         "its phase is read, by what was learnt\0"
                                         "it is said to be known\0"
                                         "it must have cooled by now\0"
                                         "what was believed had changed by itself: it begins anew";

/* As SPRING_DID_ has them. */
static const char deeds[] FLASH_MEMORY = "heated\0"
                                         "held\0"
                                         "blind\0"
                                         "a step of the surroundings\0"
                                         "phase seems to be missing";

/* "12.3 s ago: it loses phase, reads 1.32 % less than predicted (sd 0.05)" */
static void add_sight(text_line_t *line, const spring_sight_t *sight, uint16_t age_turns)
{
    const int32_t ds = (int32_t)age_turns * (10 / 2) / (int32_t)(SPRING_SIGHTS_TURNS_PER_S / 2u);
    text_add_values(line, FLASH_TEXT("  #1 s ago: "), &ds);
    text_add_flash(line, text_item(kinds, sight->kind));
    if (sight->read_sd != 0) {
        const int32_t values[] = {sight->read < 0 ? -sight->read : sight->read, sight->read_sd};
        text_add_values(line, FLASH_TEXT(", reads #2 % "), values);
        text_add_flash(line, sight->read < 0 ? FLASH_TEXT("less") : FLASH_TEXT("more"));
        text_add_values(line, FLASH_TEXT(" than predicted (sd #2)"), values + 1);
    }
}

/* "2.4 K above (sd 1.8)" */
static void add_distance(text_line_t *line, int16_t distance_dk, uint8_t sd_dk)
{
    const int32_t values[] = {distance_dk < 0 ? -distance_dk : distance_dk, sd_dk};
    text_add_values(line, FLASH_TEXT("#1 K "), values);
    text_add_flash(line, distance_dk < 0 ? FLASH_TEXT("below") : FLASH_TEXT("above"));
    text_add_values(line, FLASH_TEXT(" (sd #1)"), values + 1);
}

/* "from martensite start: believed 2.4 K above (sd 1.8), seen 0.8 K below (sd 1.1), now ..." */
static void add_places(text_line_t *line, const spring_sight_t *sight)
{
    text_add_flash(line, FLASH_TEXT("    of martensite start: "));
    if (sight->believed_sd != 0) {
        text_add_flash(line, FLASH_TEXT("believed "));
        add_distance(line, sight->believed, sight->believed_sd);
        text_add_flash(line, FLASH_TEXT(", "));
    }
    if (sight->seen_sd != 0) {
        text_add_flash(line, FLASH_TEXT("seen "));
        add_distance(line, sight->seen, sight->seen_sd);
        text_add_flash(line, FLASH_TEXT(", "));
    }
    text_add_flash(line, FLASH_TEXT("now "));
    add_distance(line, sight->now, sight->now_sd);
}

/* "moved -2.3 K, shift 0.4 K, loss 1.20 %; heated" */
static void add_deeds(text_line_t *line, const spring_sight_t *sight)
{
    const int32_t values[] = {sight->believed_sd != 0 ? sight->now - sight->believed : 0,
                              sight->shift, sight->loss};
    text_add_values(line, FLASH_TEXT("    moved #1 K, shift #1 K, loss #2 %"), values);
    char separator = ';';
    for (uint8_t i = 0; i < 5u; i++) {
        if (((unsigned)sight->did >> i & 1u) != 0) {
            text_add_char(line, separator);
            text_add_char(line, ' ');
            text_add_flash(line, text_item(deeds, i));
            separator = ',';
        }
    }
}

/* Three lines for each of its sights, the oldest first, by console->step: FIRST or NEXT, PLACES,
 * DEEDS. One that has given way to others in the middle of its lines is left there. */
enum { FIRST = 0, PLACES, DEEDS, NEXT, ENDED };

bool console_why_line(console_t *console, console_out_t *out)
{
    const spring_sights_t *const sights = controller_sights(console->controller);
    const spring_sight_t *const sight =
        spring_sights_from(sights, console->element, console->sight);
    text_line_t *const line = &out->line;
    if (console->step == FIRST && sight == NULL) {
        const int32_t number = console->element + 1;
        text_add_values(line, FLASH_TEXT("[nothing was seen of spring #0 in the last 4 hours]"),
                        &number);
        console->step = ENDED - 1;
        return true;
    }
    if (console->step == ENDED || sight == NULL) {
        return false;
    }
    if (console->step == PLACES && sight->number == console->sight) {
        add_places(line, sight);
    } else if (console->step == DEEDS && sight->number == console->sight) {
        add_deeds(line, sight);
        console->sight++;
    } else {
        add_sight(line, sight, spring_sights_age_turns(sights, sight));
        console->sight = sight->number;
        console->step = PLACES - 1;
    }
    return true;
}
