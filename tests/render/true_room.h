/* true_room.h -- the true materials and lights of a known room as a reconstruction's outputs, for renders beside it.
 *
 * The room is a bundle with truth/ (demo/generate.h, evaluate.h). The outputs are those of a reconstruction of it on
 * its own mesh: the truth takes their geometry, atlas and cameras, and has the room's values by object. Base colour of
 * an object with a texture is, of the demo room, what it is painted with; of others what the truth's pictures of
 * held-out views show of it, and where none shows it what was recovered. Renders from these views are of true base
 * colour therefore; of light that comes from where none of them looks a small part is not. */
#ifndef UNBAKE_TESTS_TRUE_ROOM_H
#define UNBAKE_TESTS_TRUE_ROOM_H

#include "common/file.h"
#include "common/mem.h"
#include "server/demo/paint.h"
#include "server/ingest/mesh/mesh_file.h"
#include "server/relight/cameras.h"
#include "server/relight/recovered.h"
#include "server/scene/surface.h"

#define TRUE_ROOM_BYTES ((size_t)1 << 28) /* of a file that is read */
#define TRUE_ROOM_TRIANGLES ((size_t)1 << 24)
#define TRUE_ROOM_LAST_FILE "report.json" /* written last, when all others are there */
#define TRUE_ROOM_LEAST_COSINE 0.15f /* of a view's direction: pixels of surface that is seen flatly mix more of it */

/* What objects.json says of the object that a segment is. */
struct true_segment {
    int64_t object;
    rgb base_color, emission;
    double area_m2;
    float roughness, specular;
    bool is_known, is_painted, has_texture; /* is_painted: of the demo room */
};

struct true_room {
    struct mesh mesh;
    struct recovered recovered;   /* with the world; its materials become the truth */
    struct cameras views;         /* held-out */
    struct image *picture;        /* [views.count] of the truth; owned */
    struct true_segment *segment; /* [recovered.segments.count] owned */
};

static inline rgb true_room_color(const cJSON *object, const char *name) {
    const cJSON *list = cJSON_GetObjectItemCaseSensitive(object, name);
    float v[3] = {0.0f, 0.0f, 0.0f};
    for (int c = 0; c < 3; c++)
        v[c] = (float)cJSON_GetNumberValue(cJSON_GetArrayItem(list, c));
    return cJSON_GetArraySize(list) == 3 ? rgb_make(v[0], v[1], v[2]) : rgb_gray(0.0f);
}

static inline double true_room_number(const cJSON *object, const char *name) {
    return cJSON_GetNumberValue(cJSON_GetObjectItemCaseSensitive(object, name));
}

static inline void true_room_object(struct true_segment *s, const cJSON *object) {
    s->is_known = true;
    s->is_painted = cJSON_HasObjectItem(object, "mean_base_color");
    s->has_texture = cJSON_IsString(cJSON_GetObjectItemCaseSensitive(object, "base_color_texture"));
    s->base_color = true_room_color(object, "base_color");
    s->emission = true_room_color(object, "emission");
    s->roughness = (float)true_room_number(object, "roughness");
    s->specular = (float)true_room_number(object, "specular");
}

/* Objects of segments by report.json, values of objects by objects.json. */
static inline enum status true_room_segments(struct true_room *t, const char *room, const char *outputs,
                                             struct error *err) {
    cJSON *report = NULL, *objects = NULL;
    char *path = file_join(outputs, "report.json"), *truth = file_join(room, "truth/objects.json");
    enum status status = json_read(path, TRUE_ROOM_BYTES, &report, err);
    if (status == STATUS_OK)
        status = json_read(truth, TRUE_ROOM_BYTES, &objects, err);
    t->segment = mem_calloc(t->recovered.segments.count, sizeof *t->segment);
    const cJSON *list = cJSON_GetObjectItemCaseSensitive(report, "segments");
    for (const cJSON *s = list ? list->child : NULL; s && objects; s = s->next) {
        double number = true_room_number(s, "segment"), id = true_room_number(s, "id");
        if (!(number >= 0.0 && number < (double)t->recovered.segments.count))
            continue;
        struct true_segment *segment = &t->segment[(size_t)number];
        segment->object = (int64_t)id;
        segment->area_m2 = true_room_number(s, "area_m2");
        for (const cJSON *o = objects->child; o; o = o->next)
            if (true_room_number(o, "id") == id)
                true_room_object(segment, o);
    }
    cJSON_Delete(report);
    cJSON_Delete(objects);
    mem_free(path);
    mem_free(truth);
    return status;
}

