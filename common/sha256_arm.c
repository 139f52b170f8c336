/* sha256_arm.c -- SHA-256 by the cryptographic extension of ARMv8 (Arm Architecture Reference Manual, SHA256H,
 * SHA256H2, SHA256SU0, SHA256SU1); NULL on processors without it. */
#include "common/sha256_blocks.h"

#if defined __aarch64__ && defined __AARCH64EL__

#include <arm_neon.h>
#include <sys/auxv.h>

#ifndef HWCAP_SHA2
#define HWCAP_SHA2 (1 << 6) /* asm/hwcap.h */
#endif

__attribute__((target("+crypto"))) static void blocks(uint32_t state[8], const uint8_t *data, size_t count) {
    uint32x4_t abcd = vld1q_u32(&state[0]), efgh = vld1q_u32(&state[4]);
    for (; count > 0; count--, data += 64) {
        uint32x4_t w[4], abcd_before = abcd, efgh_before = efgh;
#pragma GCC unroll 4 /* w stays in registers */
        for (int i = 0; i < 4; i++)
            w[i] = vreinterpretq_u32_u8(vrev32q_u8(vld1q_u8(data + 16 * i)));
#pragma GCC unroll 16
        for (int first = 0; first < 64; first += 4) {
            int i = first / 4 % 4;
            uint32x4_t sum = vaddq_u32(w[i], vld1q_u32(&sha256_round_constant[first])), abcd_now = abcd;
            if (first < 48) /* the words of the schedule for sixteen rounds later */
                w[i] = vsha256su1q_u32(vsha256su0q_u32(w[i], w[(i + 1) % 4]), w[(i + 2) % 4], w[(i + 3) % 4]);
            abcd = vsha256hq_u32(abcd, efgh, sum);
            efgh = vsha256h2q_u32(efgh, abcd_now, sum);
        }
        abcd = vaddq_u32(abcd, abcd_before);
        efgh = vaddq_u32(efgh, efgh_before);
    }
    vst1q_u32(&state[0], abcd);
    vst1q_u32(&state[4], efgh);
}

sha256_blocks *sha256_blocks_native(void) { return getauxval(AT_HWCAP) & HWCAP_SHA2 ? blocks : NULL; }

#elif !defined __x86_64__

sha256_blocks *sha256_blocks_native(void) { return NULL; }

#endif
