/* relight_room ROOM OUTPUTS DIR [OPTION=VALUE ...] -- how near renders of a recovered room in another light are to
 * those of the true room in the same light. ROOM is a bundle with truth/, OUTPUTS those of a reconstruction of it.
 * Lightings, all of them with what else shines turned off:
 *
 *   ball      a glowing ball in the middle of free space, nothing outside
 *   lamp N    one of the three brightest emitters of the truth alone
 *   sky       the map `sky`, with the segments `remove` taken away; not without a map, nor where nothing of it comes in
 *
 * Each is rendered twice of either room, with independent noise: o1, o2 of the recovered one, a, b of the true one.
 * PSNR is that of sRGB pictures at one exposure a lighting, of which the mean square is the mean of (o1 - a) (o2 - b),
 * to which noise adds nothing. The ratio is that of the means of radiance. Prints "what<TAB>value<TAB>goal<TAB>better"
 * and writes DIR/LIGHTING_N_ours.png and _true.png beside each other, means of two renders, and for comparisons that
 * noise does add to, single ones: _o1.png, _a.png, _b.png. The true room's outputs go to DIR/truth, renders to
 * DIR/renders, and a render that is there already is not made again; the caller removes what another program has made.
 *
 * Options: views=0,3,6 (numbers of held-out views), spp=64 (of each of the four), sky=FILE, remove=NAME, label=TEXT,
 * scan=OUTPUTS (those of a reconstruction of the same room on another mesh: they are compared, under the ball and the
 * sky, with the truth on the first), truth=DIR (where the true room and its renders are, or go to, in place of DIR).
 * The exit status is 1 where a figure misses one of least=PSNR, ratio=FACTOR. */
#include <stdio.h>
#include <unistd.h>

#include "server/export/pictures.h"
#include "tests/relit.h"
#include "tests/render/true_room.h"

#define LAMPS 3
#define OURS 2 /* renders of the recovered room, then those of the true one */
#define RENDERS 4
#define BALL_RADIANCE 10.0 /* any: the exposure follows */
#define GOAL_DB 33.0
#define GOAL_RATIO 1.03

struct relight_bench {
    const char *room, *outputs, *dir, *scan, *true_dir, *views, *sky, *remove, *label;
    double spp, least_db, most_ratio;
    struct true_room truth;
    char *true_outputs;
    struct parallel *pool;
    bool missed;
};

/* One picture of each render. */
struct relight_pictures {
    struct image render[RENDERS];
};

/* Sums over the pictures of a lighting. */
struct relight_sums {
    double square, ours, true_mean, count;
};

static double shown(float radiance, float exposure) {
    return (double)image_linear_to_srgb(fminf(fmaxf(radiance * exposure, 0.0f), 1.0f));
}

static void add_picture(const struct relight_pictures *p, float exposure, struct relight_sums *sums) {
    for (size_t i = 0; i < 3 * (size_t)p->render[0].width * p->render[0].height; i++) {
        float v[RENDERS];
        for (int k = 0; k < RENDERS; k++)
            v[k] = p->render[k].pixel[i];
        sums->square +=
            (shown(v[0], exposure) - shown(v[OURS], exposure)) * (shown(v[1], exposure) - shown(v[OURS + 1], exposure));
        sums->ours += (double)(v[0] + v[1]);
        sums->true_mean += (double)(v[OURS] + v[OURS + 1]);
        sums->count += 1.0;
    }
}

/* The mean of two renders. */
static void take_mean(const struct relight_pictures *p, int first, struct image *mean) {
    image_copy(&p->render[first], mean);
    for (size_t i = 0; i < 3 * (size_t)mean->width * mean->height; i++)
        mean->pixel[i] = 0.5f * (mean->pixel[i] + p->render[first + 1].pixel[i]);
}