/* Cameras of the held-out views and the truth's pictures of them; a picture that is not there stays empty. */
static inline enum status true_room_views(struct true_room *t, const char *room, const char *outputs,
                                          struct error *err) {
    cJSON *settings = cJSON_CreateObject();
    json_add_string(settings, "view", "all");
    struct relight_job job = {.outputs = outputs, .settings = settings};
    enum status status = cameras_read(&job, t->mesh.offset, &t->views, err);
    cJSON_Delete(settings);
    t->picture = mem_calloc(t->views.count + 1, sizeof *t->picture);
    for (size_t i = 0; status == STATUS_OK && i < t->views.count; i++) {
        const char *slash = strrchr(t->views.view[i].name, '/'), *name = slash ? slash + 1 : t->views.view[i].name;
        char *path = mem_printf("%s/truth/%.*s.exr", room, (int)strcspn(name, "."), name);
        image_read(path, &t->picture[i], NULL, NULL);
        mem_free(path);
    }
    return status;
}

/* Base colour of a view's truth at the pixel that shows a point, if it shows the point and the 3 x 3 pixels around it
 * show the same object. */
static inline bool true_room_look(const struct true_room *t, size_t view, int64_t object, const struct surface_point *p,
                                  rgb *color) {
    const struct camera *camera = &t->views.view[view].camera;
    const struct image *picture = &t->picture[view];
    float x, y, depth;
    vec3 to = vec3_sub(camera_origin(camera), p->position);
    float distance = vec3_length(to);
    vec3 direction = vec3_scale(to, 1.0f / distance);
    if (!picture->pixel || vec3_dot(direction, p->normal) < TRUE_ROOM_LEAST_COSINE ||
        !camera_project(camera, p->position, &x, &y, &depth) || x < 1.0f || y < 1.0f ||
        x >= (float)picture->width - 1.0f || y >= (float)picture->height - 1.0f ||
        accel_occluded(t->recovered.world.accel, accel_offset(p->position, p->normal, direction), direction, 0.0f,
                       distance))
        return false;
    int id = image_channel(picture, "object_id"), red = image_channel(picture, "base_color.R"),
        green = image_channel(picture, "base_color.G"), blue = image_channel(picture, "base_color.B");
    if (id < 0 || red < 0 || green < 0 || blue < 0)
        return false;
    for (int k = 0; k < 9; k++) {
        size_t pixel = ((size_t)y + (size_t)(k / 3) - 1) * picture->width + (size_t)x + (size_t)(k % 3) - 1;
        const float *v = picture->pixel + pixel * picture->channel_count;
        if (v[id] != (float)object)
            return false;
        if (k == 4)
            *color = rgb_make(v[red], v[green], v[blue]);
    }
    return true;
}

/* The true base colour at a texel of a textured object; false where it is not known. */
static inline bool true_room_texture(const struct true_room *t, const struct true_segment *s, uint32_t texel,
                                     rgb *color) {
    struct surface_point p;
    rgb sum = rgb_gray(0.0f), one;
    float count = 0.0f;
    if (!surface_at_texel(&t->mesh, &t->recovered.atlas, &t->recovered.inverse, texel, &p))
        return false;
    if (s->is_painted) {
        *color = paint_base_color((enum room_object)s->object, p.position, p.normal);
        return true;
    }
    for (size_t view = 0; view < t->views.count; view++) {
        if (!true_room_look(t, view, s->object, &p, &one))
            continue;
        sum = rgb_add(sum, one);
        count += 1.0f;
    }
    *color = rgb_scale(sum, count > 0.0f ? 1.0f / count : 0.0f);
    return count > 0.0f;
}

struct true_room_job {
    const struct true_room *room;
    struct image *color;
};

static inline void true_room_row(void *user, size_t y, int thread) {
    const struct true_room_job *job = user;
    const struct recovered *r = &job->room->recovered;
    (void)thread;
    for (uint32_t texel = (uint32_t)y * r->inverse.width; texel < ((uint32_t)y + 1) * r->inverse.width; texel++) {
        if (r->inverse.triangle[texel] == INVERSE_UV_NONE)
            continue;
        const struct true_segment *s = &job->room->segment[r->segments.of_triangle[r->inverse.triangle[texel]]];
        rgb color = s->base_color;
        bool is_textured = s->is_painted || s->has_texture;
        if (!s->is_known || (is_textured && !true_room_texture(job->room, s, texel, &color)))
            continue; /* what was recovered */
        memcpy(job->color->pixel + 3 * (size_t)texel, &color, 3 * sizeof(float));
    }
}

