/* photo_pixels.c -- see photo_pixels.h. */
#include "server/ingest/photo_pixels.h"

#include <math.h>
#include <string.h>

#include "common/file.h"
#include "common/image_ceiling.h"
#include "common/mem.h"

#define HALF_LARGEST 0x7bff /* finite number in half precision, as stored */

/* --- pixels ------------------------------------------------------------------------------ */

uint16_t *photo_pixels_table(void) {
    uint16_t *table = mem_array(65536, sizeof *table);
    for (size_t i = 0; i < 65536; i++)
        table[i] = image_half_from_float(image_srgb_to_linear((float)i / 65535.0f));
    return table;
}

void photo_pixels_from_srgb(const uint16_t *half_of_srgb, const struct image *image, struct photograph *photo) {
    size_t count = (size_t)image->width * image->height, stride = image->channel_count;
    photograph_use(photo, 0, count);
    for (size_t i = 0; i < count; i++)
        for (size_t c = 0; c < 3; c++) {
            float code = clampf(image->pixel[i * stride + c], 0.0f, 1.0f);
            photo->pixel[i][c] = half_of_srgb[(size_t)(code * 65535.0f + 0.5f)];
        }
}

/* Whether a file's channel says something. An infinite one is a lower bound where the file has halves, which overflow;
 * floats become infinite by division by 0 only. */
static bool is_number(float value, float ceiling) {
    return isfinite(value) || (value > 0.0f && isfinite(ceiling) && !isnan(value));
}

static bool is_nan(const uint16_t pixel[3]) { return (pixel[0] & 0x7fff) > 0x7c00; }

static bool is_bound(const uint16_t pixel[3]) {
    return pixel[0] == HALF_LARGEST || pixel[1] == HALF_LARGEST || pixel[2] == HALF_LARGEST;
}

/* Whether one of the eight pixels around (x, y) is no number. */
static bool touches_nan(const struct photograph *photo, size_t width, size_t height, size_t x, size_t y) {
    for (size_t v = y > 0 ? y - 1 : 0; v <= y + 1 && v < height; v++)
        for (size_t u = x > 0 ? x - 1 : 0; u <= x + 1 && u < width; u++)
            if (is_nan(photo->pixel[v * width + u]))
                return true;
    return false;
}

/* Makes lower bounds that are connected with pixels that are no numbers such pixels; the number of them. */
static size_t exclude_beside_nan(const struct photograph *photo, size_t width, size_t height) {
    size_t count = width * height, excluded = 0, before;
    bool is_forward = true;
    do {
        before = excluded;
        photograph_use(photo, 0, count);
        for (size_t i = 0; i < count; i++) {
            size_t at = is_forward ? i : count - 1 - i;
            uint16_t *pixel = photo->pixel[at];
            if (!is_bound(pixel) || !touches_nan(photo, width, height, at % width, at / width))
                continue;
            pixel[0] = pixel[1] = pixel[2] = image_half_from_float(NAN);
            excluded++;
        }
        is_forward = !is_forward;
    } while (excluded > before);
    return excluded;
}

void photo_pixels_from_linear(const struct image *image, const struct image_info *info, struct photograph *photo,
                              struct photo_faults *faults) {
    size_t count = (size_t)image->width * image->height, stride = image->channel_count;
    float ceiling = image_ceiling(info);
    photograph_use(photo, 0, count);
    for (size_t i = 0; i < count; i++) {
        const float *in = image->pixel + i * stride;
        bool is_usable = is_number(in[0], ceiling) && is_number(in[1], ceiling) && is_number(in[2], ceiling);
        for (size_t c = 0; c < 3; c++) {
            float value = is_usable ? clampf(in[c], 0.0f, IMAGE_HALF_LARGEST) : NAN;
            photo->pixel[i][c] = image_half_from_float(value);
            faults->light += is_usable ? (double)value : 0.0;
            faults->negative += is_usable ? (double)fmaxf(-in[c], 0.0f) : 0.0;
        }
        faults->not_finite += !is_usable;
        faults->bounds += is_usable && is_bound(photo->pixel[i]);
    }
    if (faults->bounds > 0 && photo->is_hdr)
        photo->clip = IMAGE_HALF_LARGEST;
    if (faults->bounds > 0 && faults->not_finite > faults->outside) {
        size_t excluded = exclude_beside_nan(photo, image->width, image->height);
        faults->bounds -= excluded;
        faults->beside += excluded;
    }
}

