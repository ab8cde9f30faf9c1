/* What it is for: thermal_model_pass_in_c, instruction by instruction, for the AVR: 2.6 times as
 * fast as the compiler's.
 * What it owns: every register while it runs.
 * What it never does: compute anything else than the C form; test/avr holds the two together. */
#ifndef THERMAL_MODEL_PASS_AVR_H
#define THERMAL_MODEL_PASS_AVR_H

#include "thermal_model_internal.h"

#include <stddef.h>

/* thermal_model_pass_in_c, instruction by instruction; test/avr holds the two
 * together.
 *
 * First loop   Y spring  Z block       X power   Second loop  Y spring  Z
 * state, X block's centre r2:5   common                        r12:14 lead_sum
 *   r6:7   air_lead                      r11    some spring is pending
 *   r8:11  air_flow
 *   r12    springs left                  r10    springs left
 *   r13    scratch                       r15    0
 *   r14    bit 0: extra, bit 1: rises
 *   r15    0
 *   r18:21 flow   r22:23, r24:25 factors   r16:17, r30:31 product */

#define MULTIPLY_ADD(sum0, sum1, sum2, sum3, a0, a1, b0, b1)                                       \
    "mul " a0 ", " b0 "\n\t"                                                                       \
    "add " sum0 ", r0\n\t"                                                                         \
    "adc " sum1 ", r1\n\t"                                                                         \
    "adc " sum2 ", r15\n\t"                                                                        \
    "adc " sum3 ", r15\n\t"                                                                        \
    "mul " a1 ", " b1 "\n\t"                                                                       \
    "add " sum2 ", r0\n\t"                                                                         \
    "adc " sum3 ", r1\n\t"                                                                         \
    "mul " a0 ", " b1 "\n\t"                                                                       \
    "add " sum1 ", r0\n\t"                                                                         \
    "adc " sum2 ", r1\n\t"                                                                         \
    "adc " sum3 ", r15\n\t"                                                                        \
    "mul " a1 ", " b0 "\n\t"                                                                       \
    "add " sum1 ", r0\n\t"                                                                         \
    "adc " sum2 ", r1\n\t"                                                                         \
    "adc " sum3 ", r15\n\t"

#define LOAD_SUM_OF_4(at0, at1, at2, at3)                                                          \
    "ldd r22, Z+" at0 "\n\t"                                                                       \
    "ldd r23, Z+" at0 "+1\n\t"                                                                     \
    "ldd r24, Z+" at1 "\n\t"                                                                       \
    "ldd r25, Z+" at1 "+1\n\t"                                                                     \
    "add r22, r24\n\t"                                                                             \
    "adc r23, r25\n\t"                                                                             \
    "ldd r24, Z+" at2 "\n\t"                                                                       \
    "ldd r25, Z+" at2 "+1\n\t"                                                                     \
    "add r22, r24\n\t"                                                                             \
    "adc r23, r25\n\t"                                                                             \
    "ldd r24, Z+" at3 "\n\t"                                                                       \
    "ldd r25, Z+" at3 "+1\n\t"                                                                     \
    "add r22, r24\n\t"                                                                             \
    "adc r23, r25\n\t"

/* block[1], [stride], [stride + 2], [2 stride + 1] and the corners, in bytes, for a stride of 5 */
#define SIDES   LOAD_SUM_OF_4("2", "10", "14", "22")
#define CORNERS LOAD_SUM_OF_4("0", "4", "20", "24")
#define CENTRE  "12"

typedef char frame_stride_must_be_5[THERMAL_MODEL_FRAME_STRIDE == 5 ? 1 : -1];
typedef char
    lead_limits_must_fit[THERMAL_MODEL_LOWEST_C7 == -5120 && LEAD_ORIGIN_C7 == -5122 ? 1 : -1];

#define SPRING(field) "I"(offsetof(thermal_model_spring_t, field))
#define STATE(field)  "I"(offsetof(thermal_model_spring_state_t, field))
#define PASS(field)   "I"(offsetof(thermal_model_pass_t, field))

