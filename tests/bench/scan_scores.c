/* scan_scores ROOM OUT [PICTURES [TRUTH]] -- compares what was recovered from a scan of a room with the room's truth.
 *
 * `unbaked evaluate` takes the outputs' mesh for the room's own. Here the outputs in OUT have the mesh of a scan: the
 * truth, what the training photographs see of it and where its lamps are come from ROOM and its own mesh, and both are
 * compared as cameras see them. Poses are ROOM's. A capture whose tracker drifted has a frame of its own, in which its
 * mesh lies: both meshes are laid over each other first, by points of the scan and where the surface of the room lies
 * along their normals (robust point-to-plane least squares; Chen & Medioni 1992). Prints JSON:
 *
 *   turned_degrees, moved           of the capture's frame against the room's
 *   base_color, base_color_inside   dB over seen pixels; the same where the 3 x 3 pixels around show one object
 *   holes                           share of the seen pixels where the scan has none: left out of what follows
 *   roughness, specular             dB, inside
 *   emission_overlap                intersection over union of the emitting pixels of the held-out views
 *   lamps, lamps_missed             true lamps that cover at least MIN_PIXELS of a training photograph; those of
 *                                   whose pixels less than half emit
 *   false_lamps                     recovered segments that emit, of whose pixels less than half show a lamp, or
 *                                   what is less than two pixels from one
 *   within_one_deviation, within_two_deviations   share of the errors of base colour that are at most so many of the
 *                                   deviations that confidence.exr states
 *   plain_specks                    as evaluate's (plain_surface.h)
 *
 * With PICTURES, and unless that is "": of each held-out view base_color_NNN.png (true | recovered). With TRUTH the
 * held-out views of that folder in place of ROOM's (scan_ceiling). */
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

#define SAMPLES 16
#define SEED 7
#define MIN_PIXELS 30 /* of one photograph */
#define NEAR_PX 2     /* beside a lamp */
#define NO_LAMP INT64_MIN
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

