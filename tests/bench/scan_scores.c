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
 * With PICTURES, and unless that is "": of each held-out view base_color_NNN.png and emission_NNN.png (true and
 * recovered). With TRUTH the held-out views of that folder in place of ROOM's (scan_ceiling). */
#include "tests/bench/capture_frame.h"

#define SAMPLES 16
#define SEED 7
#define MIN_PIXELS 30 /* of one photograph */
#define NEAR_PX 2     /* beside a lamp */
#define NO_LAMP INT64_MIN

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

static enum status write_pictures(const char *folder, const char *stem, const struct image *truth,
                                  const struct image *found, struct error *err) {
    const char *const names[] = {"base_color", "emission"};
    enum status status = STATUS_OK;
    for (size_t i = 0; i < sizeof names / sizeof *names && status == STATUS_OK; i++) {
        char *path = mem_printf("%s/%s_%s.png", folder, names[i], stem), *prefix = mem_printf("%s.", names[i]);
        status = pair_picture_write(path, truth, found, prefix, 1.0f, err);
        mem_free(path);
        mem_free(prefix);
    }
    return status;
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
    if (pictures)
        status = write_pictures(pictures, stem, &truth, &found, err);
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
