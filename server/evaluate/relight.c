/* relight.c -- see relight.h. */
#include "server/evaluate/relight.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/file.h"
#include "common/json.h"
#include "common/mem.h"
#include "server/evaluate/recovered.h"
#include "server/ingest/mesh/ply.h"
#include "server/ingest/transforms.h"
#include "server/render/film.h"
#include "server/scene/latlong.h"

#define ROULETTE_DEPTH 5

struct relight_settings relight_default_settings(void) {
    return (struct relight_settings){
        .view = "0", .environment_scale = 1.0f, .up = 'y', .lights = true, .spp = 64, .max_depth = 16, .seed = 7};
}

/* --- the camera --------------------------------------------------------------------------------- */

static const struct frame *find_frame(const struct frames *t, const char *view) {
    char *end;
    unsigned long number = strtoul(view, &end, 10);
    for (size_t i = 0; i < t->frame_count; i++)
        if (strcmp(t->frame[i].file, view) == 0)
            return &t->frame[i];
    for (size_t i = 0; i < t->frame_count && end != view && *end == '\0'; i++)
        if (t->frame[i].number == number)
            return &t->frame[i];
    return NULL;
}

static enum status choose_camera(const struct frames *t, const char *path, const char *view, const double offset[3],
                                 struct camera *camera, struct error *err) {
    const struct frame *frame = find_frame(t, view);
    if (!frame)
        return error_set(err, STATUS_NOT_FOUND, "%s: has no view \"%s\" among its %zu", path, view, t->frame_count);
    if (isnan(frame->lens.width) || isnan(frame->lens.height))
        return error_set(err, STATUS_INPUT,
                         "%s: frames[%zu] does not say how large its picture is: "
                         "w and h are missing",
                         path, frame->number);
    return frame_camera(frame, (uint32_t)frame->lens.width, (uint32_t)frame->lens.height, offset, camera, err);
}

/* For a mesh with that offset. */
static enum status read_camera(const char *outputs, const struct relight_settings *settings, const double offset[3],
                               struct camera *camera, struct error *err) {
    char *path = settings->cameras ? mem_strdup(settings->cameras) : file_join(outputs, "views.json");
    struct findings findings = {.problems = cJSON_CreateArray()};
    struct frames t = {0};
    cJSON *tree = NULL;
    enum status status = json_read(path, TRANSFORMS_MAX_BYTES, &tree, err);
    if (status == STATUS_OK) {
        transforms_read(tree, path, &t, &findings);
        const cJSON *first = cJSON_GetArrayItem(findings.problems, 0);
        if (findings.problem_count > 0)
            status = error_set(err, STATUS_INPUT, "%s: %s", path,
                               cJSON_GetStringValue(cJSON_GetObjectItem(first, "reason")));
        else
            status = choose_camera(&t, path, settings->view, offset, camera, err);
    }
    frames_release(&t);
    cJSON_Delete(findings.problems);
    findings_release(&findings);
    cJSON_Delete(tree);
    mem_free(path);
    return status;
}

/* --- the light ---------------------------------------------------------------------------------- */

/* A direction of the room in the picture's frame, whose top is y. */
static vec3 to_picture(vec3 d, char up, float turn) {
    vec3 p = up == 'z' ? (vec3){d.x, d.z, -d.y} : up == 'x' ? (vec3){-d.y, d.x, d.z} : d;
    float c = cosf(turn), s = sinf(turn);
    return (vec3){c * p.x - s * p.z, p.y, s * p.x + c * p.z};
}

void relight_orient(const struct image *picture, char up, float turn_deg, float scale, struct image *out) {
    struct lights *lights = lights_new(picture);
    float turn = turn_deg * (float)(PI / 180.0);
    image_init_rgb(out, picture->width, picture->height);
    for (uint32_t y = 0; y < out->height; y++) {
        for (uint32_t x = 0; x < out->width; x++) {
            vec3 d = latlong_pixel(out->width, out->height, x, y);
            rgb value = rgb_scale(lights_environment(lights, to_picture(d, up, turn)), scale);
            memcpy(out->pixel + 3 * ((size_t)y * out->width + x), &value, sizeof value);
        }
    }
    lights_free(lights);
}

static enum status read_environment(const char *path, struct image *picture, struct error *err) {
    struct image_info info;
    enum status status = image_read(path, picture, &info, err);
    if (status != STATUS_OK)
        return status;
    if (picture->channel_count < 3 || picture->height < 2)
        status = error_set(err, STATUS_INPUT,
                           "%s: a picture of %u x %u pixels in %u channels is no "
                           "environment",
                           path, picture->width, picture->height, picture->channel_count);
    size_t values = (size_t)picture->width * picture->height * picture->channel_count;
    for (size_t i = 0; i < values && info.encoding == IMAGE_SRGB; i++)
        picture->pixel[i] = image_srgb_to_linear(picture->pixel[i]);
    return status;
}

/* Sets the requested environment. The recovered one is already in the room's frame. */
static enum status change_environment(struct world *world, const char *outputs, const struct relight_settings *settings,
                                      struct parallel *pool, struct error *err) {
    bool is_given = settings->environment != NULL;
    struct image picture = {0}, oriented = {0};
    if (is_given && strcmp(settings->environment, "none") == 0) {
        world_set_environment(world, NULL, pool);
        return STATUS_OK;
    }
    if (!is_given && !(world->lights->width > 0))
        return STATUS_OK;
    char *path = is_given ? mem_strdup(settings->environment) : file_join(outputs, "environment.exr");
    enum status status = read_environment(path, &picture, err);
    if (status == STATUS_OK) {
        relight_orient(&picture, is_given ? settings->up : 'y', is_given ? settings->turn_deg : 0.0f,
                       settings->environment_scale, &oriented);
        world_set_environment(world, &oriented, pool);
    }
    image_release(&oriented);
    image_release(&picture);
    mem_free(path);
    return status;
}

/* --- the picture -------------------------------------------------------------------------------- */

enum status relight(const char *outputs, const struct relight_settings *settings, struct parallel *pool,
                    struct image *image, struct error *err) {
    struct path_settings path = {
        .max_depth = (int)settings->max_depth, .roulette_depth = ROULETTE_DEPTH, .seed = settings->seed};
    struct mesh mesh = {0};
    struct recovered room = {0};
    struct camera camera;
    struct image film;
    char *scene = file_join(outputs, "scene.ply");
    *image = (struct image){0};
    enum status status = ply_read(scene, scene, MESH_MAX_TRIANGLES, &mesh, NULL, err);
    if (status == STATUS_OK)
        status = read_camera(outputs, settings, mesh.offset, &camera, err);
    if (status != STATUS_OK)
        goto out;
    status = recovered_load(outputs, &mesh, pool, &room, err);
    if (status != STATUS_OK)
        goto out;
    status = change_environment(&room.world, outputs, settings, pool, err);
    if (status == STATUS_OK) {
        for (size_t s = 0; s < room.segments.count && !settings->lights; s++)
            room.materials.emission[s] = rgb_gray(0.0f);
        world_update_lights(&room.world);
        film_render(&room.world, &camera, settings->spp, &path, 0, pool, &film);
        image_take_rgb(&film, image);
        image_release(&film);
    }
    recovered_release(&room);
out:
    mesh_release(&mesh);
    mem_free(scene);
    return status;
}
