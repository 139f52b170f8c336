/* capture_frame.h -- lays the mesh of a capture over the room's. */
#ifndef UNBAKE_TESTS_BENCH_CAPTURE_FRAME_H
#define UNBAKE_TESTS_BENCH_CAPTURE_FRAME_H

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/cholesky.h"
#include "common/file.h"
#include "common/image.h"
#include "common/json.h"
#include "common/mem.h"
#include "server/capture/orient.h"
#include "server/evaluate/pair_picture.h"
#include "server/evaluate/plain_surface.h"
#include "server/evaluate/score.h"
#include "server/evaluate/seen.h"
#include "server/evaluate/stated_deviation.h"
#include "server/ingest/bundle.h"
#include "server/ingest/mesh/mesh_file.h"
#include "server/relight/recovered.h"
#include "server/render/film.h"

#define ALIGN_POINTS 40000
#define ALIGN_STEPS 8
#define ALIGN_SHARE 0.015f /* of the room's diagonal: how far a capture's surface may lie from the room's */

struct comparison {
    struct parallel *pool;
    struct scene room;
    struct accel *accel; /* of the room's own mesh */
    bool *emits;         /* [triangle_count] of the room's own mesh */
    struct seen seen;
    struct mesh mesh; /* of OUT */
    struct rigid scan_from_room;
    struct recovered recovered;
    struct texture deviation; /* stated of base colour; texel NULL: none is */
    struct score score;
    struct deviation_coverage coverage;
    struct plain_surface plain;
    size_t lamps, missed, false_lamps;
    double false_pixels, seen_pixels, hole_pixels;
};

static inline enum status read_lamps(struct comparison *c, const char *room, struct error *err) {
    const struct mesh *mesh = &c->room.mesh;
    char *path = file_join(room, "truth/objects.json");
    cJSON *list = NULL;
    enum status status = json_read(path, (size_t)1 << 26, &list, err);
    c->emits = mem_calloc(mesh->triangle_count, sizeof *c->emits);
    for (const cJSON *o = list ? list->child : NULL; o && status == STATUS_OK; o = o->next) {
        const cJSON *emission = cJSON_GetObjectItemCaseSensitive(o, "emission");
        double id;
        bool emits = false;
        for (const cJSON *e = emission ? emission->child : NULL; e; e = e->next)
            emits = emits || e->valuedouble > 0.0;
        status = json_number(o, "id", path, -1.0, &id, err);
        for (size_t t = 0; t < mesh->triangle_count && emits; t++)
            c->emits[t] = c->emits[t] || mesh->object_id[t] == (int64_t)id;
    }
    cJSON_Delete(list);
    mem_free(path);
    return status;
}

static inline enum status load(struct comparison *c, const char *room, const char *out, struct error *err) {
    struct bundle_limits limits = bundle_default_limits();
    struct faces_report report;
    char *path = file_join(out, "scene.ply");
    size_t turned;
    enum status status = bundle_load(room, NULL, &limits, c->pool, &c->room, NULL, err);
    if (status == STATUS_OK)
        status = orient_mesh(&c->room, c->pool, &turned, err);
    if (status == STATUS_OK)
        status = read_lamps(c, room, err);
    if (status == STATUS_OK)
        status = accel_new(&c->accel, &c->room.mesh, c->pool, err);
    if (status == STATUS_OK)
        status = mesh_file_read(path, "scene.ply", MESH_MAX_TRIANGLES, &c->mesh, &report, err);
    if (status == STATUS_OK)
        status = recovered_load(out, &c->mesh, c->pool, &c->recovered, err);
    if (status == STATUS_OK)
        status = stated_deviation_load(out, &c->recovered, &c->deviation, err);
    mem_free(path);
    return status;
}

/* --- the capture's frame ------------------------------------------------------------------------ */

/* Distance along a unit normal, either way, from a point to the room's surface; false where that is farther than
 * `most`. */
static inline bool surface_along(const struct comparison *c, vec3 p, vec3 normal, float most, float *distance) {
    struct accel_hit ahead, behind;
    bool has_ahead = accel_intersect(c->accel, p, normal, 0.0f, most, &ahead);
    bool has_behind = accel_intersect(c->accel, p, vec3_scale(normal, -1.0f), 0.0f, most, &behind);
    if (!has_ahead && !has_behind)
        return false;
    bool takes_ahead = has_ahead && (!has_behind || ahead.distance_m < behind.distance_m);
    *distance = takes_ahead ? ahead.distance_m : -behind.distance_m;
    return true;
}

