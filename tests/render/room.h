/* room.h -- rooms of the shared test data as worlds, for tests and benches of the engine.
 *
 * A room's materials are constant per object. Its atlas is a trivial one: each object owns a
 * block of 4 x 4 texels and every triangle maps into the middle of its object's block, so that
 * the texture filter takes part and a derivative by an object's base colour is the sum over its
 * block. Segment numbers are object ids. */
#ifndef UNBAKE_TESTS_RENDER_ROOM_H
#define UNBAKE_TESTS_RENDER_ROOM_H

#include "common/image.h"
#include "common/json.h"
#include "common/mem.h"
#include "server/ingest/mesh/mesh_file.h"
#include "server/render/world.h"
#include "server/scene/camera.h"
#include "tests/check.h"

#define ROOM_BLOCK 4
#define ROOM_BLOCKS_ACROSS 64

struct room {
    struct mesh mesh;
    struct segments segments;
    struct atlas atlas;
    struct materials materials;
    struct world world;
    struct parallel *pool;
};

/* Ends the test when `status` is a failure. */
static inline void room_must(enum status status, const struct error *err) {
    if (status == STATUS_OK)
        return;
    fprintf(stderr, "%s\n", err->message);
    exit(1);
}

static inline void room_rgb(const cJSON *array, rgb *value) {
    value->r = (float)cJSON_GetArrayItem(array, 0)->valuedouble;
    value->g = (float)cJSON_GetArrayItem(array, 1)->valuedouble;
    value->b = (float)cJSON_GetArrayItem(array, 2)->valuedouble;
}

/* Sets all texels of a segment's block. */
static inline void room_set_base_color(struct room *room, size_t segment, rgb value) {
    struct texture *t = &room->materials.base_color;
    size_t x0 = segment % ROOM_BLOCKS_ACROSS * ROOM_BLOCK, y0 = segment / ROOM_BLOCKS_ACROSS * ROOM_BLOCK;
    for (size_t y = y0; y < y0 + ROOM_BLOCK; y++)
        for (size_t x = x0; x < x0 + ROOM_BLOCK; x++)
            memcpy(t->texel[y * t->width + x], (float[4]){value.r, value.g, value.b, 1.0f}, sizeof *t->texel);
}

static inline uint32_t room_segment_of_texel(uint32_t x, uint32_t y) {
    return y / ROOM_BLOCK * ROOM_BLOCKS_ACROSS + x / ROOM_BLOCK;
}

/* Segments, atlas and neutral materials for room->mesh, whose object_id are small numbers. */
static inline void room_make_tables(struct room *room) {
    const struct mesh *mesh = &room->mesh;
    room->segments.of_triangle = mem_array(mesh->triangle_count, sizeof *room->segments.of_triangle);
    room->atlas.corner = mem_array(mesh->triangle_count, sizeof *room->atlas.corner);
    room->atlas.width = room->atlas.height = ROOM_BLOCK * ROOM_BLOCKS_ACROSS;
    for (size_t i = 0; i < mesh->triangle_count; i++) {
        size_t s = (size_t)mesh->object_id[i];
        CHECK(s < ROOM_BLOCKS_ACROSS * ROOM_BLOCKS_ACROSS);
        room->segments.of_triangle[i] = (uint32_t)s;
        if (s >= room->segments.count)
            room->segments.count = s + 1;
        float x = (float)(s % ROOM_BLOCKS_ACROSS * ROOM_BLOCK), y = (float)(s / ROOM_BLOCKS_ACROSS * ROOM_BLOCK);
        room->atlas.corner[i][0] = (vec2){x + 1.0f, y + 1.0f};
        room->atlas.corner[i][1] = (vec2){x + 3.0f, y + 1.0f};
        room->atlas.corner[i][2] = (vec2){x + 1.0f, y + 3.0f};
    }
    struct materials *m = &room->materials;
    m->segment_count = room->segments.count;
    m->roughness = mem_calloc(m->segment_count, sizeof *m->roughness);
    m->specular = mem_calloc(m->segment_count, sizeof *m->specular);
    m->emission = mem_calloc(m->segment_count, sizeof *m->emission);
    m->base_color.width = m->base_color.height = room->atlas.width;
    m->base_color.texel = mem_calloc((size_t)room->atlas.width * room->atlas.height, sizeof *m->base_color.texel);
}

/* Drops the triangles of an object from the mesh. */
static inline void room_drop_object(struct mesh *mesh, int64_t id) {
    size_t kept = 0;
    for (size_t i = 0; i < mesh->triangle_count; i++) {
        if (mesh->object_id[i] == id)
            continue;
        memcpy(mesh->index[kept], mesh->index[i], sizeof mesh->index[i]);
        mesh->object_id[kept++] = mesh->object_id[i];
    }
    mesh->triangle_count = kept;
}

