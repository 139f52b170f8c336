/* evaluate.c -- see evaluate.h. */
#include "server/evaluate/evaluate.h"

#include <math.h>
#include <string.h>

#include "common/file.h"
#include "common/image.h"
#include "common/mem.h"
#include "common/quantile.h"
#include "server/capture/orient.h"
#include "server/evaluate/pair_picture.h"
#include "server/evaluate/seen.h"
#include "server/evaluate/stated_deviation.h"
#include "server/ingest/bundle.h"
#include "server/ingest/pixels.h"
#include "server/reconstruct/held_render.h"
#include "server/relight/recovered.h"
#include "server/render/film.h"
#include "server/scene/scene.h"

#define ROULETTE_DEPTH 5   /* see struct path_settings */
#define DISPLAY_MEDIAN 0.2 /* of the median radiance in pictures, white is 1; as reconstruct/report.c has it */

/* State shared by all views. */
struct evaluator {
    const struct evaluate_settings *settings;
    struct parallel *pool;
    const char *room;
    struct spill *pixels;
    struct scene scene;
    struct recovered recovered;
    bool *emits; /* [triangle_count] by the truth */
    struct seen seen;
    double median;            /* radiance of the training pixels */
    struct texture deviation; /* of base colour, as confidence.exr states it; texel NULL: it does not */
};

struct evaluate_settings evaluate_default_settings(void) {
    return (struct evaluate_settings){.samples = 16, .spp = 64, .max_depth = 16, .seed = 7};
}

/* --- photographs -------------------------------------------------------------------------- */

/* Radiance of a pixel's channels; false when it is masked or not finite. */
static bool pixel_radiance(const struct photograph *p, uint32_t x, uint32_t y, struct photograph_sample *sample) {
    return photograph_sample(p, (float)x + 0.5f, (float)y + 0.5f, sample);
}

/* The median over pixels and channels of all training photographs. */
static double training_median(const struct scene *scene) {
    size_t total = 0, count = 0;
    for (size_t i = 0; i < scene->photograph_count; i++)
        if (!scene->photograph[i].is_test)
            total += (size_t)scene->photograph[i].camera.width * scene->photograph[i].camera.height;
    float *value = mem_array(3 * total + 1, sizeof *value);
    for (size_t i = 0; i < scene->photograph_count; i++) {
        const struct photograph *p = &scene->photograph[i];
        for (uint32_t y = 0; !p->is_test && y < p->camera.height; y++) {
            for (uint32_t x = 0; x < p->camera.width; x++) {
                struct photograph_sample s;
                if (!pixel_radiance(p, x, y, &s))
                    continue;
                value[count++] = s.radiance.r;
                value[count++] = s.radiance.g;
                value[count++] = s.radiance.b;
            }
        }
    }
    double median = (double)quantile(value, count, 0.5);
    mem_free(value);
    return median;
}

/* The photograph's radiance and two re-renders (metrics.h), clipped alike. Masked pixels are NaN, which metrics leave
 * out. The photograph is made anew each time. */
static void make_pair(const struct photograph *p, const struct held_render *render, struct image *photograph,
                      struct image *halves) {
    uint32_t width = p->camera.width, height = p->camera.height;
    image_copy(&render->halves, halves);
    image_init_rgb(photograph, width, height);
    for (uint32_t y = 0; y < height; y++) {
        for (uint32_t x = 0; x < width; x++) {
            size_t pixel = (size_t)y * width + x;
            float *a = photograph->pixel + 3 * pixel, *b = halves->pixel + 6 * pixel;
            struct photograph_sample s;
            if (!pixel_radiance(p, x, y, &s)) {
                a[0] = a[1] = a[2] = NAN;
                continue;
            }
            memcpy(a, &s.radiance, 3 * sizeof *a);
            const float clip[3] = {s.clip_radiance.r, s.clip_radiance.g, s.clip_radiance.b};
            for (int c = 0; c < 6; c++)
                b[c] = fminf(b[c], clip[c % 3]);
        }
    }
}