static enum status write_mean(const struct relight_bench *b, const struct relight_pictures *p, int first,
                              const char *name, size_t picture, float exposure, struct error *err) {
    struct image mean;
    char *path = mem_printf("%s/%s_%zu_%s.png", b->dir, name, picture, first < OURS ? "ours" : "true");
    take_mean(p, first, &mean);
    enum status status = image_write_png(path, &mean, exposure, err);
    image_release(&mean);
    mem_free(path);
    return status;
}

/* Single renders: what a and b differ by is noise alone. */
static enum status write_singles(const struct relight_bench *b, const struct relight_pictures *p, const char *name,
                                 size_t picture, float exposure, struct error *err) {
    static const struct {
        int render;
        const char *what;
    } single[] = {{0, "o1"}, {OURS, "a"}, {OURS + 1, "b"}};
    enum status status = STATUS_OK;
    for (size_t i = 0; i < sizeof single / sizeof *single && status == STATUS_OK; i++) {
        char *path = mem_printf("%s/%s_%zu_%s.png", b->dir, name, picture, single[i].what);
        status = image_write_png(path, &p->render[single[i].render], exposure, err);
        mem_free(path);
    }
    return status;
}

static enum status read_pictures(char *const out[RENDERS], size_t picture, struct relight_pictures *p,
                                 struct error *err) {
    enum status status = STATUS_OK;
    char *name = mem_printf("%05zu_radiance.exr", picture);
    *p = (struct relight_pictures){0};
    for (int k = 0; k < RENDERS && status == STATUS_OK; k++)
        status = relit_read(out[k], name, &p->render[k], err);
    mem_free(name);
    return status;
}

static void release_pictures(struct relight_pictures *p) {
    for (int k = 0; k < RENDERS; k++)
        image_release(&p->render[k]);
}

static size_t count_views(const char *views) {
    size_t count = 1;
    for (const char *at = views; (at = strchr(at, ',')) != NULL; at++)
        count++;
    return count;
}

static void put_row(const char *what, const char *of, const char *label, double value, double goal,
                    const char *better) {
    printf("%s: %s (%s)\t%.6g\t%g\t%s\n", of, what, label, value, goal, better);
}

static void put_rows(struct relight_bench *b, const char *name, const struct relight_sums *sums) {
    if (!(sums->true_mean > 0.0)) {
        fprintf(stderr, "%s: none of that light comes into the true room: left out (%s)\n", name, b->label);
        return;
    }
    double ratio = sums->ours / sums->true_mean, db = -10.0 * log10(fmax(sums->square / sums->count, 1e-6));
    put_row("PSNR free of render noise, dB", name, b->label, db, GOAL_DB, "higher");
    put_row("factor between the means", name, b->label, fmax(ratio, 1.0 / ratio), GOAL_RATIO, "lower");
    fflush(stdout);
    b->missed = b->missed || db < b->least_db || !(fmax(ratio, 1.0 / ratio) <= b->most_ratio);
}

/* Compares what was rendered into four folders. */
static enum status compare(struct relight_bench *b, const char *name, char *const out[RENDERS], struct error *err) {
    struct relight_sums sums = {0};
    struct relight_pictures p;
    float exposure = 0.0f;
    enum status status = STATUS_OK;
    for (size_t i = 0; i < count_views(b->views) && status == STATUS_OK; i++) {
        status = read_pictures(out, i, &p, err);
        if (status == STATUS_OK && i == 0) {
            struct image mean;
            take_mean(&p, OURS, &mean);
            exposure = picture_scale(&mean);
            image_release(&mean);
        }
        if (status == STATUS_OK) {
            add_picture(&p, exposure, &sums);
            status = write_mean(b, &p, 0, name, i, exposure, err);
        }
        if (status == STATUS_OK)
            status = write_mean(b, &p, OURS, name, i, exposure, err);
        if (status == STATUS_OK)
            status = write_singles(b, &p, name, i, exposure, err);
        release_pictures(&p);
    }
    if (status == STATUS_OK)
        put_rows(b, name, &sums);
    return status;
}