/* Materials from an array of objects; base_color from the member `color_key`. */
static inline void room_read_materials(struct room *room, const char *objects, const char *color_key) {
    struct error err;
    cJSON *list;
    room_must(json_read(check_data(objects), (size_t)1 << 26, &list, &err), &err);
    const cJSON *o;
    cJSON_ArrayForEach(o, list) {
        size_t s = (size_t)cJSON_GetObjectItem(o, "id")->valuedouble;
        if (s >= room->segments.count)
            continue;
        rgb color;
        room_rgb(cJSON_GetObjectItem(o, color_key), &color);
        room_set_base_color(room, s, color);
        room->materials.roughness[s] = (float)cJSON_GetObjectItem(o, "roughness")->valuedouble;
        room->materials.specular[s] = (float)cJSON_GetObjectItem(o, "specular")->valuedouble;
        room_rgb(cJSON_GetObjectItem(o, "emission"), &room->materials.emission[s]);
    }
    cJSON_Delete(list);
}

static inline void room_read_image(const char *name, struct image *image) {
    struct error err;
    room_must(image_read(check_data(name), image, NULL, &err), &err);
}

/* Reads a room; the objects in drop[0..drop_count) are left out. environment may be NULL. */
static inline void room_load(struct room *room, const char *ply, const char *objects, const char *color_key,
                             const int *drop, int drop_count, const struct image *environment, int thread_count) {
    struct error err;
    memset(room, 0, sizeof *room);
    room_must(mesh_file_read(check_data(ply), ply, MESH_MAX_TRIANGLES, &room->mesh, NULL, &err), &err);
    for (int i = 0; i < drop_count; i++)
        room_drop_object(&room->mesh, drop[i]);
    room_make_tables(room);
    room_read_materials(room, objects, color_key);
    room->pool = parallel_new(thread_count);
    room_must(world_init(&room->world, &room->mesh, &room->segments, &room->atlas, &room->materials, environment,
                         room->pool, &err),
              &err);
}

static inline void room_release(struct room *room) {
    world_release(&room->world);
    parallel_free(room->pool);
    mem_free(room->segments.of_triangle);
    mem_free(room->atlas.corner);
    mem_free(room->materials.roughness);
    mem_free(room->materials.specular);
    mem_free(room->materials.emission);
    mem_free(room->materials.base_color.texel);
    mesh_release(&room->mesh);
}

/* The camera of the frame of a nerfstudio file whose file_path is `frame`. */
static inline void room_camera(const char *transforms, const char *frame, struct camera *camera) {
    struct error err;
    cJSON *file;
    room_must(json_read(check_data(transforms), (size_t)1 << 26, &file, &err), &err);
    memset(camera, 0, sizeof *camera);
    camera->width = (uint32_t)cJSON_GetObjectItem(file, "w")->valuedouble;
    camera->height = (uint32_t)cJSON_GetObjectItem(file, "h")->valuedouble;
    camera->fx = (float)cJSON_GetObjectItem(file, "fl_x")->valuedouble;
    camera->fy = (float)cJSON_GetObjectItem(file, "fl_y")->valuedouble;
    camera->cx = (float)cJSON_GetObjectItem(file, "cx")->valuedouble;
    camera->cy = (float)cJSON_GetObjectItem(file, "cy")->valuedouble;
    const cJSON *f, *found = NULL;
    cJSON_ArrayForEach(f, cJSON_GetObjectItem(file, "frames"))
        if (strcmp(cJSON_GetObjectItem(f, "file_path")->valuestring, frame) == 0)
            found = cJSON_GetObjectItem(f, "transform_matrix");
    CHECK(found != NULL);
    float m[3][4];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 4; j++)
            m[i][j] = (float)cJSON_GetArrayItem(cJSON_GetArrayItem(found, i), j)->valuedouble;
    /* Theirs looks along -z with y up; ours along z with y down. */
    for (int i = 0; i < 3; i++) {
        camera->world_from_camera.rotation[i][0] = m[i][0];
        camera->world_from_camera.rotation[i][1] = -m[i][1];
        camera->world_from_camera.rotation[i][2] = -m[i][2];
    }
    camera->world_from_camera.translation = (vec3){m[0][3], m[1][3], m[2][3]};
    camera->camera_from_world = rigid_inverse(&camera->world_from_camera);
    cJSON_Delete(file);
}