static inline __attribute__((always_inline)) void thermal_model_pass(thermal_model_t *model)
{
    thermal_model_pass_t *pass = &model->pass;
    __asm__ volatile(
        "push r28\n\t"
        "push r29\n\t"
        "push r30\n\t"
        "push r31\n\t"
        "clr r15\n\t"
        "ldd r2, Z+%[common]\n\t"
        "ldd r3, Z+%[common]+1\n\t"
        "ldd r4, Z+%[common]+2\n\t"
        "ldd r5, Z+%[common]+3\n\t"
        "ldd r6, Z+%[air_lead]\n\t"
        "ldd r7, Z+%[air_lead]+1\n\t"
        "ldd r8, Z+%[air_flow]\n\t"
        "ldd r9, Z+%[air_flow]+1\n\t"
        "ldd r10, Z+%[air_flow]+2\n\t"
        "ldd r11, Z+%[air_flow]+3\n\t"
        "ldd r12, Z+%[count]\n\t"
        "ldd r14, Z+%[flags]\n\t"
        "movw r28, r30\n\t"
        "subi r28, lo8(%[to_spring])\n\t"
        "sbci r29, hi8(%[to_spring])\n\t"
        "ldd r26, Z+%[power]\n\t"
        "ldd r27, Z+%[power]+1\n\t"

        "1:\n\t" /* power, held at 2^23 - 1, times 64 */
        "ld r19, X+\n\t"
        "ld r20, X+\n\t"
        "ld r21, X+\n\t"
        "ld r22, X+\n\t"
        "cpi r21, 0x80\n\t"
        "cpc r22, r15\n\t"
        "brcs 2f\n\t"
        "ldi r19, 0xff\n\t"
        "ldi r20, 0xff\n\t"
        "ldi r21, 0x7f\n\t"
        "2:\n\t"
        "clr r18\n\t"
        "lsr r21\n\t"
        "ror r20\n\t"
        "ror r19\n\t"
        "ror r18\n\t"
        "lsr r21\n\t"
        "ror r20\n\t"
        "ror r19\n\t"
        "ror r18\n\t"
        "add r18, r2\n\t"
        "adc r19, r3\n\t"
        "adc r20, r4\n\t"
        "adc r21, r5\n\t"
        "sbrc r14, 0\n\t"
        "rjmp 20f\n\t"
        "3:\n\t"
        "ldd r30, Y+%[block]\n\t"
        "ldd r31, Y+%[block]+1\n\t"
        "add r30, r28\n\t"
        "adc r31, r29\n\t"
        /* neighbours */
        SIDES "ldd r24, Y+%[orthogonal]\n\t"
        "ldd r25, Y+%[orthogonal]+1\n\t" MULTIPLY_ADD("r18", "r19", "r20", "r21", "r22", "r23",
                                                      "r24", "r25") CORNERS
        "ldd r24, Y+%[diagonal]\n\t"
        "ldd r25, Y+%[diagonal]+1\n\t" MULTIPLY_ADD("r18", "r19", "r20", "r21", "r22", "r23", "r24",
                                                    "r25")
        /* less what the spring conducts away */
        "ldd r22, Z+" CENTRE "\n\t"
        "ldd r23, Z+" CENTRE "+1\n\t"
        "ldd r24, Y+%[conduction]\n\t"
        "ldd r25, Y+%[conduction]+1\n\t"
        "mul r22, r24\n\t"
        "sub r18, r0\n\t"
        "sbc r19, r1\n\t"
        "sbc r20, r15\n\t"
        "sbc r21, r15\n\t"
        "mul r23, r25\n\t"
        "sub r20, r0\n\t"
        "sbc r21, r1\n\t"
        "mul r22, r25\n\t"
        "sub r19, r0\n\t"
        "sbc r20, r1\n\t"
        "sbc r21, r15\n\t"
        "mul r23, r24\n\t"
        "sub r19, r0\n\t"
        "sbc r20, r1\n\t"
        "sbc r21, r15\n\t"
        /* loss to the air */
        "sub r22, r6\n\t"
        "sbc r23, r7\n\t"
        "ldd r24, Y+%[loss]\n\t"
        "ldd r25, Y+%[loss]+1\n\t"
        "sbrc r14, 1\n\t"
        "rjmp 21f\n\t"
        "4:\n\t"
        "mul r22, r24\n\t"
        "movw r16, r0\n\t"
        "mul r23, r25\n\t"
        "movw r30, r0\n\t"
        "mul r22, r25\n\t"
        "add r17, r0\n\t"
        "adc r30, r1\n\t"
        "adc r31, r15\n\t"
        "mul r23, r24\n\t"
        "add r17, r0\n\t"
        "adc r30, r1\n\t"
        "adc r31, r15\n\t"
        "sbrc r23, 7\n\t"
        "rjmp 22f\n\t"
        "5:\n\t"
        "sub r18, r16\n\t"
        "sbc r19, r17\n\t"
        "sbc r20, r30\n\t"
        "sbc r21, r31\n\t"
        "clr r13\n\t"
        "sbrc r31, 7\n\t"
        "com r13\n\t"
        "add r8, r17\n\t"
        "adc r9, r30\n\t"
        "adc r10, r31\n\t"
        "adc r11, r13\n\t"
        /* flow / 2^8 (r19:21) times step_gain / 2^16, as fixed_point_scale_s24 */
        "ldd r22, Y+%[step_gain]\n\t"
        "ldd r23, Y+%[step_gain]+1\n\t"
        "ldd r24, Y+%[step_gain]+2\n\t"
        "mul r20, r23\n\t"
        "movw r16, r0\n\t"
        "mul r21, r24\n\t"
        "movw r30, r0\n\t"
        "mul r19, r23\n\t"
        "mov r13, r0\n\t"
        "add r16, r1\n\t"
        "adc r17, r15\n\t"
        "adc r30, r15\n\t"
        "adc r31, r15\n\t"
        "mul r20, r22\n\t"
        "add r16, r1\n\t"
        "adc r17, r15\n\t"
        "adc r30, r15\n\t"
        "adc r31, r15\n\t"
        "mul r19, r24\n\t"
        "add r16, r0\n\t"
        "adc r17, r1\n\t"
        "adc r30, r15\n\t"
        "adc r31, r15\n\t"
        "mul r21, r22\n\t"
        "add r16, r0\n\t"
        "adc r17, r1\n\t"
        "adc r30, r15\n\t"
        "adc r31, r15\n\t"
        "mul r20, r24\n\t"
        "add r17, r0\n\t"
        "adc r30, r1\n\t"
        "adc r31, r15\n\t"
        "mul r21, r23\n\t"
        "add r17, r0\n\t"
        "adc r30, r1\n\t"
        "adc r31, r15\n\t"
        "sbrc r21, 7\n\t"
        "rjmp 23f\n\t"
        "6:\n\t"
        "std Y+%[gain], r16\n\t"
        "std Y+%[gain]+1, r17\n\t"
        "std Y+%[gain]+2, r30\n\t"
        "std Y+%[gain]+3, r31\n\t"
        "adiw r28, %[spring_size]\n\t"
        "dec r12\n\t"
        "breq 7f\n\t"
        "rjmp 1b\n\t"

        "20:\n\t" /* a flow of its own to begin with */
        "ldd r22, Y+%[gain]\n\t"
        "ldd r23, Y+%[gain]+1\n\t"
        "ldd r24, Y+%[gain]+2\n\t"
        "ldd r25, Y+%[gain]+3\n\t"
        "add r18, r22\n\t"
        "adc r19, r23\n\t"
        "adc r20, r24\n\t"
        "adc r21, r25\n\t"
        "rjmp 3b\n\t"
        "21:\n\t" /* a loss that rises */
        "sbrc r23, 7\n\t"
        "rjmp 4b\n\t"
        "push r26\n\t"
        "push r27\n\t"
        "ldd r26, Y+%[rise]\n\t"
        "ldd r27, Y+%[rise]+1\n\t"
        "mul r22, r26\n\t"
        "mov r13, r1\n\t"
        "mul r23, r27\n\t"
        "movw r30, r0\n\t"
        "mul r22, r27\n\t"
        "add r13, r0\n\t"
        "adc r30, r1\n\t"
        "adc r31, r15\n\t"
        "mul r23, r26\n\t"
        "add r13, r0\n\t"
        "adc r30, r1\n\t"
        "adc r31, r15\n\t"
        "add r24, r30\n\t"
        "adc r25, r31\n\t"
        "pop r27\n\t"
        "pop r26\n\t"
        "rjmp 4b\n\t"
        "22:\n\t" /* signs */
        "sub r30, r24\n\t"
        "sbc r31, r25\n\t"
        "rjmp 5b\n\t"
        "23:\n\t"
        "sub r17, r22\n\t"
        "sbc r30, r23\n\t"
        "sbc r31, r24\n\t"
        "rjmp 6b\n\t"

        "7:\n\t" /* air's flow back; then what the gains do */
        "pop r31\n\t"
        "pop r30\n\t"
        "push r30\n\t"
        "push r31\n\t"
        "std Z+%[air_flow], r8\n\t"
        "std Z+%[air_flow]+1, r9\n\t"
        "std Z+%[air_flow]+2, r10\n\t"
        "std Z+%[air_flow]+3, r11\n\t"
        "ldd r10, Z+%[count]\n\t"
        "movw r28, r30\n\t"
        "subi r28, lo8(%[to_spring])\n\t"
        "sbci r29, hi8(%[to_spring])\n\t"
        "subi r30, lo8(%[to_state])\n\t"
        "sbci r31, hi8(%[to_state])\n\t"
        "clr r11\n\t"
        "clr r12\n\t"
        "clr r13\n\t"
        "clr r14\n\t"

        "8:\n\t"
        "ldd r26, Y+%[block]\n\t"
        "ldd r27, Y+%[block]+1\n\t"
        "add r26, r28\n\t"
        "adc r27, r29\n\t"
        "adiw r26, " CENTRE "\n\t"
        "ldd r18, Z+%[temperature]\n\t"
        "ldd r19, Z+%[temperature]+1\n\t"
        "ldd r20, Z+%[temperature]+2\n\t"
        "ldd r21, Z+%[temperature]+3\n\t"
        "movw r16, r20\n\t" /* before */
        "ldd r22, Y+%[gain]\n\t"
        "ldd r23, Y+%[gain]+1\n\t"
        "ldd r24, Y+%[gain]+2\n\t"
        "ldd r25, Y+%[gain]+3\n\t"
        "add r18, r22\n\t"
        "adc r19, r23\n\t"
        "adc r20, r24\n\t"
        "adc r21, r25\n\t"
        "brvc 9f\n\t"
        "ldi r18, 0xff\n\t"
        "ldi r19, 0xff\n\t"
        "ldi r20, 0xff\n\t"
        "ldi r21, 0x7f\n\t"
        "sbrs r25, 7\n\t"
        "rjmp 9f\n\t"
        "ldi r18, 0\n\t"
        "ldi r19, 0\n\t"
        "ldi r20, 0\n\t"
        "ldi r21, 0x80\n\t"
        "9:\n\t"
        "ldd r22, Z+%[heating]\n\t"
        "ldd r23, Z+%[heating]+1\n\t"
        "cp r22, r20\n\t"
        "cpc r23, r21\n\t"
        "brlt 11f\n\t"
        "ldd r22, Z+%[cooling]\n\t"
        "ldd r23, Z+%[cooling]+1\n\t"
        "cp r20, r22\n\t"
        "cpc r21, r23\n\t"
        "brlt 11f\n\t"
        "std Z+%[temperature], r18\n\t"
        "std Z+%[temperature]+1, r19\n\t"
        "std Z+%[temperature]+2, r20\n\t"
        "std Z+%[temperature]+3, r21\n\t"
        "movw r24, r20\n\t"
        "sub r24, r16\n\t"
        "sbc r25, r17\n\t"
        "asr r25\n\t"
        "ror r24\n\t"
        "add r24, r20\n\t"
        "adc r25, r21\n\t"
        /* lead: from -5122 .. 27645 to 0 .. 16383 */
        "subi r24, -2\n\t"
        "sbci r25, -21\n\t"
        "brmi 12f\n\t"
        "lsr r25\n\t"
        "ror r24\n\t"
        "10:\n\t"
        "st X+, r24\n\t"
        "st X, r25\n\t"
        "13:\n\t"
        "add r12, r24\n\t"
        "adc r13, r25\n\t"
        "adc r14, r15\n\t"
        "adiw r28, %[spring_size]\n\t"
        "adiw r30, %[state_size]\n\t"
        "dec r10\n\t"
        "breq 14f\n\t"
        "rjmp 8b\n\t"

        "11:\n\t" /* past a threshold */
        "ldi r22, 1\n\t"
        "mov r11, r22\n\t"
        "std Y+%[pending_spring], r22\n\t"
        "ld r24, X+\n\t"
        "ld r25, X\n\t"
        "rjmp 13b\n\t"
        "12:\n\t" /* outside what a lead holds, below if it fell */
        "ldi r24, 0\n\t"
        "ldi r25, 0\n\t"
        "cp r20, r16\n\t"
        "cpc r21, r17\n\t"
        "brlt 10b\n\t"
        "ldi r24, 0xff\n\t"
        "ldi r25, 0x3f\n\t"
        "rjmp 10b\n\t"

        "14:\n\t"
        "pop r31\n\t"
        "pop r30\n\t"
        "std Z+%[lead_sum], r12\n\t"
        "std Z+%[lead_sum]+1, r13\n\t"
        "std Z+%[lead_sum]+2, r14\n\t"
        "std Z+%[lead_sum]+3, r15\n\t"
        "std Z+%[pending], r11\n\t"
        "pop r29\n\t"
        "pop r28\n\t"
        "clr r1\n\t"
        : "+z"(pass)
        : [common] PASS(common), [air_lead] PASS(air_lead), [air_flow] PASS(air_flow),
          [count] PASS(count), [flags] PASS(flags),
          [to_spring] "n"(offsetof(thermal_model_t, pass) - offsetof(thermal_model_t, spring)),
          [to_state] "n"(offsetof(thermal_model_t, pass) - offsetof(thermal_model_t, state.spring)),
          [power] PASS(power_uw), [lead_sum] PASS(lead_sum), [pending] PASS(pending),
          [gain] SPRING(gain_c23), [block] SPRING(block_offset), [orthogonal] SPRING(orthogonal),
          [diagonal] SPRING(diagonal), [conduction] SPRING(conduction), [loss] SPRING(loss),
          [rise] SPRING(loss_rise), [step_gain] SPRING(step_gain), [pending_spring] SPRING(pending),
          [spring_size] "I"(sizeof(thermal_model_spring_t)), [temperature] STATE(temperature_c23),
          [heating] STATE(heating_c7), [cooling] STATE(cooling_c7),
          [state_size] "I"(sizeof(thermal_model_spring_state_t))
        : "r0", "r2", "r3", "r4", "r5", "r6", "r7", "r8", "r9", "r10", "r11", "r12", "r13", "r14",
          "r15", "r16", "r17", "r18", "r19", "r20", "r21", "r22", "r23", "r24", "r25", "r26", "r27",
          "memory");
}

#endif
