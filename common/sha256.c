/* sha256.c -- see sha256.h. The round constants and initial state are those of FIPS 180-4,
 * sections 4.2.2 and 5.3.3. Whole blocks go to the processor's own instructions where it has them. */
#include "common/sha256.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <unistd.h>

#include "common/mem.h"
#include "common/sha256_blocks.h"

const uint32_t sha256_round_constant[64] = {
    0x428a2f98, 0x71374491, 0xb5c0fbcf, 0xe9b5dba5, 0x3956c25b, 0x59f111f1, 0x923f82a4, 0xab1c5ed5,
    0xd807aa98, 0x12835b01, 0x243185be, 0x550c7dc3, 0x72be5d74, 0x80deb1fe, 0x9bdc06a7, 0xc19bf174,
    0xe49b69c1, 0xefbe4786, 0x0fc19dc6, 0x240ca1cc, 0x2de92c6f, 0x4a7484aa, 0x5cb0a9dc, 0x76f988da,
    0x983e5152, 0xa831c66d, 0xb00327c8, 0xbf597fc7, 0xc6e00bf3, 0xd5a79147, 0x06ca6351, 0x14292967,
    0x27b70a85, 0x2e1b2138, 0x4d2c6dfc, 0x53380d13, 0x650a7354, 0x766a0abb, 0x81c2c92e, 0x92722c85,
    0xa2bfe8a1, 0xa81a664b, 0xc24b8b70, 0xc76c51a3, 0xd192e819, 0xd6990624, 0xf40e3585, 0x106aa070,
    0x19a4c116, 0x1e376c08, 0x2748774c, 0x34b0bcb5, 0x391c0cb3, 0x4ed8aa4a, 0x5b9cca4f, 0x682e6ff3,
    0x748f82ee, 0x78a5636f, 0x84c87814, 0x8cc70208, 0x90befffa, 0xa4506ceb, 0xbef9a3f7, 0xc67178f2,
};

void sha256_init(struct sha256 *s) {
    static const uint32_t initial[8] = {0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a,
                                        0x510e527f, 0x9b05688c, 0x1f83d9ab, 0x5be0cd19};
    memcpy(s->state, initial, sizeof initial);
    s->length = 0;
}

static uint32_t rotate(uint32_t value, int bits) { return value >> bits | value << (32 - bits); }

static void compress(uint32_t state[8], const uint8_t block[64]) {
    uint32_t w[64];
    for (int i = 0; i < 16; i++)
        w[i] = (uint32_t)block[4 * i] << 24 | (uint32_t)block[4 * i + 1] << 16 | (uint32_t)block[4 * i + 2] << 8 |
               block[4 * i + 3];
    for (int i = 16; i < 64; i++) {
        uint32_t s0 = rotate(w[i - 15], 7) ^ rotate(w[i - 15], 18) ^ w[i - 15] >> 3;
        uint32_t s1 = rotate(w[i - 2], 17) ^ rotate(w[i - 2], 19) ^ w[i - 2] >> 10;
        w[i] = w[i - 16] + s0 + w[i - 7] + s1;
    }
    uint32_t a = state[0], b = state[1], c = state[2], d = state[3];
    uint32_t e = state[4], f = state[5], g = state[6], h = state[7];
    for (int i = 0; i < 64; i++) {
        uint32_t s1 = rotate(e, 6) ^ rotate(e, 11) ^ rotate(e, 25);
        uint32_t t1 = h + s1 + ((e & f) ^ (~e & g)) + sha256_round_constant[i] + w[i];
        uint32_t s0 = rotate(a, 2) ^ rotate(a, 13) ^ rotate(a, 22);
        uint32_t t2 = s0 + ((a & b) ^ (a & c) ^ (b & c));
        h = g;
        g = f;
        f = e;
        e = d + t1;
        d = c;
        c = b;
        b = a;
        a = t1 + t2;
    }
    state[0] += a;
    state[1] += b;
    state[2] += c;
    state[3] += d;
    state[4] += e;
    state[5] += f;
    state[6] += g;
    state[7] += h;
}

void sha256_blocks_portable(uint32_t state[8], const uint8_t *data, size_t count) {
    for (; count > 0; count--, data += 64)
        compress(state, data);
}

void sha256_update(struct sha256 *s, const void *data, size_t length) {
    sha256_blocks *native = sha256_blocks_native(), *blocks = native ? native : sha256_blocks_portable;
    const uint8_t *at = data;
    size_t used = s->length % sizeof s->block;
    s->length += length;
    if (used > 0) {
        size_t room = sizeof s->block - used, part = length < room ? length : room;
        if (part > 0)
            memcpy(s->block + used, at, part);
        if (part < room)
            return;
        blocks(s->state, s->block, 1);
        at += part;
        length -= part;
    }
    size_t count = length / sizeof s->block, rest = length % sizeof s->block;
    blocks(s->state, at, count);
    if (rest > 0)
        memcpy(s->block, at + count * sizeof s->block, rest);
}

void sha256_hex(struct sha256 *s, char hex[SHA256_HEX_SIZE]) {
    static const char digit[16] = "0123456789abcdef";
    static const uint8_t padding[64] = {0x80};
    uint64_t bits = s->length * 8;
    size_t used = s->length % sizeof s->block;
    sha256_update(s, padding, used < 56 ? 56 - used : 120 - used);
    uint8_t tail[8];
    for (int i = 0; i < 8; i++)
        tail[i] = (uint8_t)(bits >> (56 - 8 * i));
    sha256_update(s, tail, sizeof tail);
    for (int i = 0; i < 64; i++)
        hex[i] = digit[s->state[i / 8] >> (28 - 4 * (i % 8)) & 15];
    hex[64] = '\0';
}

void sha256_of(const void *data, size_t length, char hex[SHA256_HEX_SIZE]) {
    struct sha256 s;
    sha256_init(&s);
    sha256_update(&s, data, length);
    sha256_hex(&s, hex);
}

enum status sha256_of_file(const char *path, char hex[SHA256_HEX_SIZE], struct error *err) {
    enum { CHUNK = 1 << 18 };
    int fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd < 0)
        return error_set_errno(err, errno, "cannot open %s", path);
    uint8_t *chunk = mem_alloc(CHUNK);
    enum status status = STATUS_OK;
    struct sha256 s;
    sha256_init(&s);
    for (;;) {
        ssize_t got = read(fd, chunk, CHUNK);
        if (got < 0 && errno == EINTR)
            continue;
        if (got < 0)
            status = error_set_errno(err, errno, "cannot read %s", path);
        if (got <= 0)
            break;
        sha256_update(&s, chunk, (size_t)got);
    }
    if (status == STATUS_OK)
        sha256_hex(&s, hex);
    mem_free(chunk);
    close(fd);
    return status;
}

bool sha256_equal(const char *a, const char *b) {
    unsigned char left[SHA256_HEX_SIZE] = {0}, right[SHA256_HEX_SIZE] = {0};
    strncpy((char *)left, a, SHA256_HEX_SIZE - 1);
    strncpy((char *)right, b, SHA256_HEX_SIZE - 1);
    volatile unsigned char different = left[SHA256_HEX_SIZE - 2] == '\0';
    for (size_t i = 0; i < SHA256_HEX_SIZE; i++)
        different = (unsigned char)(different | (left[i] ^ right[i]));
    return different == 0;
}

bool sha256_is_hex(const char *text) {
    return strspn(text, "0123456789abcdef") == SHA256_HEX_SIZE - 1 && text[SHA256_HEX_SIZE - 1] == '\0';
}