void photo_pixels_mask_by_alpha(const struct image *image, struct photograph *photo) {
    size_t count = (size_t)image->width * image->height;
    int alpha = image_channel(image, "A");
    if (alpha < 0)
        return;
    photo->mask = spill_take(photo->spill, count, sizeof *photo->mask);
    photograph_use(photo, 0, count);
    for (size_t i = 0; i < count; i++)
        photo->mask[i] = image->pixel[i * image->channel_count + (size_t)alpha] < 0.5f ? 0 : 255;
}

/* --- masks ------------------------------------------------------------------------------- */

/* Makes a mask that lets everything through, if there is none. */
static void begin_mask(struct photograph *photo) {
    size_t count = (size_t)photo->camera.width * photo->camera.height;
    if (photo->mask)
        return;
    photo->mask = spill_take(photo->spill, count, sizeof *photo->mask);
    photograph_use(photo, 0, count);
    memset(photo->mask, 255, count);
}

void photo_pixels_mask_by_circle(double radius, struct photograph *photo) {
    size_t width = photo->camera.width, height = photo->camera.height;
    begin_mask(photo);
    for (size_t y = 0; y < height; y++)
        for (size_t x = 0; x < width; x++)
            if (hypot((double)x + 0.5 - 0.5 * (double)width, (double)y + 0.5 - 0.5 * (double)height) > radius)
                photo->mask[y * width + x] = 0;
}

static bool is_of_aspect(uint32_t width, uint32_t height, const struct camera *camera) {
    uint64_t a = (uint64_t)width * camera->height, b = (uint64_t)height * camera->width;
    return (a > b ? a - b : b - a) <= (width > height ? width : height); /* a pixel of rounding */
}

/* Whether a mask is of the photograph's size or a multiple of it, upright or, as stored before the photograph was
 * turned, to be turned alike: else *turn becomes 1. */
static bool fits(const struct image *mask, const struct camera *camera, int *turn) {
    bool is_upright = is_of_aspect(mask->width, mask->height, camera);
    if (is_upright && mask->width != mask->height)
        *turn = 1;
    return is_upright || (image_orientation_swaps(*turn) && is_of_aspect(mask->height, mask->width, camera));
}

/* Excludes the pixels whose centre lies in a black one of the mask. */
static void exclude(const struct image *mask, struct photograph *photo) {
    size_t width = photo->camera.width, height = photo->camera.height;
    begin_mask(photo);
    for (size_t y = 0; y < height; y++) {
        size_t row = (2 * y + 1) * mask->height / (2 * height) * mask->width;
        for (size_t x = 0; x < width; x++) {
            size_t at = row + (2 * x + 1) * mask->width / (2 * width);
            if (!(mask->pixel[at * mask->channel_count] > 0.0f))
                photo->mask[y * width + x] = 0;
        }
    }
}

enum status photo_pixels_load_mask(const char *dir, const char *name, int turn, struct photograph *photo,
                                   bool *is_broken, struct error *err) {
    struct image image;
    if (!file_is_in(dir, name))
        return error_set(err, STATUS_INPUT, "the mask is not in the bundle");
    char *path = file_join(dir, name);
    enum status status = image_probe(path, &image, NULL, err);
    *is_broken = status == STATUS_INPUT;
    if (status != STATUS_OK)
        goto out;
    if (!fits(&image, &photo->camera, &turn))
        status = error_set(err, STATUS_INPUT, "the mask is %u x %u pixels, its photograph %u x %u", image.width,
                           image.height, photo->camera.width, photo->camera.height);
    image_release(&image);
    if (status == STATUS_OK) {
        status = image_read_stored(path, &image, err);
        *is_broken = status == STATUS_INPUT;
    }
    if (status != STATUS_OK)
        goto out;
    image_orient(&image, turn);
    exclude(&image, photo);
    image_release(&image);
out:
    mem_free(path);
    return status;
}
