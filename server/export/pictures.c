/* pictures.c -- see pictures.h. */
#include "server/export/pictures.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"
#include "common/quantile.h"
#include "common/vec.h"
#include "server/scene/latlong.h"

#define COMPARISON_GAP 4 /* pixels between the pictures */

/* --- margin: nearest valid texel -------------------------------------------------------------- */

struct margin {
    uint32_t width, height;
    uint32_t *source;
};

/* Takes the neighbour's source at (x + dx, y + dy) if it is nearer. */
static void margin_offer(struct margin *m, uint32_t x, uint32_t y, int dx, int dy) {
    int64_t nx = (int64_t)x + dx, ny = (int64_t)y + dy;
    if (nx < 0 || ny < 0 || nx >= m->width || ny >= m->height)
        return;
    uint32_t offered = m->source[(size_t)ny * m->width + (size_t)nx];
    if (offered == INVERSE_UV_NONE)
        return;
    size_t here = (size_t)y * m->width + x;
    int64_t ox = (int64_t)(offered % m->width) - x, oy = (int64_t)(offered / m->width) - y;
    int64_t distance = ox * ox + oy * oy;
    if (distance > (int64_t)EXPORT_MARGIN * EXPORT_MARGIN)
        return;
    uint32_t present = m->source[here];
    if (present != INVERSE_UV_NONE) {
        int64_t px = (int64_t)(present % m->width) - x, py = (int64_t)(present / m->width) - y;
        if (px * px + py * py <= distance)
            return;
    }
    m->source[here] = offered;
}

/* Vector distance propagation in two raster sweeps (Danielsson 1980): exact except for rare near-ties, which are
 * harmless. */
uint32_t *picture_margin(const struct inverse_uv *inverse) {
    size_t count = (size_t)inverse->width * inverse->height;
    struct margin m = {inverse->width, inverse->height, mem_array(count, sizeof *m.source)};
    for (size_t i = 0; i < count; i++)
        m.source[i] = inverse->triangle[i] == INVERSE_UV_NONE ? INVERSE_UV_NONE : (uint32_t)i;
    for (uint32_t y = 0; y < m.height; y++) {
        for (uint32_t x = 0; x < m.width; x++) {
            margin_offer(&m, x, y, -1, -1);
            margin_offer(&m, x, y, 0, -1);
            margin_offer(&m, x, y, 1, -1);
            margin_offer(&m, x, y, -1, 0);
        }
        for (uint32_t x = m.width; x-- > 0;)
            margin_offer(&m, x, y, 1, 0);
    }
    for (uint32_t y = m.height; y-- > 0;) {
        for (uint32_t x = m.width; x-- > 0;) {
            margin_offer(&m, x, y, 1, 1);
            margin_offer(&m, x, y, 0, 1);
            margin_offer(&m, x, y, -1, 1);
            margin_offer(&m, x, y, 1, 0);
        }
        for (uint32_t x = 0; x < m.width; x++)
            margin_offer(&m, x, y, -1, 0);
    }
    return m.source;
}

/* --- textures at full size ---------------------------------------------------------------- */

static uint32_t segment_of_texel(const struct export_input *input, size_t texel) {
    return input->segments->of_triangle[input->inverse->triangle[texel]];
}

/* Value of a valid texel; scalar kinds fill all three channels. */
static rgb value_at(const struct export_input *input, enum picture_kind kind, size_t texel) {
    const struct materials *m = input->materials;
    switch (kind) {
    case PICTURE_BASE_COLOR: {
        const float *c = m->base_color.texel[texel];
        return rgb_make(c[0], c[1], c[2]);
    }
    case PICTURE_EMISSION: return materials_emission_of_texel(m, segment_of_texel(input, texel), texel);
    case PICTURE_ROUGHNESS: return rgb_gray(m->roughness[segment_of_texel(input, texel)]);
    case PICTURE_SPECULAR: return rgb_gray(m->specular[segment_of_texel(input, texel)]);
    case PICTURE_CONFIDENCE: break;
    }
    return materials_deviation(m, texel);
}

void picture_texture(const struct export_input *input, enum picture_kind kind, const uint32_t *source,
                     struct image *image) {
    static const char *const rgb_channel[] = {"R", "G", "B"};
    static const char *const gray_channel[] = {"Y"};
    static const struct {
        uint32_t count;
        const char *const *name;
    } channels[] = {
        [PICTURE_BASE_COLOR] = {3, rgb_channel}, [PICTURE_EMISSION] = {3, rgb_channel},
        [PICTURE_ROUGHNESS] = {1, gray_channel}, [PICTURE_SPECULAR] = {1, gray_channel},
        [PICTURE_CONFIDENCE] = {3, rgb_channel},
    };
    const struct inverse_uv *inverse = input->inverse;
    uint32_t channel_count = channels[kind].count;
    image_init(image, inverse->width, inverse->height, channel_count, channels[kind].name);
    size_t count = (size_t)inverse->width * inverse->height;
    for (size_t i = 0; i < count; i++) {
        uint32_t from = source[i];
        if (from == INVERSE_UV_NONE || (kind == PICTURE_CONFIDENCE && from != i))
            continue;
        rgb value = value_at(input, kind, from);
        float channel[3] = {value.r, value.g, value.b};
        memcpy(&image->pixel[i * channel_count], channel, channel_count * sizeof *channel);
    }
}

