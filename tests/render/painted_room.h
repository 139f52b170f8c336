/* painted_room.h -- the small room with radiance painted on its walls, and its photographs: the truth
 * is a formula, so a capture takes no path tracing and every error can be told exactly.
 *
 * Photographs have PAINTED_SIDE squared samples a pixel and 1 % noise; surfaces are a little brighter towards one
 * side, as slightly glossy ones are. */
#ifndef UNBAKE_TESTS_RENDER_PAINTED_ROOM_H
#define UNBAKE_TESTS_RENDER_PAINTED_ROOM_H

#include "common/rng.h"
#include "server/capture/views.h"
#include "server/render/accel.h"
#include "server/scene/atlas.h"
#include "tests/render/small_room.h"

#ifndef PAINTED_WIDTH
#define PAINTED_WIDTH 160
#define PAINTED_HEIGHT 120
#define PAINTED_GLOSS 0.03f
#define PAINTED_SIDE 2 /* samples a row and column of a pixel */
#endif
#define PAINTED_FRAMES 24
#define PAINTED_TEXTURE 256

#define PAINTED_NOISE 0.0173f /* amplitude: 1 % in the root mean square */

/* What the next room has. */
static float painted_contrast = 1.0f, painted_noise = PAINTED_NOISE;
static float painted_mirror = 0.0f; /* share of what the surface mirrors that is added to its own radiance */

struct painted {
    bool tiles;
    struct parallel *pool;
    struct scene scene;
    struct segments segments;
    struct atlas atlas;
    struct inverse_uv inverse;
    struct accel *accel;
    struct views views;
    struct photograph clean[PAINTED_FRAMES]; /* as taken; pixels owned, names not */
};

/* Evenly distributed in [-1, 1]. */
static inline float painted_random(uint64_t frame, uint64_t what) {
    return 2.0f * rng_to_float((uint32_t)rng_key(frame, what, 7)) - 1.0f;
}

/* Radiance without the part that depends on the view: waves, or tiles with sharp edges. */
static inline rgb painted_radiance(const struct painted *room, int64_t object, vec3 p) {
    float shade = 0.6f + 0.15f * p.x + 0.1f * p.y + 0.05f * p.z;
    float wave = sinf(5.0f * p.x + 3.0f * p.y + 1.0f) * sinf(4.0f * p.z - 2.0f * p.y + 6.0f * p.x);
    float fine = sinf(17.0f * p.x + 5.0f * p.z) * sinf(15.0f * p.y + 9.0f * p.z + 0.5f);
    int tile = (int)floorf(2.3f * p.x + 0.37f) + (int)floorf(2.3f * p.y + 0.37f) + (int)floorf(2.3f * p.z + 0.37f);
    float paint = room->tiles ? (tile & 1 ? 1.3f : 0.7f) : 1.0f + 0.35f * wave + 0.35f * fine;
    return rgb_scale(wall_color[object], shade * (1.0f + painted_contrast * (paint - 1.0f)));
}

/* What a point mirrors towards a camera: it moves with the camera, as reflections do. */
static inline rgb painted_mirrored(const struct painted *room, vec3 point, vec3 direction, uint32_t triangle) {
    vec3 normal = vec3_normalize(mesh_cross(&room->scene.mesh, triangle));
    vec3 mirrored = vec3_mad(direction, -2.0f * vec3_dot(direction, normal), normal);
    struct accel_hit hit;
    if (!accel_intersect(room->accel, vec3_mad(point, 1e-4f, mirrored), mirrored, 0.0f, INFINITY, &hit))
        return (rgb){0, 0, 0};
    return painted_radiance(room, room->scene.mesh.object_id[hit.triangle], vec3_mad(point, hit.distance_m, mirrored));
}