/* room_from_scan turned by w about the origin, then moved by v: small. */
static inline struct rigid nudged(const struct rigid *m, const double w[3], const double v[3]) {
    vec3 turn = {(float)w[0], (float)w[1], (float)w[2]}, column[3];
    struct rigid out;
    for (int k = 0; k < 3; k++) {
        vec3 axis = {m->rotation[0][k], m->rotation[1][k], m->rotation[2][k]};
        column[k] = vec3_add(axis, vec3_cross(turn, axis));
    }
    column[0] = vec3_normalize(column[0]);
    column[1] = vec3_normalize(vec3_mad(column[1], -vec3_dot(column[0], column[1]), column[0]));
    column[2] = vec3_cross(column[0], column[1]);
    for (int k = 0; k < 3; k++) {
        out.rotation[0][k] = column[k].x;
        out.rotation[1][k] = column[k].y;
        out.rotation[2][k] = column[k].z;
    }
    out.translation = vec3_add(vec3_add(m->translation, vec3_cross(turn, m->translation)),
                               (vec3){(float)v[0], (float)v[1], (float)v[2]});
    return out;
}

/* One step; `most`: how far from the room's surface points count. */
static inline void align_step(const struct comparison *c, float most, struct rigid *room_from_scan) {
    double a[6][6] = {{0.0}}, b[6] = {0.0};
    size_t every = c->mesh.triangle_count / ALIGN_POINTS + 1;
    for (size_t t = 0; t < c->mesh.triangle_count; t += every) {
        vec3 normal = rigid_direction(room_from_scan, vec3_normalize(mesh_cross(&c->mesh, t)));
        vec3 p = rigid_point(room_from_scan, mesh_point(&c->mesh, t, 1.0f / 3.0f, 1.0f / 3.0f));
        float r;
        if (!surface_along(c, p, normal, most, &r))
            continue;
        vec3 moment = vec3_cross(p, normal);
        const double d[6] = {(double)moment.x, (double)moment.y, (double)moment.z,
                             (double)normal.x, (double)normal.y, (double)normal.z};
        double scale = 0.25 * (double)most, w = 1.0 / (1.0 + (double)r * (double)r / (scale * scale));
        for (int i = 0; i < 6; i++) {
            b[i] += w * d[i] * (double)r;
            for (int j = 0; j <= i; j++)
                a[i][j] += w * d[i] * d[j];
        }
    }
    if (!cholesky_factor(6, 6, &a[0][0]))
        return;
    cholesky_solve(6, 6, &a[0][0], b);
    *room_from_scan = nudged(room_from_scan, b, b + 3);
}

static inline void align(struct comparison *c) {
    vec3 low, high;
    struct rigid room_from_scan = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {0, 0, 0}};
    mesh_bounds(&c->room.mesh, &low, &high);
    float size = vec3_length(vec3_sub(high, low));
    for (int step = 0; step < ALIGN_STEPS; step++)
        align_step(c, ALIGN_SHARE * size, &room_from_scan);
    c->scan_from_room = rigid_inverse(&room_from_scan);
}

static inline struct camera in_scan(const struct comparison *c, const struct camera *camera) {
    struct camera moved = *camera;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            moved.world_from_camera.rotation[i][j] = 0.0f;
            for (int k = 0; k < 3; k++)
                moved.world_from_camera.rotation[i][j] +=
                    c->scan_from_room.rotation[i][k] * camera->world_from_camera.rotation[k][j];
        }
    moved.world_from_camera.translation = rigid_point(&c->scan_from_room, camera->world_from_camera.translation);
    moved.camera_from_world = rigid_inverse(&moved.world_from_camera);
    return moved;
}

static inline double turned_degrees(const struct rigid *m) {
    double cosine = 0.5 * ((double)m->rotation[0][0] + (double)m->rotation[1][1] + (double)m->rotation[2][2] - 1.0);
    return acos(fmin(fmax(cosine, -1.0), 1.0)) * 180.0 / M_PI;
}

#endif
