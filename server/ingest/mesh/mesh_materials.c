/* mesh_materials.c -- see mesh_materials.h. */
#include "server/ingest/mesh/mesh_materials.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/file.h"
#include "common/mem.h"
#include "server/ingest/path.h"

#define NEUTRAL 0.5f /* base colour and roughness of a file that says nothing */

void mesh_materials_release(struct mesh_materials *materials) {
    for (size_t i = 0; i < materials->material_count; i++)
        mem_free(materials->material[i].name);
    for (size_t i = 0; i < materials->image_count; i++) {
        mem_free(materials->image[i].name);
        image_release(&materials->image[i].image);
    }
    mem_free(materials->material);
    mem_free(materials->image);
    *materials = (struct mesh_materials){0};
}

struct mesh_material *mesh_materials_add(struct mesh_materials *materials, const char *name) {
    materials->material =
        mem_realloc_array(materials->material, materials->material_count + 1, sizeof *materials->material);
    struct mesh_material *m = &materials->material[materials->material_count++];
    *m = (struct mesh_material){.name = mem_strdup(name),
                                .base_color = rgb_gray(NEUTRAL),
                                .roughness = NEUTRAL,
                                .specular = mesh_material_specular(0.04f)};
    return m;
}

void mesh_materials_leave_out(struct mesh_materials *materials, const char *what) {
    size_t i = 0;
    while (i < materials->unread_count && strcmp(materials->unread[i].what, what) != 0)
        i++;
    if (i == MATERIAL_UNREAD_MAX)
        return;
    if (i == materials->unread_count)
        snprintf(materials->unread[materials->unread_count++].what, sizeof materials->unread[0].what, "%s", what);
    materials->unread[i].count++;
}

void mesh_materials_note(const struct mesh_materials *materials, struct faces_report *report) {
    char list[FACES_NOTE_BYTES] = "";
    size_t used = 0;
    for (size_t i = 0; i < materials->unread_count && used < sizeof list; i++)
        used += (size_t)snprintf(list + used, sizeof list - used, "%s%s (%zu)", i ? ", " : "",
                                 materials->unread[i].what, materials->unread[i].count);
    if (materials->unread_count > 0)
        faces_note(report, "of its materials these are not rendered: %.140s", list);
}

bool mesh_materials_have_maps(const struct mesh_materials *materials) {
    for (size_t i = 0; i < materials->material_count; i++)
        for (int q = 0; q < MATERIAL_QUANTITIES; q++)
            if (materials->material[i].map[q].is_there)
                return true;
    return false;
}

/* The number of the image of that name and kind; materials->image_count: there is none yet. */
static size_t find_image(const struct mesh_materials *materials, const char *name, bool is_color) {
    size_t i = 0;
    while (i < materials->image_count &&
           (materials->image[i].is_color != is_color || strcmp(materials->image[i].name, name) != 0))
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
static size_t add_image(struct mesh_materials *materials, const char *name, bool is_color, struct image *image) {
    materials->image = mem_realloc_array(materials->image, materials->image_count + 1, sizeof *materials->image);
    materials->image[materials->image_count] = (struct material_image){mem_strdup(name), is_color, *image};
    *image = (struct image){0};
    return materials->image_count++;
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

enum status mesh_materials_read_bytes(struct mesh_materials *materials, const char *name, const void *data, size_t size,
                                      bool is_color, size_t *number, struct error *err) {
    struct image_info info = {.encoding = IMAGE_LINEAR};
    struct image image = {0};
    *number = find_image(materials, name, is_color);
    if (*number < materials->image_count)
        return STATUS_OK;
    enum status status = is_color ? image_read_memory(name, data, size, &image, &info, err)
                                  : image_read_memory_stored(name, data, size, &image, err);
    if (status == STATUS_OK)
        status = settle_image(name, is_color, &info, &image, err);
    if (status == STATUS_OK)
        *number = add_image(materials, name, is_color, &image);
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

enum status mesh_materials_read_image(struct mesh_materials *materials, const char *folder, const char *of,
                                      const char *name, bool is_color, size_t *number, struct error *err) {
    struct image_info info = {.encoding = IMAGE_LINEAR};
    struct image image = {0};
    char *clean = NULL, *path = NULL;
    *number = find_image(materials, name, is_color);
    if (*number < materials->image_count)
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
        *number = add_image(materials, name, is_color, &image);
    image_release(&image);
    mem_free(path);
    mem_free(clean);
    return status;
}

/* --- looking up --------------------------------------------------------------------------------------------------- */

/* The texel that stands for number `at` of `size`. */
static size_t wrap(long at, uint32_t size, enum material_wrap how) {
    long n = (long)size;
    if (how == MATERIAL_WRAP_CLAMP)
        return (size_t)(at < 0 ? 0 : at >= n ? n - 1 : at);
    long period = how == MATERIAL_WRAP_MIRROR ? 2 * n : n, in = at % period;
    in += in < 0 ? period : 0;
    return (size_t)(in < n ? in : period - 1 - in);
}

rgb material_map_value(const struct mesh_materials *materials, const struct material_map *map, vec2 uv) {
    const struct image *image = &materials->image[map->image].image;
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