static inline void painted_take(struct painted *room, int frame) {
    struct photograph *photo = &room->scene.photograph[frame];
    vec3 origin = camera_origin(&photo->camera);
    for (size_t i = 0; i < PAINTED_WIDTH * PAINTED_HEIGHT; i++) {
        rgb sum = {0, 0, 0};
        for (int k = 0; k < PAINTED_SIDE * PAINTED_SIDE; k++) {
            vec3 direction;
            struct accel_hit hit;
            float x = (float)(i % PAINTED_WIDTH) + ((float)(k % PAINTED_SIDE) + 0.5f) / PAINTED_SIDE;
            float y = (float)(i / PAINTED_WIDTH) + ((float)(k / PAINTED_SIDE) + 0.5f) / PAINTED_SIDE;
            if (!camera_direction(&photo->camera, x, y, &direction) ||
                !accel_intersect(room->accel, origin, direction, 0.0f, INFINITY, &hit))
                continue;
            vec3 point = vec3_mad(origin, hit.distance_m, direction);
            rgb value = painted_radiance(room, room->scene.mesh.object_id[hit.triangle], point);
            if (painted_mirror > 0.0f)
                value = rgb_mad(value, painted_mirror, painted_mirrored(room, point, direction, hit.triangle));
            float gloss = 1.0f + PAINTED_GLOSS * direction.x;
            sum = rgb_mad(sum, gloss / (PAINTED_SIDE * PAINTED_SIDE), value);
        }
        const float value[3] = {sum.r, sum.g, sum.b};
        for (size_t c = 0; c < 3; c++) {
            float noise = 1.0f + painted_noise * painted_random((uint64_t)frame, 3 * i + c);
            photo->pixel[i][c] = image_half_from_float(value[c] * noise);
        }
    }
}

/* A capture without faults of waves or of tiles: HDR frames of exposure 1, every eighth of them held out. */
static inline void painted_make(struct painted *room, int threads, bool tiles) {
    struct error err = {0};
    *room = (struct painted){.pool = parallel_new(threads), .tiles = tiles};
    make_mesh(&room->scene.mesh);
    segments_from_object_id(&room->segments, &room->scene.mesh);
    CHECK(atlas_make(&room->atlas, &room->scene.mesh, &room->segments, PAINTED_TEXTURE, 0.0f, ATLAS_PADDING, &err) ==
          STATUS_OK);
    inverse_uv_make(&room->inverse, &room->atlas, room->scene.mesh.triangle_count, room->pool);
    CHECK(accel_new(&room->accel, &room->scene.mesh, room->pool, &err) == STATUS_OK);
    room->scene.photograph = mem_calloc(PAINTED_FRAMES, sizeof *room->scene.photograph);
    room->scene.photograph_count = PAINTED_FRAMES;
    for (int f = 0; f < PAINTED_FRAMES; f++) {
        struct photograph *photo = &room->scene.photograph[f];
        *photo = (struct photograph){.is_hdr = true,
                                     .exposure_known = true,
                                     .exposure = 1.0f,
                                     .gain = {1, 1, 1},
                                     .clip = INFINITY,
                                     .is_test = f % 8 == 7};
        photo->name = mem_printf("frame %d", f);
        photo->camera = look(spread(f, 0.4f), spread(f * 7 + 3, 0.0f));
        photo->camera.width = PAINTED_WIDTH;
        photo->camera.height = PAINTED_HEIGHT;
        photo->camera.fx = photo->camera.fy = PAINTED_WIDTH / 1.6f;
        photo->camera.cx = PAINTED_WIDTH / 2.0f;
        photo->camera.cy = PAINTED_HEIGHT / 2.0f;
        photo->pixel = mem_array(PAINTED_WIDTH * PAINTED_HEIGHT, sizeof *photo->pixel);
        painted_take(room, f);
        room->clean[f] = *photo;
        room->clean[f].pixel = mem_array(PAINTED_WIDTH * PAINTED_HEIGHT, sizeof *photo->pixel);
        memcpy(room->clean[f].pixel, photo->pixel, PAINTED_WIDTH * PAINTED_HEIGHT * sizeof *photo->pixel);
    }
    views_init(&room->views, &room->scene, &room->segments, room->accel, room->pool);
}