/* Sums over independent estimates of a picture, whose spread gives our standard error. */
struct room_picture {
    uint32_t width, height;
    size_t count;        /* pixels */
    double (*sum)[3];    /* [count] owned */
    double (*square)[3]; /* [count] owned */
    int estimates;
};

static inline void room_picture_init(struct room_picture *p, uint32_t width, uint32_t height, int estimates) {
    p->width = width;
    p->height = height;
    p->count = (size_t)width * height;
    p->sum = mem_calloc(p->count, sizeof *p->sum);
    p->square = mem_calloc(p->count, sizeof *p->square);
    p->estimates = estimates;
}

static inline void room_picture_release(struct room_picture *p) {
    mem_free(p->sum);
    mem_free(p->square);
}

static inline void room_picture_add(struct room_picture *p, size_t pixel, int channel, double value) {
    p->sum[pixel][channel] += value;
    p->square[pixel][channel] += value * value;
}

/* Squared standard error of the difference of a pixel's means. */
static inline double room_error2(const struct room_picture *p, const struct image *wanted, size_t pixel, int channel,
                                 int error_channel) {
    double mean = p->sum[pixel][channel] / p->estimates;
    double ours = fmax(0.0, p->square[pixel][channel] / p->estimates - mean * mean) / (p->estimates - 1);
    double theirs = (double)wanted->pixel[pixel * wanted->channel_count + (size_t)error_channel];
    return ours + theirs * theirs;
}

/* z-tests of a picture against a stored one with channels R G B err.R err.G err.B. The means may
 * differ by 0.1 % beyond their error: ray offsets and the precision of normals are not theirs.
 *
 * The noise of light paths is skewed: a pixel whose rare bright paths were missed has too small a
 * mean and too small an error at once. So a pixel's error is taken as the greater of its own
 * and the root mean square over its 5 x 5 neighbours. */
static inline void room_compare(const struct room_picture *p, const struct image *wanted, const char *name) {
    static const char *const value_name[] = {"R", "G", "B"};
    static const char *const error_name[] = {"err.R", "err.G", "err.B"};
    double beyond = 0.0, found_mean = 0.0, wanted_mean = 0.0, variance = 0.0, size = 0.0;
    CHECK(p->width == wanted->width && p->height == wanted->height);
    int value_at[3], error_at[3];
    for (int c = 0; c < 3; c++) {
        value_at[c] = image_channel(wanted, value_name[c]);
        error_at[c] = image_channel(wanted, error_name[c]);
    }
    int w = (int)p->width, h = (int)p->height;
    for (int i = 0; i < w * h; i++) {
        /* The channels of a pixel share their noise: its errors add up linearly. */
        double pixel_error = 0.0;
        for (int c = 0; c < 3; c++) {
            double theirs = (double)wanted->pixel[(size_t)i * wanted->channel_count + (size_t)value_at[c]];
            double own = room_error2(p, wanted, (size_t)i, c, error_at[c]), around = 0.0, count = 0.0;
            for (int y = i / w - 2; y <= i / w + 2; y++) {
                for (int x = i % w - 2; x <= i % w + 2; x++) {
                    if (x < 0 || y < 0 || x >= w || y >= h)
                        continue;
                    around += room_error2(p, wanted, (size_t)(y * w + x), c, error_at[c]);
                    count += 1.0;
                }
            }
            double mean = p->sum[i][c] / p->estimates;
            beyond += fabs(mean - theirs) > 3.0 * sqrt(fmax(own, around / count)) + 1e-3 * fabs(theirs);
            found_mean += mean;
            wanted_mean += theirs;
            size += fabs(theirs);
            pixel_error += sqrt(own);
        }
        variance += pixel_error * pixel_error;
    }
    double n = 3.0 * (double)p->count, error = sqrt(variance) / n;
    found_mean /= n;
    wanted_mean /= n;
    beyond /= n;
    /* The channels of a pixel pass or fail together: three times the binomial's variance. */
    double limit = 0.0027 + 3.0 * sqrt(3.0 * 0.0027 / n);
    printf("%-24s mean %.6g, wanted %.6g, z %+.2f; beyond 3 sigma %.4f (limit %.4f)\n", name, found_mean, wanted_mean,
           (found_mean - wanted_mean) / error, beyond, limit);
    CHECK_THAT(fabs(found_mean - wanted_mean) < 3.3 * error + 1e-3 * size / n, "%s: mean %g, wanted %g +- %g", name,
               found_mean, wanted_mean, error);
    CHECK_THAT(beyond < limit, "%s: %g of the values beyond 3 sigma, %g allowed", name, beyond, limit);
}

#endif
