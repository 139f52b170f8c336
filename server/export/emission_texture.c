/* emission_texture.c -- see emission_texture.h. */
#include "server/export/emission_texture.h"

#include <math.h>

#include "common/mem.h"

static uint32_t segment_of_texel(const struct export_input *input, size_t texel) {
    return input->segments->of_triangle[input->inverse->triangle[texel]];
}

float *emission_texture_scales(const struct export_input *input) {
    const struct materials *m = input->materials;
    if (!m->emission_pattern)
        return NULL;
    float *scale = mem_calloc(input->segments->count, sizeof *scale);
    for (size_t i = 0; i < input->inverse->valid_count; i++) {
        uint32_t texel = input->inverse->valid[i], s = segment_of_texel(input, texel);
        if (!rgb_is_black(rgb_from_half(m->emission_pattern[texel])))
            scale[s] = fmaxf(scale[s], rgb_max(materials_emission_of_texel(m, s, texel)));
    }
    return scale;
}

void emission_texture(const struct export_input *input, const uint32_t *source, const float *scales,
                      struct image *image) {
    const struct inverse_uv *inverse = input->inverse;
    image_init_rgb(image, inverse->width, inverse->height);
    for (size_t i = 0; i < (size_t)inverse->width * inverse->height; i++) {
        uint32_t from = source[i];
        if (from == INVERSE_UV_NONE)
            continue;
        uint32_t s = segment_of_texel(input, from);
        if (!(scales[s] > 0.0f))
            continue;
        rgb relative = rgb_scale(materials_emission_of_texel(input->materials, s, from), 1.0f / scales[s]);
        float *pixel = image->pixel + 3 * i;
        pixel[0] = relative.r;
        pixel[1] = relative.g;
        pixel[2] = relative.b;
    }
}