/* Photographs as they were taken, whatever was done to them. */
static inline void painted_reset(struct painted *room) {
    for (int f = 0; f < PAINTED_FRAMES; f++) {
        struct photograph *photo = &room->scene.photograph[f];
        uint16_t(*pixel)[3] = photo->pixel;
        *photo = room->clean[f];
        photo->pixel = pixel;
        memcpy(pixel, room->clean[f].pixel, PAINTED_WIDTH * PAINTED_HEIGHT * sizeof *pixel);
    }
}

static inline void painted_release(struct painted *room) {
    for (int f = 0; f < PAINTED_FRAMES; f++)
        mem_free(room->clean[f].pixel);
    views_release(&room->views);
    accel_free(room->accel);
    inverse_uv_release(&room->inverse);
    atlas_release(&room->atlas);
    segments_release(&room->segments);
    scene_release(&room->scene);
    parallel_free(room->pool);
}

/* Multiplies the stored pixels by gain and the vignette exp(-vignette s); clips. */
static inline void painted_spoil(struct photograph *photo, rgb gain, float vignette) {
    const float g[3] = {gain.r, gain.g, gain.b};
    for (size_t i = 0; i < PAINTED_WIDTH * PAINTED_HEIGHT; i++) {
        float x = (float)(i % PAINTED_WIDTH) + 0.5f, y = (float)(i / PAINTED_WIDTH) + 0.5f;
        float falloff = expf(-vignette * photograph_radius(photo, x, y));
        for (size_t c = 0; c < 3; c++) {
            float value = image_float_from_half(photo->pixel[i][c]) * g[c] * falloff;
            photo->pixel[i][c] = image_half_from_float(fminf(value, photo->clip));
        }
    }
}

/* A horizontal smear over 2 `reach` + 1 pixels, as a camera that turned leaves it. */
static inline void painted_smear(struct photograph *photo, int reach) {
    float row[PAINTED_WIDTH][3];
    for (int y = 0; y < PAINTED_HEIGHT; y++) {
        uint16_t(*pixel)[3] = photo->pixel + y * PAINTED_WIDTH;
        for (int x = 0; x < PAINTED_WIDTH; x++) {
            for (int c = 0; c < 3; c++) {
                row[x][c] = 0.0f;
                for (int k = x - reach; k <= x + reach; k++) {
                    int from = k < 0 ? 0 : k < PAINTED_WIDTH ? k : PAINTED_WIDTH - 1;
                    row[x][c] += image_float_from_half(pixel[from][c]) / (float)(2 * reach + 1);
                }
            }
        }
        for (int x = 0; x < PAINTED_WIDTH; x++)
            for (int c = 0; c < 3; c++)
                pixel[x][c] = image_half_from_float(row[x][c]);
    }
}

/* Turns a camera about its axes and moves it along them, all evenly distributed up to the given
 * radians and metres. */
static inline void painted_misplace(struct camera *camera, uint64_t frame, float turn, float move) {
    struct rigid *m = &camera->world_from_camera;
    float w[3], v[3];
    for (uint64_t k = 0; k < 3; k++) {
        w[k] = turn * painted_random(frame, 100 + k);
        v[k] = move * painted_random(frame, 200 + k);
    }
    vec3 x = {m->rotation[0][0], m->rotation[1][0], m->rotation[2][0]};
    vec3 y = {m->rotation[0][1], m->rotation[1][1], m->rotation[2][1]};
    vec3 z = {m->rotation[0][2], m->rotation[1][2], m->rotation[2][2]};
    vec3 nx = vec3_normalize(vec3_sub(vec3_mad(x, w[2], y), vec3_scale(z, w[1])));
    vec3 nz = vec3_sub(vec3_mad(z, w[1], x), vec3_scale(y, w[0]));
    nz = vec3_normalize(vec3_mad(nz, -vec3_dot(nz, nx), nx));
    vec3 ny = vec3_cross(nz, nx);
    vec3 to = vec3_mad(vec3_mad(vec3_mad(m->translation, v[0], x), v[1], y), v[2], z);
    *m = (struct rigid){{{nx.x, ny.x, nz.x}, {nx.y, ny.y, nz.y}, {nx.z, ny.z, nz.z}}, to};
    camera->camera_from_world = rigid_inverse(m);
}

