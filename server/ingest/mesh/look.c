/* look.c -- see look.h. */
#include "server/ingest/mesh/look.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/file.h"
#include "common/mem.h"
#include "server/ingest/path.h"

#define NEUTRAL 0.5f /* base colour and roughness of a file that says nothing */

void look_release(struct mesh_look *look) {
    for (size_t i = 0; i < look->material_count; i++)
        mem_free(look->material[i].name);
    for (size_t i = 0; i < look->image_count; i++) {
        mem_free(look->image[i].name);
        image_release(&look->image[i].image);
    }
    mem_free(look->material);
    mem_free(look->image);
    *look = (struct mesh_look){0};
}

struct look_material *look_add(struct mesh_look *look, const char *name) {
    look->material = mem_realloc_array(look->material, look->material_count + 1, sizeof *look->material);
    struct look_material *m = &look->material[look->material_count++];
    *m = (struct look_material){.name = mem_strdup(name),
                                .base_color = rgb_gray(NEUTRAL),
                                .roughness = NEUTRAL,
                                .specular = look_specular(0.04f)};
    return m;
}

void look_leave_out(struct mesh_look *look, const char *what) {
    size_t i = 0;
    while (i < look->unread_count && strcmp(look->unread[i].what, what) != 0)
        i++;
    if (i == LOOK_UNREAD_MAX)
        return;
    if (i == look->unread_count)
        snprintf(look->unread[look->unread_count++].what, sizeof look->unread[0].what, "%s", what);
    look->unread[i].count++;
}

void look_note(const struct mesh_look *look, struct faces_report *report) {
    char list[FACES_NOTE_BYTES] = "";
    size_t used = 0;
    for (size_t i = 0; i < look->unread_count && used < sizeof list; i++)
        used += (size_t)snprintf(list + used, sizeof list - used, "%s%s (%zu)", i ? ", " : "", look->unread[i].what,
                                 look->unread[i].count);
    if (look->unread_count > 0)
        faces_note(report, "of its materials these are not rendered: %.140s", list);
}

bool look_has_maps(const struct mesh_look *look) {
    for (size_t i = 0; i < look->material_count; i++)
        for (int q = 0; q < LOOK_QUANTITIES; q++)
            if (look->material[i].map[q].is_there)
                return true;
    return false;
}

/* The number of the image of that name and kind; look->image_count: there is none yet. */
static size_t find_image(const struct mesh_look *look, const char *name, bool is_color) {
    size_t i = 0;
    while (i < look->image_count && (look->image[i].is_color != is_color || strcmp(look->image[i].name, name) != 0))
        i++;
    return i;
}

static void make_linear(struct image *image) {
    size_t pixels = (size_t)image->width * image->height;
    for (size_t i = 0; i < pixels; i++)
        for (size_t c = 0; c < 3; c++) {
            float *value = &image->pixel[i * image->channel_count + c];
            *value = image_srgb_to_linear(*value);
        }
}

/* Takes an image over: made linear where it is_color. Its number. */
static size_t add_image(struct mesh_look *look, const char *name, bool is_color, struct image *image) {
    look->image = mem_realloc_array(look->image, look->image_count + 1, sizeof *look->image);
    look->image[look->image_count] = (struct look_image){mem_strdup(name), is_color, *image};
    *image = (struct image){0};
    return look->image_count++;
}

/* Checks and converts what a reader gave. */
static enum status settle_image(const char *name, bool is_color, const struct image_info *info, struct image *image,
                                struct error *err) {
    if (image_channel(image, "B") != 2)
        return error_set(err, STATUS_INPUT, "%s: the picture has no red, green and blue", name);
    if (is_color && info->encoding == IMAGE_SRGB)
        make_linear(image);
    return STATUS_OK;
}

