/* image.c -- see image.h: pictures in memory, and the conversions of single values. */
#include "common/image.h"

#include <math.h>
#include <string.h>

#include "common/mem.h"

static void set_header(struct image *image, uint32_t width, uint32_t height, uint32_t channel_count,
                       const char *const *channel) {
    *image = (struct image){.width = width, .height = height, .channel_count = channel_count};
    image->channel = mem_calloc(channel_count, sizeof *image->channel);
    for (uint32_t c = 0; c < channel_count; c++)
        strncpy(image->channel[c], channel[c], sizeof *image->channel - 1);
}

void image_allocate(struct image *image) {
    size_t pixel_count = (size_t)image->width * image->height;
    /* Fresh from the kernel, such memory costs nothing until a decoder gets that far: a header
     * that lies about a large picture is cheap. */
    image->pixel = mem_calloc(pixel_count, image->channel_count * sizeof(float));
}

void image_init(struct image *image, uint32_t width, uint32_t height, uint32_t channel_count,
                const char *const *channel) {
    set_header(image, width, height, channel_count, channel);
    image_allocate(image);
}

void image_init_rgb(struct image *image, uint32_t width, uint32_t height) {
    image_init(image, width, height, 3, (const char *const[]){"R", "G", "B"});
}

void image_take_rgb(const struct image *from, struct image *image) {
    image_init_rgb(image, from->width, from->height);
    for (size_t i = 0; i < (size_t)from->width * from->height; i++)
        memcpy(image->pixel + 3 * i, from->pixel + from->channel_count * i, 3 * sizeof *image->pixel);
}

void image_copy(const struct image *from, struct image *image) {
    const char *names[IMAGE_MAX_CHANNELS];
    for (uint32_t c = 0; c < from->channel_count; c++)
        names[c] = from->channel[c];
    image_init(image, from->width, from->height, from->channel_count, names);
    memcpy(image->pixel, from->pixel, (size_t)from->width * from->height * from->channel_count * sizeof *image->pixel);
}

void image_release(struct image *image) {
    mem_free(image->channel);
    mem_free(image->pixel);
    mem_free(image->clipped);
    *image = (struct image){0};
}

int image_channel(const struct image *image, const char *name) {
    for (uint32_t c = 0; c < image->channel_count; c++)
        if (strcmp(image->channel[c], name) == 0)
            return (int)c;
    return -1;
}

enum status image_header(struct image *image, const char *name, uint64_t width, uint64_t height, uint32_t channel_count,
                         const char *const *channel, struct error *err) {
    if (width == 0 || height == 0 || channel_count == 0)
        return error_set(err, STATUS_INPUT, "%s: the picture has no pixels", name);
    if (width > IMAGE_MAX_SIDE || height > IMAGE_MAX_SIDE || width * height > IMAGE_MAX_PIXELS)
        return error_set(err, STATUS_LIMIT,
                         "%s: %llu x %llu pixels are more than the limits of %d a side and %zu "
                         "altogether",
                         name, (unsigned long long)width, (unsigned long long)height, IMAGE_MAX_SIDE, IMAGE_MAX_PIXELS);
    if (channel_count > IMAGE_MAX_CHANNELS)
        return error_set(err, STATUS_LIMIT, "%s: %u channels are more than the limit of %d", name, channel_count,
                         IMAGE_MAX_CHANNELS);
    set_header(image, (uint32_t)width, (uint32_t)height, channel_count, channel);
    return STATUS_OK;
}

float image_srgb_to_linear(float value) {
    return value <= 0.04045f ? value / 12.92f : powf((value + 0.055f) / 1.055f, 2.4f);
}

float image_linear_to_srgb(float value) {
    return value <= 0.0031308f ? value * 12.92f : 1.055f * powf(value, 1.0f / 2.4f) - 0.055f;
}

uint16_t image_half_from_float(float value) {
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    uint32_t sign = bits >> 16 & 0x8000, magnitude = bits & 0x7fffffff;
    if (magnitude > 0x7f800000) /* not a number: keep what fits of the payload, never infinity */
        return (uint16_t)(sign | 0x7e00 | (magnitude >> 13 & 0x1ff));
    if (magnitude >= 0x477ff000) /* 65520 and up rounds to infinity */
        return (uint16_t)(sign | 0x7c00);
    if (magnitude < 0x33000000) /* below half of the smallest subnormal */
        return (uint16_t)sign;
    uint32_t mantissa = magnitude, shift = 13;
    if (magnitude < 0x38800000) { /* subnormal: make the implicit bit explicit */
        mantissa = (magnitude & 0x7fffff) | 0x800000;
        shift = 126 - (magnitude >> 23);
    } else {
        mantissa -= 0x38000000; /* rebias the exponent from 127 to 15 */
    }
    uint32_t kept = mantissa >> shift, rest = mantissa & ((1u << shift) - 1);
    uint32_t middle = 1u << (shift - 1);
    kept += rest > middle || (rest == middle && (kept & 1)); /* may carry into the exponent */
    return (uint16_t)(sign | kept);
}