/* Root of the mean squared distance, in pixels, between where a frame's camera should see points of the
 * surface and where it does. */
static inline double painted_frame_shift(const struct painted *room, uint32_t frame) {
    double squares = 0.0, count = 0.0;
    const struct camera *truth = &room->clean[frame].camera, *found = &room->scene.photograph[frame].camera;
    for (int k = 0; k < 64; k++) {
        float x = PAINTED_WIDTH * ((float)(k % 8) + 0.5f) / 8.0f, u, depth_m;
        float y = PAINTED_HEIGHT * ((float)(k / 8) + 0.5f) / 8.0f, v;
        vec3 direction;
        struct accel_hit hit;
        if (!camera_direction(truth, x, y, &direction) ||
            !accel_intersect(room->accel, camera_origin(truth), direction, 0.0f, INFINITY, &hit))
            continue;
        vec3 point = vec3_mad(camera_origin(truth), hit.distance_m, direction);
        if (!camera_project(found, point, &u, &v, &depth_m))
            continue;
        squares += (double)((u - x) * (u - x) + (v - y) * (v - y));
        count += 1.0;
    }
    return sqrt(squares / fmax(count, 1.0));
}

/* The same over all training frames. */
static inline double painted_shift(const struct painted *room) {
    double squares = 0.0;
    for (size_t t = 0; t < room->views.train_count; t++) {
        double shift = painted_frame_shift(room, room->views.train[t]);
        squares += shift * shift;
    }
    return sqrt(squares / (double)room->views.train_count);
}

/* Fuses the photographs at an even choice of texels and compares with the truth: rms of the
 * logarithm's error, all channels, after the mean error (a matter of units) is taken off. */
static inline double painted_error(const struct painted *room) {
    double sum = 0.0, squares = 0.0, count = 0.0;
    for (size_t i = 0; i < room->inverse.valid_count; i += 37) {
        uint32_t texel = room->inverse.valid[i], triangle;
        float b1, b2;
        if (!inverse_uv_lookup(&room->inverse, &room->atlas, (float)(texel % PAINTED_TEXTURE) + 0.5f,
                               (float)(texel / PAINTED_TEXTURE) + 0.5f, &triangle, &b1, &b2))
            continue;
        vec3 point = mesh_point(&room->scene.mesh, triangle, b1, b2);
        vec3 normal = vec3_normalize(mesh_cross(&room->scene.mesh, triangle));
        rgb truth = painted_radiance(room, room->scene.mesh.object_id[triangle], point);
        double fused[3] = {0}, weight = 0.0;
        for (uint32_t t = 0; t < room->views.train_count; t++) {
            struct view view;
            struct photograph_sample s;
            const struct photograph *photo = &room->scene.photograph[room->views.train[t]];
            if (!views_sees(&room->views, t, point, normal, &view) || !views_clean(&room->views, &view) ||
                !photograph_sample(photo, view.x, view.y, &s) || photograph_sample_saturates(&s))
                continue;
            double w = (double)view.weight;
            fused[0] += w * log((double)s.radiance.r);
            fused[1] += w * log((double)s.radiance.g);
            fused[2] += w * log((double)s.radiance.b);
            weight += w;
        }
        const double wanted[3] = {log((double)truth.r), log((double)truth.g), log((double)truth.b)};
        for (int c = 0; c < 3 && weight > 0.0; c++) {
            double error = fused[c] / weight - wanted[c];
            sum += error;
            squares += error * error;
            count += 1.0;
        }
    }
    return sqrt(squares / count - sum * sum / (count * count));
}

#endif
