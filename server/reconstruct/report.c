/* report.c -- see report.h. */
#include "server/reconstruct/report.h"

#include <math.h>
#include <stdlib.h>

#include "common/mem.h"
#include "server/reconstruct/metrics.h"
#include "server/render/film.h"
#include "server/render/path.h"

/* At most this many texels are asked for their views one by one; larger atlases ask for one texel
 * of a block and give its answer to the whole block. */
#define CONFIDENCE_TEXELS ((size_t)8 << 20)
/* HDR frames are shown with their median at this fraction of white. */
#define SHOWN_MEDIAN 0.2
/* Seed offset that keeps the report's random numbers apart from the optimiser's. */
#define REPORT_SEED UINT64_C(0x7265706f7274)

/* The photograph's radiance as an R G B picture; masked pixels become NaN. */
static void photograph_radiance(const struct photograph *photo, struct image *image) {
    static const char *const names[] = {"R", "G", "B"};
    image_init(image, photo->camera.width, photo->camera.height, 3, names);
    for (uint32_t y = 0; y < image->height; y++) {
        for (uint32_t x = 0; x < image->width; x++) {
            float *out = image->pixel + 3 * ((size_t)y * image->width + x);
            struct photograph_sample s;
            bool usable = photograph_sample(photo, (float)x + 0.5f, (float)y + 0.5f, &s);
            out[0] = usable ? s.radiance.r : NAN;
            out[1] = usable ? s.radiance.g : NAN;
            out[2] = usable ? s.radiance.b : NAN;
        }
    }
}

