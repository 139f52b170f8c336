/* generate.c -- see generate.h. */
#include "server/demo/generate.h"

#include <stdio.h>
#include <string.h>

#include "common/file.h"
#include "common/image.h"
#include "common/json.h"
#include "common/mem.h"
#include "common/quantile.h"
#include "server/demo/room.h"
#include "server/demo/viewpoints.h"
#include "server/render/film.h"
#include "server/scene/camera_json.h"

#define TRUTH_SAMPLES 64 /* first hits per pixel; no light is traced for them */
/* For 8-bit photographs: the first exposure maps the median to this value; the other exposures are shorter by these
 * factors, so that the lamps are not clipped in the last. */
#define SHOWN_MEDIAN 0.2f
static const float exposure_factor[3] = {1.0f, 1.0f / 6.0f, 1.0f / 36.0f};

struct generator {
    const char *dir;
    const struct demo_settings *settings;
    struct parallel *pool;
    struct room room;
    uint32_t frame_count;
    struct camera *camera; /* [frame_count] training first */
    struct image *picture; /* [frame_count] R G B radiance */
    float base_exposure;   /* of 8-bit photographs */
};

struct demo_settings demo_default_settings(void) {
    return (struct demo_settings){
        .width = 160,
        .height = 120,
        .train_count = 40,
        .test_count = 8,
        .spp = 48,
        .test_spp = 128,
        .max_depth = 12,
        .wall_radiance = 15.0f,
        .ceiling_radiance = 15.0f,
        .sdr = false,
        .seed = 1,
        .texture_size = 1024,
    };
}

static bool is_test(const struct generator *g, uint32_t frame) { return frame >= g->settings->train_count; }

static float frame_exposure(const struct generator *g, uint32_t frame) {
    return g->base_exposure * exposure_factor[frame % 3];
}

static char *frame_path(const struct generator *g, const char *folder, uint32_t frame, const char *extension) {
    return mem_printf("%s/%s/%03u.%s", g->dir, folder, frame, extension);
}

/* --- pictures ----------------------------------------------------------------------------- */

static void render_frame(struct generator *g, uint32_t frame) {
    struct path_settings path = {
        .max_depth = (int)g->settings->max_depth, .roulette_depth = 4, .seed = g->settings->seed};
    struct image film; /* has standard errors too */
    film_render(&g->room.world, &g->camera[frame], is_test(g, frame) ? g->settings->test_spp : g->settings->spp, &path,
                frame, g->pool, &film);
    image_take_rgb(&film, &g->picture[frame]);
    image_release(&film);
}

/* From the median over all values of the training frames. */
static float choose_base_exposure(const struct generator *g) {
    size_t per_frame = (size_t)g->settings->width * g->settings->height * 3;
    size_t count = per_frame * g->settings->train_count;
    float *value = mem_array(count, sizeof *value);
    for (uint32_t f = 0; f < g->settings->train_count; f++)
        memcpy(value + f * per_frame, g->picture[f].pixel, per_frame * sizeof *value);
    float median = quantile(value, count, 0.5);
    mem_free(value);
    return median > 0.0f ? SHOWN_MEDIAN / median : 1.0f;
}

static enum status write_frame(const struct generator *g, uint32_t frame, struct error *err) {
    char *path = frame_path(g, "images", frame, g->settings->sdr ? "png" : "exr");
    enum status status;
    if (g->settings->sdr)
        status = image_write_png(path, &g->picture[frame], frame_exposure(g, frame), err);
    else
        status = image_write_exr(path, &g->picture[frame], IMAGE_HALF, false, err);
    mem_free(path);
    return status;
}

/* --- truth -------------------------------------------------------------------------------- */

static enum status write_truth_view(struct generator *g, uint32_t frame, struct error *err) {
    struct image image;
    film_render_first_hits(&g->room.world, &g->camera[frame], TRUTH_SAMPLES, g->settings->seed, g->pool, &image);
    /* segment numbers equal object_id */
    snprintf(image.channel[image_channel(&image, "segment")], sizeof *image.channel, "object_id");
    char *path = frame_path(g, "truth", frame, "exr");
    enum status status = image_write_exr(path, &image, IMAGE_FLOAT, false, err);
    mem_free(path);
    image_release(&image);
    return status;
}

static cJSON *color_array(rgb c) {
    return cJSON_CreateDoubleArray((double[]){(double)c.r, (double)c.g, (double)c.b}, 3);
}