enum status look_read_bytes(struct mesh_look *look, const char *name, const void *data, size_t size, bool is_color,
                            size_t *number, struct error *err) {
    struct image_info info = {.encoding = IMAGE_LINEAR};
    struct image image = {0};
    *number = find_image(look, name, is_color);
    if (*number < look->image_count)
        return STATUS_OK;
    enum status status = is_color ? image_read_memory(name, data, size, &image, &info, err)
                                  : image_read_memory_stored(name, data, size, &image, err);
    if (status == STATUS_OK)
        status = settle_image(name, is_color, &info, &image, err);
    if (status == STATUS_OK)
        *number = add_image(look, name, is_color, &image);
    image_release(&image);
    return status;
}

/* Where the file is: below the folder, or in it, as files are that came one by one. NULL: not there. */
static char *find_file(const char *folder, const char *clean) {
    if (folder && file_is_in(folder, clean))
        return file_join(folder, clean);
    const char *base = path_base(clean);
    return folder && file_is_in(folder, base) ? file_join(folder, base) : NULL;
}

enum status look_read_image(struct mesh_look *look, const char *folder, const char *of, const char *name, bool is_color,
                            size_t *number, struct error *err) {
    struct image_info info = {.encoding = IMAGE_LINEAR};
    struct image image = {0};
    char *clean = NULL, *path = NULL;
    *number = find_image(look, name, is_color);
    if (*number < look->image_count)
        return STATUS_OK;
    enum status status = path_clean_foreign(name, &clean, err);
    if (status == STATUS_OK)
        path = find_file(folder, clean);
    if (status == STATUS_OK && !path) {
        error_set(err, STATUS_INPUT, "%s: its picture %s is not there", of, clean);
        status = error_hint(err, "it belongs beside the mesh; attach.1 gives it to a job");
    }
    if (status == STATUS_OK)
        status = is_color ? image_read(path, &image, &info, err) : image_read_stored(path, &image, err);
    if (status == STATUS_OK)
        status = settle_image(clean, is_color, &info, &image, err);
    if (status == STATUS_OK)
        *number = add_image(look, name, is_color, &image);
    image_release(&image);
    mem_free(path);
    mem_free(clean);
    return status;
}

/* --- looking up --------------------------------------------------------------------------------------------------- */

/* The texel that stands for number `at` of `size`. */
static size_t wrap(long at, uint32_t size, enum look_wrap how) {
    long n = (long)size;
    if (how == LOOK_CLAMP)
        return (size_t)(at < 0 ? 0 : at >= n ? n - 1 : at);
    long period = how == LOOK_MIRROR ? 2 * n : n, in = at % period;
    in += in < 0 ? period : 0;
    return (size_t)(in < n ? in : period - 1 - in);
}

rgb look_map_value(const struct mesh_look *look, const struct look_map *map, vec2 uv) {
    const struct image *image = &look->image[map->image].image;
    float u = map->turn[0][0] * uv.x + map->turn[0][1] * uv.y + map->turn[0][2];
    float v = map->turn[1][0] * uv.x + map->turn[1][1] * uv.y + map->turn[1][2];
    float x = u * (float)image->width - 0.5f, y = v * (float)image->height - 0.5f;
    rgb sum = {0.0f, 0.0f, 0.0f};
    if (!(fabsf(x) < 1e9f && fabsf(y) < 1e9f))
        return sum;
    long column = (long)floorf(x), row = (long)floorf(y);
    for (int k = 0; k < 4; k++) {
        float right = x - (float)column, down = y - (float)row;
        float weight = (k % 2 ? right : 1.0f - right) * (k / 2 ? down : 1.0f - down);
        size_t at = wrap(row + k / 2, image->height, map->wrap[1]) * image->width +
                    wrap(column + k % 2, image->width, map->wrap[0]);
        const float *p = image->pixel + at * image->channel_count;
        rgb value = map->channel < 0 ? rgb_make(p[0], p[1], p[2]) : rgb_gray(p[map->channel]);
        sum = rgb_mad(sum, weight, value);
    }
    return sum;
}