/* Renders both rooms under one lighting, which is the settings `light`, and compares. */
static enum status try_lighting(struct relight_bench *b, const char *name, const char *light, struct error *err) {
    char *out[RENDERS] = {0};
    enum status status = STATUS_OK;
    for (int k = 0; k < RENDERS && status == STATUS_OK; k++) {
        bool is_true = k >= OURS;
        const char *outputs = is_true ? b->true_outputs : b->scan ? b->scan : b->outputs;
        char *settings = mem_printf("{\"view\":\"%s\",\"cameras\":\"%s/views.json\",\"format\":\"exr\",\"spp\":%g,"
                                    "\"seed\":%d,\"lights\":\"off\",%s}",
                                    b->views, b->true_outputs, b->spp, k + 1, light);
        out[k] = mem_printf("%s/renders/%s_%s_%d", is_true ? b->true_dir : b->dir, name, is_true ? "true" : "ours",
                            k % OURS);
        status = file_make_dirs(out[k], err);
        if (status == STATUS_OK)
            status = relit_into(out[k], outputs, settings, b->pool, err);
        mem_free(settings);
    }
    if (status == STATUS_OK)
        status = compare(b, name, out, err);
    for (int k = 0; k < RENDERS; k++)
        mem_free(out[k]);
    return status;
}

/* --- where the ball hangs ------------------------------------------------------------------------- */

static float clearance(const struct true_room *t, vec3 point) {
    float least = INFINITY;
    for (int i = 0; i < 27; i++) {
        vec3 d = vec3_make((float)(i % 3 - 1), (float)(i / 3 % 3 - 1), (float)(i / 9 - 1));
        struct accel_hit hit;
        if (i != 13 && accel_intersect(t->recovered.world.accel, point, vec3_normalize(d), 0.0f, INFINITY, &hit))
            least = fminf(least, hit.distance_m);
    }
    for (size_t v = 0; v < t->views.count; v++)
        least = fminf(least, vec3_length(vec3_sub(point, camera_origin(&t->views.view[v].camera))));
    return least;
}

/* Of the middles between two cameras the one that has most room around it. */
static vec3 free_place(const struct true_room *t, float *room) {
    vec3 best = camera_origin(&t->views.view[0].camera);
    *room = 0.0f;
    for (size_t a = 0; a < t->views.count; a++)
        for (size_t b = 0; b < a; b++) {
            vec3 sum = vec3_add(camera_origin(&t->views.view[a].camera), camera_origin(&t->views.view[b].camera));
            vec3 middle = vec3_scale(sum, 0.5f);
            float free_m = clearance(t, middle);
            if (isfinite(free_m) && free_m > *room) {
                *room = free_m;
                best = middle;
            }
        }
    return best;
}

static enum status try_ball(struct relight_bench *b, struct error *err) {
    float room;
    vec3 p = free_place(&b->truth, &room);
    char *light = mem_printf("\"lamp.1.kind\":\"sphere\",\"lamp.1.position\":[%.9g,%.9g,%.9g],\"lamp.1.radius\":%.9g,"
                             "\"lamp.1.radiance\":[%g,%g,%g],\"environment\":\"none\"",
                             (double)p.x + b->truth.mesh.offset[0], (double)p.y + b->truth.mesh.offset[1],
                             (double)p.z + b->truth.mesh.offset[2], (double)room / 4.0, BALL_RADIANCE, BALL_RADIANCE,
                             BALL_RADIANCE);
    enum status status = try_lighting(b, "ball", light, err);
    mem_free(light);
    return status;
}

/* --- the lamps, and the sky ----------------------------------------------------------------------- */

static double power(const struct true_segment *s) { return s->area_m2 * (double)rgb_luminance(s->emission); }