static size_t test_views(const struct scene *scene) {
    size_t count = 0;
    for (size_t i = 0; i < scene->photograph_count; i++)
        count += scene->photograph[i].is_test;
    return count;
}

/* Renders a view until its MSRE is known well enough. */
static struct metric render_pair(struct evaluator *e, const struct photograph *p, uint32_t view,
                                 struct image *photograph, struct image *halves) {
    const struct path_settings path = {
        .max_depth = (int)e->settings->max_depth, .roulette_depth = ROULETTE_DEPTH, .seed = e->settings->seed};
    struct held_render render = {0};
    struct metric msre;
    *photograph = *halves = (struct image){0};
    do {
        image_release(photograph);
        image_release(halves);
        uint32_t iteration = view + render.rounds * (uint32_t)e->scene.photograph_count;
        held_render_add(&render, &e->recovered.world, &p->camera, e->settings->spp, &path, iteration, e->pool);
        make_pair(p, &render, photograph, halves);
        msre = metrics_msre(photograph, halves, e->median);
    } while (!held_render_is_done(&render, msre, test_views(&e->scene)));
    held_render_release(&render);
    return msre;
}

/* --- one test view ------------------------------------------------------------------------ */

/* "images/004.exr" -> "004"; the caller's. */
static char *stem_of(const char *name) {
    const char *slash = strrchr(name, '/'), *start = slash ? slash + 1 : name;
    const char *dot = strrchr(start, '.');
    return mem_strndup(start, dot ? (size_t)(dot - start) : strlen(start));
}

static enum status read_truth(const struct evaluator *e, const struct photograph *p, const char *stem,
                              struct image *truth, struct error *err) {
    static const char *const needed[] = {"base_color.R", "base_color.G", "base_color.B", "roughness", "specular",
                                         "emission.R",   "emission.G",   "emission.B",   "object_id"};
    char *path = mem_printf("%s/truth/%s.exr", e->room, stem);
    enum status status = image_read(path, truth, NULL, err);
    for (size_t i = 0; i < sizeof needed / sizeof *needed && status == STATUS_OK; i++)
        if (image_channel(truth, needed[i]) < 0)
            status = error_set(err, STATUS_INPUT, "%s: has no channel %s", path, needed[i]);
    if (status == STATUS_OK && (truth->width != p->camera.width || truth->height != p->camera.height))
        status = error_set(err, STATUS_INPUT, "%s: is not of its photograph's size", path);
    mem_free(path);
    return status;
}

/* Clears the flags of pixels where the truth's own samples hit an emitter or nothing. */
static void mark_by_truth(const struct image *truth, uint8_t *flags) {
    struct rgb_columns emission = pair_picture_columns(truth, "emission.");
    int object = image_channel(truth, "object_id");
    for (size_t i = 0; i < (size_t)truth->width * truth->height; i++) {
        const float *t = truth->pixel + i * truth->channel_count;
        bool emits = false;
        for (int c = 0; c < 3; c++)
            emits = emits || t[emission.at[c]] > 0.0f;
        if (emits || t[object] < 0.0f)
            flags[i] = 0;
    }
}

static enum status write_pair(const struct evaluator *e, const char *what, const char *stem, const struct image *a,
                              const struct image *b, const char *prefix, float scale, struct error *err) {
    char *path = mem_printf("%s/%s_%s.png", e->settings->pictures_dir, what, stem);
    enum status status = pair_picture_write(path, a, b, prefix, scale, err);
    mem_free(path);
    return status;
}

static enum status score_photograph(struct evaluator *e, const struct photograph *p, uint32_t view, const char *stem,
                                    const struct image *truth, struct evaluation *v, struct metric *msre,
                                    struct error *err) {
    struct image photograph, halves;
    *msre = render_pair(e, p, view, &photograph, &halves);
    smooth_areas_add(&v->smooth, &photograph, &halves, truth, e->median);
    char *path = mem_printf("%s/truth/flat_%s.exr", e->room, stem);
    enum status status = noise_floor_add(&v->floor, path, &photograph, msre->value, e->median, err);
    mem_free(path);
    if (status == STATUS_OK && e->settings->pictures_dir) {
        struct image render;
        held_render_mean(&halves, &render);
        status = write_pair(e, "view", stem, &photograph, &render, "",
                            e->median > 0.0 ? (float)(DISPLAY_MEDIAN / e->median) : 1.0f, err);
        image_release(&render);
    }
    image_release(&photograph);
    image_release(&halves);
    return status;
}