static int compare_doubles(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* The factor by which the render is brighter than the photograph, by the median of ratios. */
static double fit_gain(const struct image *photograph, const struct image *render) {
    size_t pixels = (size_t)photograph->width * photograph->height, count = 0;
    double *ratio = mem_array(pixels, sizeof *ratio);
    for (size_t i = 0; i < pixels; i++) {
        double p = 0.0, r = 0.0;
        for (int c = 0; c < 3; c++) {
            p += (double)photograph->pixel[3 * i + (size_t)c];
            r += (double)render->pixel[3 * i + (size_t)c];
        }
        if (isfinite(p) && isfinite(r) && p > 0.0 && r > 0.0)
            ratio[count++] = r / p;
    }
    qsort(ratio, count, sizeof *ratio, compare_doubles);
    double gain = count ? ratio[count / 2] : 1.0;
    mem_free(ratio);
    return gain;
}

static void scale_image(struct image *image, double factor) {
    size_t values = (size_t)image->width * image->height * image->channel_count;
    for (size_t i = 0; i < values; i++)
        image->pixel[i] *= (float)factor;
}

/* A frame that saturates cannot tell how much brighter the room is than its clip. */
static void clip_image(struct image *image, const struct photograph *photo) {
    size_t pixels = (size_t)image->width * image->height;
    const float gain[3] = {photo->gain.r, photo->gain.g, photo->gain.b};
    for (size_t i = 0; i < 3 * pixels; i++)
        image->pixel[i] = fminf(image->pixel[i], photo->clip / (photo->exposure * gain[i % 3]));
}

/* The room as recovered, from a camera, as an R G B picture. */
static void render_radiance(struct reconstruction *r, const struct camera *camera,
                            const struct path_settings *path, struct image *image) {
    static const char *const names[] = {"R", "G", "B"};
    struct image film; /* has standard errors too */
    film_render(&r->world, camera, (uint32_t)settings_number(r->settings, "report_samples"), path, 0,
                r->pool, &film);
    image_init(image, film.width, film.height, 3, names);
    for (size_t i = 0; i < (size_t)film.width * film.height; i++) {
        for (size_t c = 0; c < 3; c++)
            image->pixel[3 * i + c] = film.pixel[film.channel_count * i + c];
    }
    image_release(&film);
}

static void render_view(struct reconstruction *r, struct photograph *photo, struct held_out *view,
                        double median) {
    const struct settings *set = r->settings;
    struct path_settings path = {
        .max_depth = (int)settings_number(set, "max_depth"),
        .roulette_depth = (int)settings_number(set, "roulette_depth"),
        .seed = (uint64_t)settings_number(set, "seed") ^ REPORT_SEED,
    };
    view->name = photo->name;
    photograph_radiance(photo, &view->photograph);
    render_radiance(r, &photo->camera, &path, &view->render);
    if (!photo->exposure_known) {
        double gain = fit_gain(&view->photograph, &view->render);
        scale_image(&view->photograph, gain);
        photo->exposure /= (float)gain;
    }
    if (!photo->is_hdr)
        clip_image(&view->render, photo);
    double exposure = photo->is_hdr ? SHOWN_MEDIAN / median : (double)photo->exposure;
    view->msre = metrics_msre(&view->photograph, &view->render, median);
    view->psnr_db = metrics_psnr_db(&view->photograph, &view->render, exposure);
    view->ssim = metrics_ssim(&view->photograph, &view->render, exposure);
}

enum status report_held_out(struct reconstruction *r, const struct views *views,
                            const struct reconstruct_hooks *hooks, struct error *err) {
    struct scene *scene = r->scene;
    size_t total = scene->photograph_count - views->train_count;
    cJSON *list = cJSON_AddArrayToObject(r->report, "views");
    double msre = 0.0, psnr = 0.0, ssim = 0.0;
    r->held_out = mem_calloc(total + 1, sizeof *r->held_out);
    for (size_t i = 0; i < scene->photograph_count; i++) {
        if (!scene->photograph[i].is_test)
            continue;
        struct held_out *view = &r->held_out[r->held_out_count++];
        render_view(r, &scene->photograph[i], view, (double)views->median_radiance);
        msre += view->msre / (double)total;
        psnr += view->psnr_db / (double)total;
        ssim += view->ssim / (double)total;
        cJSON *entry = cJSON_CreateObject();
        json_add_string(entry, "name", view->name);
        json_add_number(entry, "msre", view->msre);
        json_add_number(entry, "psnr_db", view->psnr_db);
        json_add_number(entry, "ssim", view->ssim);
        cJSON_AddItemToArray(list, entry);
        hooks->progress(hooks->user, "report", (double)r->held_out_count, (double)total, -1.0);
        if (hooks->stop_requested(hooks->user))
            return error_set(err, STATUS_CANCELLED, "stopped while rendering the held-out views");
    }
    cJSON *metrics = cJSON_AddObjectToObject(r->report, "metrics");
    json_add_int(metrics, "held_out_views", (int64_t)total);
    if (total > 0) {
        json_add_number(metrics, "msre", msre);
        json_add_number(metrics, "psnr_db", psnr);
        json_add_number(metrics, "ssim", ssim);
        hooks->metric(hooks->user, "msre", 0, msre);
    }
    return STATUS_OK;
}

struct confidence_job {
    struct reconstruction *r;
    const struct views *views;
    uint32_t side; /* texels of a block */
};

/* The first valid texel of a block, or INVERSE_UV_NONE. */
static uint32_t block_texel(const struct confidence_job *job, uint32_t x0, uint32_t y0) {
    const struct inverse_uv *inverse = &job->r->inverse;
    for (uint32_t y = y0; y < y0 + job->side && y < inverse->height; y++) {
        for (uint32_t x = x0; x < x0 + job->side && x < inverse->width; x++) {
            if (inverse->triangle[(size_t)y * inverse->width + x] != INVERSE_UV_NONE)
                return y * inverse->width + x;
        }
    }
    return INVERSE_UV_NONE;
}

static void confidence_of(const struct confidence_job *job, uint32_t texel, float *count, float *spread) {
    struct reconstruction *r = job->r;
    uint32_t triangle;
    float b1, b2;
    *count = *spread = 0.0f;
    if (!inverse_uv_lookup(&r->inverse, &r->atlas, (float)(texel % r->inverse.width) + 0.5f,
                           (float)(texel / r->inverse.width) + 0.5f, &triangle, &b1, &b2))
        return;
    vec3 point = mesh_point(&r->scene->mesh, triangle, b1, b2);
    vec3 normal = vec3_normalize(mesh_cross(&r->scene->mesh, triangle));
    double sum = 0.0, squares = 0.0, seen = 0.0;
    for (uint32_t t = 0; t < job->views->train_count; t++) {
        struct view view;
        struct photograph_sample s;
        if (!views_sees(job->views, t, point, normal, &view) || !views_clean(job->views, &view) ||
            !photograph_sample(&r->scene->photograph[job->views->train[t]], view.x, view.y, &s))
            continue;
        double value = log(fmax((double)rgb_mean(s.radiance), 1e-6 * (double)job->views->median_radiance));
        seen += 1.0;
        sum += value;
        squares += value * value;
    }
    *count = (float)seen;
    if (seen > 1.0)
        *spread = (float)sqrt(fmax(0.0, (squares - sum * sum / seen) / (seen - 1.0)));
}

static void confidence_row(void *user, size_t row, int thread) {
    (void)thread;
    const struct confidence_job *job = user;
    struct reconstruction *r = job->r;
    uint32_t width = r->inverse.width, y0 = (uint32_t)row * job->side;
    for (uint32_t x0 = 0; x0 < width; x0 += job->side) {
        uint32_t texel = block_texel(job, x0, y0);
        if (texel == INVERSE_UV_NONE)
            continue;
        float count, spread;
        confidence_of(job, texel, &count, &spread);
        for (uint32_t y = y0; y < y0 + job->side && y < r->inverse.height; y++) {
            for (uint32_t x = x0; x < x0 + job->side && x < width; x++) {
                size_t i = (size_t)y * width + x;
                if (r->inverse.triangle[i] == INVERSE_UV_NONE)
                    continue;
                r->confidence_count[i] = count;
                r->confidence_spread[i] = spread;
            }
        }
    }
}

void report_confidence(struct reconstruction *r, const struct views *views) {
    size_t texels = (size_t)r->inverse.width * r->inverse.height;
    struct confidence_job job = {.r = r, .views = views, .side = 1};
    while (r->inverse.valid_count / job.side / job.side > CONFIDENCE_TEXELS)
        job.side *= 2;
    r->confidence_count = mem_calloc_large(texels, sizeof(float));
    r->confidence_spread = mem_calloc_large(texels, sizeof(float));
    parallel_for(r->pool, (r->inverse.height + job.side - 1) / job.side, confidence_row, &job);
}