static enum status try_lamps(struct relight_bench *b, struct error *err) {
    enum status status = STATUS_OK;
    size_t count = b->truth.recovered.segments.count;
    bool *is_done = mem_calloc(count, sizeof *is_done);
    for (int n = 0; n < LAMPS && status == STATUS_OK; n++) {
        size_t best = count;
        for (size_t s = 0; s < count; s++)
            if (!is_done[s] && power(&b->truth.segment[s]) > (best < count ? power(&b->truth.segment[best]) : 0.0))
                best = s;
        if (best == count)
            break;
        is_done[best] = true;
        char *light = mem_printf("\"light.%zu\":1,\"environment\":\"none\"", best),
             *name = mem_printf("lamp %zu", best);
        status = try_lighting(b, name, light, err);
        if (status == STATUS_INPUT) { /* a lamp that was not found does not shine */
            printf("%s: PSNR free of render noise, dB (%s)\tnull\t%g\thigher\n", name, b->label, GOAL_DB);
            b->missed = true;
            status = STATUS_OK;
        }
        mem_free(light);
        mem_free(name);
    }
    mem_free(is_done);
    return status;
}

static enum status try_sky(struct relight_bench *b, struct error *err) {
    if (!b->sky)
        return STATUS_OK;
    char *light = mem_printf("\"environment\":\"%s\",\"remove\":\"%s\"", b->sky, b->remove);
    enum status status = try_lighting(b, "sky", light, err);
    mem_free(light);
    return status;
}

static bool read_option(struct relight_bench *b, const char *text) {
    static const char *const name[] = {
        "views=", "spp=", "sky=", "remove=", "label=", "scan=", "least=", "ratio=", "truth="};
    const char *value = strchr(text, '=') + 1;
    size_t which = 0;
    while (which < sizeof name / sizeof *name && strncmp(text, name[which], strlen(name[which])) != 0)
        which++;
    switch (which) {
    case 0: b->views = value; break;
    case 1: b->spp = atof(value); break;
    case 2: b->sky = value; break;
    case 3: b->remove = value; break;
    case 4: b->label = value; break;
    case 5: b->scan = value; break;
    case 6: b->least_db = atof(value); break;
    case 7: b->most_ratio = atof(value); break;
    case 8: b->true_dir = value; break;
    default: return false;
    }
    return true;
}

static enum status run(struct relight_bench *b, struct error *err) {
    if (!b->true_dir)
        b->true_dir = b->dir;
    b->true_outputs = file_join(b->true_dir, "truth");
    char *last = file_join(b->true_outputs, TRUE_ROOM_LAST_FILE);
    bool is_there = access(last, F_OK) == 0;
    enum status status = file_make_dirs(b->true_outputs, err);
    if (status == STATUS_OK)
        status = true_room_init(&b->truth, b->room, b->outputs, b->pool, err);
    if (status == STATUS_OK && !is_there)
        status = true_room_save(&b->truth, b->outputs, b->true_outputs, b->pool, err);
    if (status == STATUS_OK)
        status = try_ball(b, err);
    if (status == STATUS_OK && !b->scan)
        status = try_lamps(b, err);
    if (status == STATUS_OK)
        status = try_sky(b, err);
    true_room_release(&b->truth);
    mem_free(b->true_outputs);
    mem_free(last);
    return status;
}

int main(int argc, char **argv) {
    struct relight_bench b = {.views = "0,3,6", .remove = "", .label = "room", .spp = 64.0, .most_ratio = INFINITY};
    struct error err = {.message = ""};
    bool is_good = argc >= 4;
    for (int i = 4; i < argc && is_good; i++)
        is_good = strchr(argv[i], '=') && read_option(&b, argv[i]);
    if (!is_good) {
        fputs("usage: relight_room ROOM OUTPUTS DIR [OPTION=VALUE ...]\n", stderr);
        return 2;
    }
    b.room = argv[1], b.outputs = argv[2], b.dir = argv[3];
    b.pool = parallel_new(0);
    enum status status = run(&b, &err);
    parallel_free(b.pool);
    if (status != STATUS_OK)
        fprintf(stderr, "relight_room: %s\n", err.message);
    return status != STATUS_OK || b.missed;
}