static enum status score_view(struct evaluator *e, const struct photograph *p, uint32_t view, struct evaluation *v,
                              struct metric *msre, struct error *err) {
    struct image truth = {0}, found = {0}, deviation = {0};
    char *stem = stem_of(p->name);
    uint8_t *flags = mem_array((size_t)p->camera.width * p->camera.height, 1);
    enum status status = read_truth(e, p, stem, &truth, err);
    if (status != STATUS_OK)
        goto out;
    film_render_first_hits(&e->recovered.world, &p->camera, e->settings->samples, e->settings->seed, e->pool, &found);
    seen_flags(&e->seen, &p->camera, e->pool, flags);
    mark_by_truth(&truth, flags);
    score_add(&v->score, &found, &truth, flags);
    if (e->deviation.texel) {
        stated_deviation_render(&e->recovered, &e->deviation, &p->camera, e->settings->samples, e->settings->seed,
                                e->pool, &deviation);
        deviation_coverage_add(&v->coverage, &found, &deviation, &truth, flags);
    }
    plain_surface_add(&v->plain, &found, &truth, flags);
    if (e->settings->pictures_dir)
        status = write_pair(e, "base_color", stem, &truth, &found, "base_color.", 1.0f, err);
    if (status == STATUS_OK && e->settings->spp)
        status = score_photograph(e, p, view, stem, &truth, v, msre, err);
out:
    image_release(&deviation);
    image_release(&found);
    image_release(&truth);
    mem_free(flags);
    mem_free(stem);
    return status;
}

static enum status score_views(struct evaluator *e, struct evaluation *v, struct error *err) {
    enum status status = STATUS_OK;
    double sum = 0.0, squares = 0.0, noise = 0.0, measured = 0.0;
    for (size_t i = 0; i < e->scene.photograph_count && status == STATUS_OK; i++) {
        const struct photograph *p = &e->scene.photograph[i];
        struct metric msre = {NAN, NAN};
        if (!p->is_test)
            continue;
        status = score_view(e, p, (uint32_t)i, v, &msre, err);
        v->view_count++;
        if (!isfinite(msre.value)) /* no re-render, or no usable pixel */
            continue;
        sum += msre.value;
        squares += msre.value * msre.value;
        noise += msre.noise * msre.noise;
        measured += 1.0;
    }
    v->msre = sum / measured;
    v->msre_noise_left = sqrt(noise) / measured;
    v->msre_deviation = sqrt(fmax(0.0, squares / measured - v->msre * v->msre));
    if (status == STATUS_OK && v->view_count == 0) {
        status = error_set(err, STATUS_INPUT, "%s: no photograph is held out, so there is nothing to compare", e->room);
        error_hint(err, "frames of transforms.json with \"split\": \"test\" are held out");
    }
    return status;
}

/* --- all ---------------------------------------------------------------------------------- */

static enum status load_room(struct evaluator *e, struct error *err) {
    struct bundle_limits limits = bundle_default_limits();
    pixels_use(e->pixels, &limits);
    cJSON *problems = cJSON_CreateArray();
    enum status status = bundle_load(e->room, e->settings->reading, &limits, e->pool, &e->scene, problems, err);
    cJSON_Delete(problems);
    if (status != STATUS_OK) {
        scene_release(&e->scene);
        return status;
    }
    e->emits = mem_calloc(e->scene.mesh.triangle_count, sizeof *e->emits);
    e->median = training_median(&e->scene);
    return STATUS_OK;
}

