/* patch_transform.c -- see patch_transform.h. */
#include "server/material/patch_transform.h"

#include <math.h>
#include <pthread.h>
#include <string.h>

static struct patch_basis basis;

/* 1 of frequency 0, else 3, 12, 48, 192. */
static float octave_count(int frequency) {
    int first = 1;
    while (2 * first <= frequency)
        first *= 2;
    return frequency == 0 ? 1.0f : 3.0f * (float)(first * first);
}

static void make_basis(void) {
    for (int k = 0; k < PATCH_SIDE; k++)
        for (int i = 0; i < PATCH_SIDE; i++)
            basis.cosine[k * PATCH_SIDE + i] = basis.transposed[i * PATCH_SIDE + k] =
                (float)(sqrt((k > 0 ? 2.0 : 1.0) / PATCH_SIDE) * cos(M_PI * (i + 0.5) * k / PATCH_SIDE));
    for (int y = 0; y < PATCH_SIDE; y++) {
        basis.window[y] = (float)sin(M_PI * (y + 0.5) / PATCH_SIDE);
        for (int x = 0; x < PATCH_SIDE; x++) {
            basis.length[y * PATCH_SIDE + x] = (int)lround(hypot(x, y));
            basis.octave_count[y * PATCH_SIDE + x] = octave_count(x > y ? x : y);
        }
    }
}

const struct patch_basis *patch_basis(void) {
    static pthread_once_t once = PTHREAD_ONCE_INIT;
    pthread_once(&once, make_basis);
    return &basis;
}

typedef float float4 __attribute__((vector_size(16)));

static float4 load4(const float *from) {
    float4 four;
    memcpy(&four, from, sizeof four);
    return four;
}

/* to = a b. A row is summed in four registers, which compilers do not make of an array by themselves. */
static void multiply(float to[PATCH_SIZE], const float a[PATCH_SIZE], const float b[PATCH_SIZE]) {
    for (int y = 0; y < PATCH_SIDE; y++) {
        float4 first = {0.0f}, second = first, third = first, fourth = first;
        for (int i = 0; i < PATCH_SIDE; i++) {
            float times = a[y * PATCH_SIDE + i];
            const float *row = b + i * PATCH_SIDE;
            first += times * load4(row);
            second += times * load4(row + 4);
            third += times * load4(row + 8);
            fourth += times * load4(row + 12);
        }
        const float4 sum[] = {first, second, third, fourth};
        memcpy(to + y * PATCH_SIDE, sum, sizeof sum);
    }
}

void patch_transform(const struct patch_basis *of, float patch[PATCH_SIZE]) {
    float rows[PATCH_SIZE];
    multiply(rows, patch, of->transposed);
    multiply(patch, of->cosine, rows);
}

void patch_transform_back(const struct patch_basis *of, float patch[PATCH_SIZE]) {
    float rows[PATCH_SIZE];
    multiply(rows, patch, of->cosine);
    multiply(patch, of->transposed, rows);
}