static enum status read_lamps(struct comparison *c, const char *room, struct error *err) {
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

static enum status load(struct comparison *c, const char *room, const char *out, struct error *err) {
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
static bool surface_along(const struct comparison *c, vec3 p, vec3 normal, float most, float *distance) {
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
static struct rigid nudged(const struct rigid *m, const double w[3], const double v[3]) {
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
static void align_step(const struct comparison *c, float most, struct rigid *room_from_scan) {
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

static void align(struct comparison *c) {
    vec3 low, high;
    struct rigid room_from_scan = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {0, 0, 0}};
    mesh_bounds(&c->room.mesh, &low, &high);
    float size = vec3_length(vec3_sub(high, low));
    for (int step = 0; step < ALIGN_STEPS; step++)
        align_step(c, ALIGN_SHARE * size, &room_from_scan);
    c->scan_from_room = rigid_inverse(&room_from_scan);
}

static struct camera in_scan(const struct comparison *c, const struct camera *camera) {
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

static double turned_degrees(const struct rigid *m) {
    double cosine = 0.5 * ((double)m->rotation[0][0] + (double)m->rotation[1][1] + (double)m->rotation[2][2] - 1.0);
    return acos(fmin(fmax(cosine, -1.0), 1.0)) * 180.0 / M_PI;
}

/* --- held-out views ------------------------------------------------------------------------ */

/* Pixels where the truth's samples hit a lamp or nothing, and those where the scan has a hole, are left out. */
static void leave_out(struct comparison *c, const struct image *truth, const struct image *found, uint8_t *flags) {
    struct rgb_columns emission = pair_picture_columns(truth, "emission.");
    int object = image_channel(truth, "object_id"), coverage = image_channel(found, "coverage");
    for (size_t i = 0; i < (size_t)truth->width * truth->height; i++) {
        const float *t = truth->pixel + i * truth->channel_count;
        bool is_seen = flags[i] & SCORE_SEEN,
             is_hole = found->pixel[i * found->channel_count + (size_t)coverage] < 1.0f;
        if (t[object] < 0.0f || t[emission.at[0]] + t[emission.at[1]] + t[emission.at[2]] > 0.0f)
            flags[i] = 0;
        c->seen_pixels += flags[i] && is_seen;
        c->hole_pixels += flags[i] && is_seen && is_hole;
        if (is_hole)
            flags[i] = 0;
    }
}

static enum status score_view(struct comparison *c, const struct photograph *p, const char *truths,
                              const char *pictures, struct error *err) {
    struct image truth = {0}, found = {0}, deviation = {0};
    char stem[4] = "";
    const char *slash = strrchr(p->name, '/');
    snprintf(stem, sizeof stem, "%.3s", slash ? slash + 1 : p->name);
    char *path = mem_printf("%s/%s.exr", truths, stem);
    uint8_t *flags = mem_array((size_t)p->camera.width * p->camera.height, 1);
    enum status status = image_read(path, &truth, NULL, err);
    mem_free(path);
    if (status != STATUS_OK)
        goto out;
    struct camera moved = in_scan(c, &p->camera);
    film_render_first_hits(&c->recovered.world, &moved, SAMPLES, SEED, c->pool, &found);
    seen_flags(&c->seen, &p->camera, c->pool, flags);
    leave_out(c, &truth, &found, flags);
    score_add(&c->score, &found, &truth, flags);
    if (c->deviation.texel) {
        stated_deviation_render(&c->recovered, &c->deviation, &moved, SAMPLES, SEED, c->pool, &deviation);
        deviation_coverage_add(&c->coverage, &found, &deviation, &truth, flags);
    }
    plain_surface_add(&c->plain, &found, &truth, flags);
    path = pictures ? mem_printf("%s/base_color_%s.png", pictures, stem) : NULL;
    if (path)
        status = pair_picture_write(path, &truth, &found, "base_color.", 1.0f, err);
    mem_free(path);
out:
    image_release(&truth);
    image_release(&found);
    image_release(&deviation);
    mem_free(flags);
    return status;
}

/* --- lamps, as the training photographs see them --------------------------------------------- */

struct lamp_counts {
    struct comparison *c;
    size_t *of_lamp, *of_lamp_found;      /* [objects of the room] in all photographs */
    size_t *most;                         /* [objects] in one photograph */
    size_t *of_segment, *of_segment_true; /* [segments] */
};

struct lamp_rows {
    const struct comparison *c;
    const struct camera *camera;
    struct camera moved; /* in the capture's frame */
    int64_t *lamp;       /* [height][width] object; NO_LAMP */
    int64_t *segment;    /* [height][width] recovered segment that emits there; NO_LAMP */
};

static void trace_row(void *user, size_t row, int thread) {
    (void)thread;
    const struct lamp_rows *rows = user;
    const struct comparison *c = rows->c;
    vec3 origin = camera_origin(rows->camera), direction;
    for (uint32_t x = 0; x < rows->camera->width; x++) {
        size_t at = row * rows->camera->width + x;
        struct accel_hit hit;
        rows->lamp[at] = rows->segment[at] = NO_LAMP;
        if (!camera_direction(rows->camera, (float)x + 0.5f, (float)row + 0.5f, &direction))
            continue;
        if (accel_intersect(c->accel, origin, direction, 0.0f, INFINITY, &hit) && c->emits[hit.triangle])
            rows->lamp[at] = c->room.mesh.object_id[hit.triangle];
        if (camera_direction(&rows->moved, (float)x + 0.5f, (float)row + 0.5f, &direction) &&
            accel_intersect(c->recovered.world.accel, camera_origin(&rows->moved), direction, 0.0f, INFINITY, &hit)) {
            uint32_t segment = c->recovered.segments.of_triangle[hit.triangle];
            if (!rgb_is_black(c->recovered.materials.emission[segment]))
                rows->segment[at] = segment;
        }
    }
}

static bool near_lamp(const struct lamp_rows *rows, long x, long y) {
    long width = (long)rows->camera->width, height = (long)rows->camera->height;
    for (long j = y - NEAR_PX; j <= y + NEAR_PX; j++)
        for (long i = x - NEAR_PX; i <= x + NEAR_PX; i++)
            if (i >= 0 && j >= 0 && i < width && j < height && rows->lamp[j * width + i] != NO_LAMP)
                return true;
    return false;
}

static void count_view(struct lamp_counts *n, const struct camera *camera, size_t objects) {
    size_t pixels = (size_t)camera->width * camera->height;
    struct lamp_rows rows = {n->c, camera, in_scan(n->c, camera), mem_array(pixels, sizeof *rows.lamp),
                             mem_array(pixels, sizeof *rows.segment)};
    size_t *here = mem_calloc(objects, sizeof *here);
    parallel_for(n->c->pool, camera->height, trace_row, &rows);
    for (size_t i = 0; i < pixels; i++) {
        if (rows.lamp[i] != NO_LAMP) {
            n->of_lamp[rows.lamp[i]]++;
            n->of_lamp_found[rows.lamp[i]] += rows.segment[i] != NO_LAMP;
            here[rows.lamp[i]]++;
        }
        if (rows.segment[i] != NO_LAMP) {
            n->of_segment[rows.segment[i]]++;
            n->of_segment_true[rows.segment[i]] +=
                near_lamp(&rows, (long)(i % camera->width), (long)(i / camera->width));
        }
    }
    for (size_t i = 0; i < objects; i++)
        n->most[i] = n->most[i] > here[i] ? n->most[i] : here[i];
    mem_free(here);
    mem_free(rows.lamp);
    mem_free(rows.segment);
}

static void count_lamps(struct comparison *c) {
    const struct mesh *mesh = &c->room.mesh;
    size_t objects = 0, segments = c->recovered.segments.count;
    for (size_t t = 0; t < mesh->triangle_count; t++)
        objects = (size_t)mesh->object_id[t] >= objects ? (size_t)mesh->object_id[t] + 1 : objects;
    struct lamp_counts n = {c,
                            mem_calloc(objects, sizeof(size_t)),
                            mem_calloc(objects, sizeof(size_t)),
                            mem_calloc(objects, sizeof(size_t)),
                            mem_calloc(segments, sizeof(size_t)),
                            mem_calloc(segments, sizeof(size_t))};
    for (size_t i = 0; i < c->room.photograph_count; i++)
        if (!c->room.photograph[i].is_test)
            count_view(&n, &c->room.photograph[i].camera, objects);
    for (size_t i = 0; i < objects; i++) {
        c->lamps += n.most[i] >= MIN_PIXELS;
        c->missed += n.most[i] >= MIN_PIXELS && 2 * n.of_lamp_found[i] < n.of_lamp[i];
    }
    for (size_t s = 0; s < segments; s++) {
        bool is_false = n.of_segment[s] > 0 && 2 * n.of_segment_true[s] < n.of_segment[s];
        c->false_lamps += is_false;
        c->false_pixels += is_false ? (double)n.of_segment[s] : 0.0;
    }
    mem_free(n.of_lamp);
    mem_free(n.of_lamp_found);
    mem_free(n.most);
    mem_free(n.of_segment);
    mem_free(n.of_segment_true);
}

/* --- all ----------------------------------------------------------------------------------- */

/* JSON has no NaN. */
static const char *share_text(char text[16], size_t part, size_t whole) {
    snprintf(text, 16, whole ? "%.4f" : "null", score_share(part, whole));
    return text;
}

static void print(const struct comparison *c) {
    char one[16], two[16], specks[16];
    const struct deviation_coverage *coverage = &c->coverage;
    const struct score *s = &c->score;
    printf(
        "{\"turned_degrees\": %.3f, \"moved\": %.4f,\n \"base_color\": %.3f, \"base_color_inside\": %.3f, \"roughness\": %.2f, \"specular\": %.2f,\n"
        " \"emission_overlap\": %.3f, \"emission_log_error\": %.3g, \"base_color_ratio\": %.3f,\n"
        " \"lamps\": %zu, \"lamps_missed\": %zu, \"false_lamps\": %zu, \"false_pixels\": %.0f, \"holes\": %.4f,\n"
        " \"within_one_deviation\": %s, \"within_two_deviations\": %s, \"plain_specks\": %s}\n",
        turned_degrees(&c->scan_from_room), (double)vec3_length(c->scan_from_room.translation),
        score_psnr_db(s->base_color_seen), score_psnr_db(s->base_color_inside), score_psnr_db(s->roughness),
        score_psnr_db(s->specular), score_emission_iou(s), score_mean(s->emission_log), score_base_color_ratio(s),
        c->lamps, c->missed, c->false_lamps, c->false_pixels, c->hole_pixels / c->seen_pixels,
        share_text(one, coverage->within_one, coverage->count), share_text(two, coverage->within_two, coverage->count),
        share_text(specks, c->plain.specks, c->plain.pixels));
}

static enum status run(int argc, char **argv, struct error *err) {
    struct comparison c = {.pool = parallel_new(0)};
    const char *pictures = argc > 3 && argv[3][0] ? argv[3] : NULL;
    char *truths = argc > 4 ? mem_strdup(argv[4]) : file_join(argv[1], "truth");
    enum status status = load(&c, argv[1], argv[2], err);
    if (status == STATUS_OK && pictures)
        status = file_make_dirs(pictures, err);
    if (status == STATUS_OK) {
        align(&c);
        seen_init(&c.seen, &c.room, c.accel, c.emits, c.pool);
        for (size_t i = 0; i < c.room.photograph_count && status == STATUS_OK; i++)
            if (c.room.photograph[i].is_test)
                status = score_view(&c, &c.room.photograph[i], truths, pictures, err);
        seen_release(&c.seen);
    }
    if (status == STATUS_OK) {
        count_lamps(&c);
        print(&c);
        texture_release(&c.deviation);
        recovered_release(&c.recovered);
    }
    mem_free(truths);
    accel_free(c.accel);
    mesh_release(&c.mesh);
    mem_free(c.emits);
    scene_release(&c.room);
    parallel_free(c.pool);
    return status;
}

int main(int argc, char **argv) {
    if (argc < 3) {
        fprintf(stderr, "usage: scan_scores ROOM OUT [PICTURES [TRUTH]]\n");
        return 2;
    }
    struct error err = {0};
    if (run(argc, argv, &err) == STATUS_OK)
        return 0;
    fprintf(stderr, "scan_scores: %s\n", err.message);
    return 1;
}