/* --- previews ----------------------------------------------------------------------------- */

/* Five anchors of the viridis map (van der Walt and Smith 2015), sRGB values. */
static rgb ramp(float t) {
    static const rgb anchor[5] = {{0.267f, 0.005f, 0.329f},
                                  {0.231f, 0.322f, 0.545f},
                                  {0.128f, 0.567f, 0.551f},
                                  {0.369f, 0.789f, 0.383f},
                                  {0.993f, 0.906f, 0.144f}};
    float place = clampf(t, 0.0f, 1.0f) * 4.0f;
    int i = place >= 3.0f ? 3 : (int)place;
    float f = place - (float)i;
    rgb c = rgb_mad(rgb_scale(anchor[i], 1.0f - f), f, anchor[i + 1]);
    return rgb_make(image_srgb_to_linear(c.r), image_srgb_to_linear(c.g), image_srgb_to_linear(c.b));
}

/* Standard deviations at the ends of the preview's scale. */
#define DEVIATION_MIN 0.01f
#define DEVIATION_MAX 0.2f

/* Display colour of a mean value. */
static rgb show(enum picture_kind kind, rgb value) {
    switch (kind) {
    case PICTURE_BASE_COLOR: return value;
    case PICTURE_EMISSION: return rgb_scale(value, 1.0f / (1.0f + rgb_max(value)));
    case PICTURE_ROUGHNESS:
    case PICTURE_SPECULAR: return rgb_gray(image_srgb_to_linear(value.r));
    case PICTURE_CONFIDENCE: break;
    }
    return ramp(logf(DEVIATION_MAX / rgb_mean(value)) / logf(DEVIATION_MAX / DEVIATION_MIN));
}

typedef rgb texel_value(const void *user, size_t texel);
typedef rgb texel_look(const void *user, rgb mean);

/* Means of value() over valid texels, as look() shows them. */
static void shrink(const struct inverse_uv *inverse, texel_value *value, texel_look *look, const void *user,
                   struct image *image) {
    uint32_t larger = inverse->width > inverse->height ? inverse->width : inverse->height;
    uint32_t step = (larger + EXPORT_PREVIEW_SIZE - 1) / EXPORT_PREVIEW_SIZE;
    uint32_t width = (inverse->width + step - 1) / step;
    uint32_t height = (inverse->height + step - 1) / step;
    const rgb nothing = {0.012f, 0.012f, 0.015f};
    image_init_rgb(image, width, height);
    for (uint32_t y = 0; y < height; y++) {
        for (uint32_t x = 0; x < width; x++) {
            rgb sum = {0.0f, 0.0f, 0.0f};
            int valid = 0;
            for (uint32_t j = y * step; j < (y + 1) * step && j < inverse->height; j++) {
                for (uint32_t i = x * step; i < (x + 1) * step && i < inverse->width; i++) {
                    size_t texel = (size_t)j * inverse->width + i;
                    if (inverse->triangle[texel] == INVERSE_UV_NONE)
                        continue;
                    sum = rgb_add(sum, value(user, texel));
                    valid++;
                }
            }
            rgb c = valid ? look(user, rgb_scale(sum, 1.0f / (float)valid)) : nothing;
            float *pixel = &image->pixel[((size_t)y * width + x) * 3];
            pixel[0] = c.r;
            pixel[1] = c.g;
            pixel[2] = c.b;
        }
    }
}

struct preview {
    const struct export_input *input;
    enum picture_kind kind;
};

static rgb preview_value(const void *user, size_t texel) {
    const struct preview *p = user;
    return value_at(p->input, p->kind, texel);
}

static rgb preview_look(const void *user, rgb mean) {
    const struct preview *p = user;
    return show(p->kind, mean);
}

void picture_preview(const struct export_input *input, enum picture_kind kind, struct image *image) {
    const struct inverse_uv *inverse = input->inverse;
    struct preview p = {input, kind};
    shrink(inverse, preview_value, preview_look, &p, image);
}

#define RADIANCE_GRAY 0.2f /* of the median */
#define RADIANCE_EVERY 16  /* texels, for the median */

struct radiance {
    const uint16_t (*texel)[3];
    float scale;
};

static rgb radiance_value(const void *user, size_t texel) {
    return rgb_from_half(((const struct radiance *)user)->texel[texel]);
}

static rgb radiance_look(const void *user, rgb mean) { return rgb_scale(mean, ((const struct radiance *)user)->scale); }

