/* texture.c -- see texture.h. */
#include "server/scene/texture.h"

#include <string.h>

#include "common/mem.h"

void texture_init(struct texture *texture, const struct inverse_uv *inverse, rgb value) {
    texture->width = inverse->width;
    texture->height = inverse->height;
    size_t count = (size_t)inverse->width * inverse->height;
    texture->texel = mem_calloc_large(count, sizeof *texture->texel);
    for (size_t i = 0; i < count; i++) {
        if (inverse->triangle[i] == INVERSE_UV_NONE)
            continue;
        float *t = texture->texel[i];
        t[0] = value.r;
        t[1] = value.g;
        t[2] = value.b;
        t[3] = 1.0f;
    }
}

void texture_release(struct texture *texture) {
    mem_free(texture->texel);
    memset(texture, 0, sizeof *texture);
}

void texture_taps(const struct texture *texture, float x, float y, struct texture_taps *taps) {
    /* Texel centres are at +0.5; the clamp keeps the square of four inside the texture. */
    float right = (float)texture->width - 1.0f, bottom = (float)texture->height - 1.0f;
    float cx = clampf(x - 0.5f, 0.0f, right), cy = clampf(y - 0.5f, 0.0f, bottom);
    uint32_t i = (uint32_t)cx, j = (uint32_t)cy;
    float fx = cx - (float)i, fy = cy - (float)j;
    uint32_t step_x = i + 1 < texture->width ? 1 : 0;
    uint32_t step_y = j + 1 < texture->height ? texture->width : 0;
    uint32_t first = j * texture->width + i;
    uint32_t texel[4] = {first, first + step_x, first + step_y, first + step_x + step_y};
    float weight[4] = {(1.0f - fx) * (1.0f - fy), fx * (1.0f - fy), (1.0f - fx) * fy, fx * fy};
    float sum = 0.0f;
    uint32_t valid = first;
    for (int k = 0; k < 4; k++) {
        weight[k] *= texture->texel[texel[k]][3];
        sum += weight[k];
        if (weight[k] > 0.0f)
            valid = texel[k];
    }
    float scale = sum > 0.0f ? 1.0f / sum : 0.0f;
    for (int k = 0; k < 4; k++) {
        taps->weight[k] = weight[k] * scale;
        taps->texel[k] = weight[k] > 0.0f ? texel[k] : valid;
    }
}

rgb texture_gather(const struct texture *texture, const struct texture_taps *taps) {
    rgb sum = {0.0f, 0.0f, 0.0f};
    for (int k = 0; k < 4; k++) {
        const float *t = texture->texel[taps->texel[k]];
        sum = rgb_mad(sum, taps->weight[k], (rgb){t[0], t[1], t[2]});
    }
    return sum;
}