enum true_room_value { TRUE_ROOM_ROUGHNESS, TRUE_ROOM_SPECULAR, TRUE_ROOM_EMISSION };

static inline enum status true_room_write(const struct true_room *t, const char *out, const char *name,
                                          enum true_room_value which, struct error *err) {
    const struct recovered *r = &t->recovered;
    struct image image;
    char *path = file_join(out, name);
    image_init_rgb(&image, r->inverse.width, r->inverse.height);
    for (size_t i = 0; i < r->inverse.valid_count; i++) {
        size_t texel = r->inverse.valid[i];
        const struct true_segment *s = &t->segment[r->segments.of_triangle[r->inverse.triangle[texel]]];
        rgb value = which == TRUE_ROOM_EMISSION ? s->emission
                                                : rgb_gray(which == TRUE_ROOM_ROUGHNESS ? s->roughness : s->specular);
        memcpy(image.pixel + 3 * texel, &value, 3 * sizeof(float));
    }
    enum status status = image_write_exr(path, &image, IMAGE_FLOAT, false, err);
    image_release(&image);
    mem_free(path);
    return status;
}

static inline enum status true_room_copy(const char *outputs, const char *out, const char *name, struct error *err) {
    struct buf text;
    char *from = file_join(outputs, name), *to = file_join(out, name);
    buf_init(&text, TRUE_ROOM_BYTES);
    enum status status = file_read(from, &text, err);
    if (status == STATUS_OK)
        status = file_replace(to, text.data, text.length, err);
    buf_release(&text);
    mem_free(from);
    mem_free(to);
    return status;
}

/* All of the outputs' files that a render reads, into the folder `out`, which exists. */
static inline enum status true_room_save(const struct true_room *t, const char *outputs, const char *out,
                                         struct parallel *pool, struct error *err) {
    struct image color = {0};
    char *from = file_join(outputs, "base_color.exr"), *to = file_join(out, "base_color.exr");
    enum status status = image_read(from, &color, NULL, err);
    if (status == STATUS_OK) {
        struct true_room_job job = {t, &color};
        parallel_for(pool, color.height, true_room_row, &job);
        status = image_write_exr(to, &color, IMAGE_FLOAT, false, err);
    }
    if (status == STATUS_OK)
        status = true_room_write(t, out, "roughness.exr", TRUE_ROOM_ROUGHNESS, err);
    if (status == STATUS_OK)
        status = true_room_write(t, out, "specular.exr", TRUE_ROOM_SPECULAR, err);
    if (status == STATUS_OK)
        status = true_room_write(t, out, "emission.exr", TRUE_ROOM_EMISSION, err);
    static const char *const same[] = {"scene.ply", "views.json", "cameras.json", TRUE_ROOM_LAST_FILE};
    for (size_t i = 0; i < sizeof same / sizeof *same && status == STATUS_OK; i++)
        status = true_room_copy(outputs, out, same[i], err);
    image_release(&color);
    mem_free(from);
    mem_free(to);
    return status;
}

static inline void true_room_release(struct true_room *t) {
    for (size_t i = 0; i < t->views.count && t->picture; i++)
        image_release(&t->picture[i]);
    mem_free(t->picture);
    mem_free(t->segment);
    cameras_release(&t->views);
    recovered_release(&t->recovered);
    mesh_release(&t->mesh);
    *t = (struct true_room){0};
}

static inline enum status true_room_init(struct true_room *t, const char *room, const char *outputs,
                                         struct parallel *pool, struct error *err) {
    char *scene = file_join(outputs, "scene.ply");
    *t = (struct true_room){0};
    enum status status = mesh_file_read(scene, scene, TRUE_ROOM_TRIANGLES, &t->mesh, NULL, err);
    if (status == STATUS_OK)
        status = recovered_load(outputs, &t->mesh, pool, &t->recovered, err);
    if (status == STATUS_OK)
        status = true_room_segments(t, room, outputs, err);
    if (status == STATUS_OK)
        status = true_room_views(t, room, outputs, err);
    mem_free(scene);
    return status;
}

#endif