void picture_radiance(const struct export_input *input, struct image *image) {
    const struct inverse_uv *inverse = input->inverse;
    struct radiance radiance = {input->radiance, 1.0f};
    float *luminance = mem_array(inverse->valid_count / RADIANCE_EVERY + 1, sizeof *luminance);
    size_t count = 0;
    for (size_t i = 0; i < inverse->valid_count; i += RADIANCE_EVERY) {
        float l = rgb_luminance(rgb_from_half(input->radiance[inverse->valid[i]]));
        if (l > 0.0f)
            luminance[count++] = l;
    }
    if (count > 0)
        radiance.scale = RADIANCE_GRAY / quantile(luminance, count, 0.5);
    mem_free(luminance);
    shrink(inverse, radiance_value, radiance_look, &radiance, image);
}

#define ENVIRONMENT_GRAY 0.2f /* linear value of the typical luminance */

void picture_environment(const struct export_input *input, struct image *image) {
    const struct image *map = input->environment, *known = input->environment_confidence;
    uint32_t step = (map->width + EXPORT_PREVIEW_SIZE - 1) / EXPORT_PREVIEW_SIZE;
    double roots = 0.0, seen = 0.0; /* mean of square roots: robust to the sun */
    for (size_t i = 0; i < (size_t)map->width * map->height; i++) {
        const float *p = map->pixel + i * map->channel_count;
        if (known->pixel[i * known->channel_count] > 0.0f) {
            double angle = latlong_pixel_angle(map->width, map->height, (uint32_t)(i / map->width));
            roots += angle * sqrt((double)rgb_luminance(rgb_make(p[0], p[1], p[2])));
            seen += angle;
        }
    }
    float scale = roots > 0.0 ? ENVIRONMENT_GRAY * (float)(seen * seen / (roots * roots)) : 1.0f;
    image_init_rgb(image, map->width / step, map->height / step);
    for (uint32_t y = 0; y < image->height; y++) {
        for (uint32_t x = 0; x < image->width; x++) {
            float *out = &image->pixel[((size_t)y * image->width + x) * 3];
            for (uint32_t k = 0; k < step * step; k++) {
                size_t at = (size_t)(y * step + k / step) * map->width + x * step + k % step;
                float shown = known->pixel[at * known->channel_count] > 0.0f ? 1.0f : 0.5f;
                for (size_t c = 0; c < 3; c++)
                    out[c] += shown * scale * map->pixel[at * map->channel_count + c] / (float)(step * step);
            }
        }
    }
}

/* --- side-by-sides ------------------------------------------------------------------------ */

static rgb pixel_at(const struct image *image, size_t pixel) {
    const float *p = &image->pixel[pixel * image->channel_count];
    return rgb_make(p[0], p[1], p[2]);
}

static void put(struct image *image, uint32_t x, uint32_t y, rgb c) {
    float *p = &image->pixel[((size_t)y * image->width + x) * 3];
    p[0] = c.r;
    p[1] = c.g;
    p[2] = c.b;
}

float picture_scale(const struct image *picture) {
    size_t count = (size_t)picture->width * picture->height, used = 0;
    float *luminance = mem_array(count, sizeof *luminance);
    for (size_t i = 0; i < count; i++) {
        float l = rgb_luminance(pixel_at(picture, i));
        if (isfinite(l))
            luminance[used++] = l;
    }
    float level = quantile(luminance, used, 0.8);
    mem_free(luminance);
    return level > 0.0f ? 0.6f / level : 1.0f;
}

/* White: equal; red: the re-render is brighter; blue: darker; full colour at a factor of 3. */
static rgb difference_color(rgb photograph, rgb render, float floor) {
    float p = rgb_luminance(photograph) + floor, r = rgb_luminance(render) + floor;
    float d = clampf(2.0f * (r - p) / (r + p), -1.0f, 1.0f);
    if (!isfinite(d))
        return rgb_gray(NAN);
    float fade = 1.0f - fabsf(d);
    return d > 0.0f ? rgb_make(0.85f, 0.85f * fade, 0.85f * fade) : rgb_make(0.85f * fade, 0.85f * fade, 0.85f);
}

void picture_comparison(const struct export_comparison *comparison, struct image *image) {
    const struct image *photograph = comparison->photograph, *render = comparison->render;
    uint32_t width = photograph->width, height = photograph->height;
    image_init_rgb(image, 3 * width + 2 * COMPARISON_GAP, height);
    for (size_t i = 0; i < (size_t)image->width * height * 3; i++)
        image->pixel[i] = 1.0f;
    float scale = picture_scale(photograph);
    for (uint32_t y = 0; y < height; y++) {
        for (uint32_t x = 0; x < width; x++) {
            size_t pixel = (size_t)y * width + x;
            rgb p = pixel_at(photograph, pixel), r = pixel_at(render, pixel);
            put(image, x, y, rgb_scale(p, scale));
            put(image, x + width + COMPARISON_GAP, y, rgb_scale(r, scale));
            put(image, x + 2 * (width + COMPARISON_GAP), y, difference_color(p, r, 0.01f / scale));
        }
    }
}