static enum status write_objects(const struct generator *g, struct error *err) {
    const struct room *room = &g->room;
    rgb mean[ROOM_OBJECT_COUNT] = {{0}};
    size_t texels[ROOM_OBJECT_COUNT] = {0}, triangles[ROOM_OBJECT_COUNT] = {0};
    for (size_t i = 0; i < room->inverse.valid_count; i++) {
        uint32_t texel = room->inverse.valid[i];
        int64_t object = room->mesh.object_id[room->inverse.triangle[texel]];
        const float *c = room->materials.base_color.texel[texel];
        texels[object]++;
        mean[object] =
            rgb_mad(mean[object], 1.0f / (float)texels[object], rgb_sub(rgb_make(c[0], c[1], c[2]), mean[object]));
    }
    for (size_t t = 0; t < room->mesh.triangle_count; t++)
        triangles[room->mesh.object_id[t]]++;
    cJSON *list = cJSON_CreateArray();
    for (int i = 0; i < ROOM_OBJECT_COUNT; i++) {
        cJSON *entry = cJSON_CreateObject();
        json_add_int(entry, "id", i);
        json_add_string(entry, "name", room_object_name((enum room_object)i));
        json_add_number(entry, "roughness", (double)room->materials.roughness[i]);
        json_add_number(entry, "specular", (double)room->materials.specular[i]);
        json_add(entry, "emission", color_array(room->materials.emission[i]));
        json_add(entry, "mean_base_color", color_array(mean[i]));
        json_add_int(entry, "triangles", (int64_t)triangles[i]);
        cJSON_AddItemToArray(list, entry);
    }
    char *path = mem_printf("%s/truth/objects.json", g->dir);
    char *text = json_text(list);
    enum status status = file_replace(path, text, strlen(text), err);
    mem_free(text);
    mem_free(path);
    cJSON_Delete(list);
    return status;
}

/* --- the bundle --------------------------------------------------------------------------- */

static enum status write_transforms(const struct generator *g, struct error *err) {
    const struct camera *first = &g->camera[0];
    cJSON *root = cJSON_CreateObject(), *frames = cJSON_CreateArray();
    json_add_string(root, "camera_model", "PINHOLE");
    json_add_int(root, "w", first->width);
    json_add_int(root, "h", first->height);
    json_add_number(root, "fl_x", (double)first->fx);
    json_add_number(root, "fl_y", (double)first->fy);
    json_add_number(root, "cx", (double)first->cx);
    json_add_number(root, "cy", (double)first->cy);
    for (uint32_t f = 0; f < g->frame_count; f++) {
        cJSON *frame = cJSON_CreateObject();
        char name[64];
        snprintf(name, sizeof name, "images/%03u.%s", f, g->settings->sdr ? "png" : "exr");
        json_add_string(frame, "file_path", name);
        json_add(frame, "transform_matrix", camera_transform_matrix(&g->camera[f], (double[3]){0.0}));
        json_add_string(frame, "split", is_test(g, f) ? "test" : "train");
        if (g->settings->sdr)
            json_add_number(frame, "exposure", (double)frame_exposure(g, f));
        cJSON_AddItemToArray(frames, frame);
    }
    json_add(root, "frames", frames);
    char *path = file_join(g->dir, "transforms.json");
    char *text = json_text(root);
    enum status status = file_replace(path, text, strlen(text), err);
    mem_free(text);
    mem_free(path);
    cJSON_Delete(root);
    return status;
}

static enum status make_folders(const char *dir, struct error *err) {
    static const char *const names[] = {"images", "truth"};
    enum status status = STATUS_OK;
    for (int i = 0; i < 2 && status == STATUS_OK; i++) {
        char *path = file_join(dir, names[i]);
        status = file_make_dirs(path, err);
        mem_free(path);
    }
    return status;
}

static enum status write_bundle(struct generator *g, struct error *err) {
    char *mesh_path = file_join(g->dir, "mesh.ply");
    enum status status = shapes_write_ply(&g->room.mesh, mesh_path, err);
    mem_free(mesh_path);
    for (uint32_t f = 0; f < g->frame_count && status == STATUS_OK; f++)
        status = write_frame(g, f, err);
    for (uint32_t f = g->settings->train_count; f < g->frame_count && status == STATUS_OK; f++)
        status = write_truth_view(g, f, err);
    if (status == STATUS_OK)
        status = write_objects(g, err);
    if (status == STATUS_OK) /* last: the folder is complete when this file exists */
        status = write_transforms(g, err);
    return status;
}

enum status demo_generate(const char *dir, const struct demo_settings *settings, struct parallel *pool,
                          void (*progress)(void *user, uint32_t done, uint32_t total), void *user, struct error *err) {
    struct generator g = {
        .dir = dir, .settings = settings, .pool = pool, .frame_count = settings->train_count + settings->test_count};
    const struct room_look look = {settings->texture_size, settings->wall_radiance, settings->ceiling_radiance,
                                   settings->lamps};
    enum status status = make_folders(dir, err);
    if (status == STATUS_OK)
        status = room_init(&g.room, &look, pool, err);
    if (status != STATUS_OK)
        return status;
    g.camera = mem_calloc(g.frame_count, sizeof *g.camera);
    g.picture = mem_calloc(g.frame_count, sizeof *g.picture);
    viewpoints_choose(&g.room, settings->width, settings->height, settings->train_count, settings->test_count,
                      settings->seed, g.camera);
    for (uint32_t f = 0; f < g.frame_count; f++) {
        render_frame(&g, f);
        if (progress)
            progress(user, f + 1, g.frame_count);
    }
    g.base_exposure = choose_base_exposure(&g);
    status = write_bundle(&g, err);
    for (uint32_t f = 0; f < g.frame_count; f++)
        image_release(&g.picture[f]);
    mem_free(g.picture);
    mem_free(g.camera);
    room_release(&g.room);
    return status;
}