enum status evaluate_outputs(const char *room, const char *outputs, const struct evaluate_settings *settings,
                             struct parallel *pool, struct evaluation *v, struct error *err) {
    struct evaluator e = {.settings = settings, .pool = pool};
    memset(v, 0, sizeof *v);
    char *root = NULL;
    size_t turned;
    e.pixels = pixels_new_temporary();
    enum status status = bundle_root(room, &root, err);
    e.room = root;
    if (status == STATUS_OK)
        status = load_room(&e, err);
    if (status != STATUS_OK)
        goto out;
    status = orient_mesh(&e.scene, pool, &turned, err); /* turn the mesh as the outputs are: emitters emit from the
                                                         * front */
    if (status != STATUS_OK)
        goto out;
    status = recovered_load(outputs, &e.scene.mesh, pool, &e.recovered, err);
    if (status != STATUS_OK)
        goto out;
    status = stated_deviation_load(outputs, &e.recovered, &e.deviation, err);
    if (status == STATUS_OK)
        status = found_emitters_count(room, &e.scene.mesh, &e.recovered, e.emits, &v->emitters, err);
    if (status == STATUS_OK && settings->pictures_dir)
        status = file_make_dirs(settings->pictures_dir, err);
    if (status == STATUS_OK) {
        seen_init(&e.seen, &e.scene, e.recovered.world.accel, e.emits, pool);
        status = score_views(&e, v, err);
        seen_release(&e.seen);
    }
    texture_release(&e.deviation);
    recovered_release(&e.recovered);
out:
    mem_free(root);
    mem_free(e.emits);
    scene_release(&e.scene);
    spill_free(e.pixels);
    return status;
}

cJSON *evaluate_to_json(const struct evaluation *v) {
    const struct score *s = &v->score;
    cJSON *root = cJSON_CreateObject();
    json_add_int(root, "views", (int64_t)v->view_count);
    json_add_number(root, "base_color_psnr_db", score_psnr_db(s->base_color_seen));
    json_add_number(root, "base_color_psnr_all_db", score_psnr_db(s->base_color_all));
    json_add_number(root, "base_color_inside_psnr_db", score_psnr_db(s->base_color_inside));
    json_add_number(root, "base_color_ratio", score_base_color_ratio(s));
    json_add_number(root, "seen_share", s->plain_pixels ? (double)s->seen_pixels / (double)s->plain_pixels : 0.0);
    json_add_number(root, "base_color_within_one_deviation", score_share(v->coverage.within_one, v->coverage.count));
    json_add_number(root, "base_color_within_two_deviations", score_share(v->coverage.within_two, v->coverage.count));
    json_add_number(root, "plain_deviation", plain_surface_spread(&v->plain));
    json_add_number(root, "plain_specks", score_share(v->plain.specks, v->plain.pixels));
    json_add_number(root, "roughness_psnr_db", score_psnr_db(s->roughness));
    json_add_number(root, "roughness_rms_error", sqrt(score_mean(s->roughness)));
    json_add_number(root, "specular_psnr_db", score_psnr_db(s->specular));
    json_add_number(root, "specular_rms_error", sqrt(score_mean(s->specular)));
    json_add_number(root, "emission_iou", score_emission_iou(s));
    json_add_number(root, "emission_log_error", score_mean(s->emission_log));
    json_add_int(root, "emitters", (int64_t)v->emitters.count);
    json_add_int(root, "emitters_found", (int64_t)v->emitters.found);
    json_add_int(root, "emitters_missed", (int64_t)v->emitters.missed);
    json_add_int(root, "emitters_false", (int64_t)v->emitters.unfounded);
    json_add_number(root, "msre", v->msre);
    json_add_number(root, "msre_deviation", v->msre_deviation);
    json_add_number(root, "msre_noise_left", v->msre_noise_left);
    if (v->smooth.count > 0) {
        json_add_number(root, "even_share", (double)v->smooth.count / (double)s->pixels);
        json_add_number(root, "msre_even", v->smooth.render / (double)v->smooth.count);
        json_add_number(root, "msre_even_noise", v->smooth.noise / (double)v->smooth.count);
    }
    if (v->floor.count > 0) {
        json_add_int(root, "floor_views", (int64_t)v->floor.count);
        json_add_number(root, "msre_floor_views", v->floor.msre / (double)v->floor.count);
        json_add_number(root, "msre_floor", v->floor.floor / (double)v->floor.count);
    }
    return root;
}
