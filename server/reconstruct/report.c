/* report.c -- see report.h. */
#include "server/reconstruct/report.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/mem.h"
#include "common/quantile.h"
#include "server/capture/luminance_unit.h"
#include "server/reconstruct/held_out_means.h"
#include "server/reconstruct/held_render.h"
#include "server/reconstruct/metrics.h"
#include "server/reconstruct/outlines.h"
#include "server/render/path.h"
#include "server/scene/photograph_reduce.h"
#include "server/state/evidence.h"
#include "server/state/held_out_size.h"
#include "server/state/pace.h"

/* Display value of the median of HDR photographs, for PSNR and SSIM; white is 1. By convention. */
#define DISPLAY_MEDIAN 0.2
/* XORed with the seed: random numbers distinct from the optimiser's. */
#define REPORT_SEED UINT64_C(0x7265706f7274)
/* A card within this of its reflectance is right: noise and texture of one texel. Chooses words of the report only. */
#define CARD_TOLERANCE 0.1
/* Least emitted share of a segment that is listed though it does not emit. */
#define MIN_REPORTED_SHARE 0.05f

/* The photograph's radiance as an R G B picture; masked pixels become NaN. */
static void photograph_radiance(const struct photograph *photo, struct image *image) {
    image_init_rgb(image, photo->camera.width, photo->camera.height);
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

/* Median ratio of render to photograph, in the sum of channels [first, end). */
static double fit_gain(const struct image *photograph, const struct image *render, size_t first, size_t end) {
    size_t pixels = (size_t)photograph->width * photograph->height, count = 0;
    double *ratio = mem_array(pixels, sizeof *ratio);
    for (size_t i = 0; i < pixels; i++) {
        double p = 0.0, r = 0.0;
        for (size_t c = first; c < end; c++) {
            p += (double)photograph->pixel[3 * i + c];
            r += (double)render->pixel[3 * i + c];
        }
        if (isfinite(p) && isfinite(r) && p > 0.0 && r > 0.0)
            ratio[count++] = r / p;
    }
    double gain = count ? quantile_double(ratio, count, 0.5) : 1.0;
    mem_free(ratio);
    return gain;
}

/* Fits exposure and white balance of a held-out photograph to the render where they are unknown or drift. */
static void fit_light(const struct reconstruction *r, struct photograph *photo, struct held_out *view) {
    double common = 1.0;
    if (!photo->exposure_known || r->exposures_drift)
        common = fit_gain(&view->photograph, &view->render, 0, 3);
    photo->exposure /= (float)common;
    for (size_t c = 0; c < 3; c++) {
        double gain = r->colors_drift ? fit_gain(&view->photograph, &view->render, c, c + 1) : common;
        (&photo->gain.r)[c] *= (float)(common / gain);
        for (size_t i = 0; i < (size_t)view->photograph.width * view->photograph.height; i++)
            view->photograph.pixel[3 * i + c] *= (float)gain;
    }
}

/* Clips renders, of three channels each, as their photograph is clipped. */
static void clip_image(struct image *image, const struct photograph *photo) {
    const float gain[3] = {photo->gain.r, photo->gain.g, photo->gain.b};
    for (size_t i = 0; i < (size_t)image->width * image->height; i++) {
        float x = (float)(i % image->width) + 0.5f, y = (float)(i / image->width) + 0.5f;
        float clip = photo->clip / (photo->exposure * photograph_falloff(photo, x, y));
        float *pixel = image->pixel + image->channel_count * i;
        for (size_t c = 0; c < image->channel_count; c++)
            pixel[c] = fminf(pixel[c], clip / gain[c % 3]);
    }
}

/* Samples of each pixel of the next view: the setting, or what the plan leaves for the remaining pixels. */
static uint32_t samples_of(const struct reconstruction *r, double pixels_left) {
    const struct plan_work *work = &r->plan.part[PLAN_REPORT];
    double samples = settings_number(r->settings, "report_samples");
    if (plan_is_cut(&r->plan, PLAN_REPORT))
        samples = fmin(fmax(floor((work->now - work->done) / pixels_left), 1.0), samples);
    return (uint32_t)samples;
}

/* Standard deviation of the noise of a photograph, each of whose pixels is the mean of `step` x `step`, given its
 * radiance `image`; NaN where that is. */
static void photograph_noise(const struct reconstruction *r, const struct photograph *photo, uint32_t step,
                             const struct image *image, struct image *noise) {
    image_init_rgb(noise, image->width, image->height);
    for (size_t i = 0; i < (size_t)image->width * image->height; i++) {
        const float *p = image->pixel + 3 * i;
        rgb radiance = {p[0], p[1], p[2]};
        bool usable = rgb_is_finite(radiance);
        float share = usable ? 1.0f / (float)step / sqrtf(noise_weight_of_brightness(&r->noise, photo, radiance)) : NAN;
        for (size_t c = 0; c < 3; c++)
            noise->pixel[3 * i + c] = share * p[c];
    }
}

/* Moves the pixels of a picture to where those of photographs are. */
static void move_pixels(struct image *image, struct spill *spill) {
    size_t count = (size_t)image->width * image->height;
    float *moved = spill_take(spill, count, 3 * sizeof *moved);
    spill_use(spill, moved, count * 3 * sizeof *moved);
    memcpy(moved, image->pixel, count * 3 * sizeof *moved);
    mem_free(image->pixel);
    image->pixel = moved;
}

static struct path_settings paths_of(const struct settings *set) {
    return (struct path_settings){
        .max_depth = (int)settings_number(set, "max_depth"),
        .roulette_depth = (int)settings_number(set, "roulette_depth"),
        .seed = (uint64_t)settings_number(set, "seed") ^ REPORT_SEED,
    };
}

/* The figures of a view from its two renders, which are clipped as the photograph is. */
static void measure_view(const struct reconstruction *r, const struct photograph *photo, struct held_out *view,
                         const struct image *halves, double median) {
    struct image noise;
    double exposure = photo->is_hdr ? DISPLAY_MEDIAN / median : (double)photo->exposure;
    struct metric psnr = metrics_psnr_db(&view->photograph, halves, exposure);
    photograph_noise(r, photo, view->step, &view->photograph, &noise);
    view->msre_render_noise = metrics_msre_of_renders(&view->photograph, halves, median);
    view->msre_photograph_noise = metrics_msre_of_photograph(&view->photograph, &noise, median);
    view->psnr_db = psnr.value;
    view->psnr_noise_left_db = psnr.noise;
    view->ssim = metrics_ssim(&view->photograph, halves, exposure);
    struct outline_error outlines =
        outlines_of_view(r->world.accel, &photo->camera, r->pool, &view->photograph, halves, median);
    view->msre_at_outlines = outlines.msre_part;
    view->outline_share = outlines.pixel_share;
    view->brightness_error = metrics_brightness_error(&view->photograph, halves);
    image_release(&noise);
}

/* Both renders as they are compared: clipped as the photograph is. *halves is the caller's. */
static struct metric compare(const struct photograph *photo, const struct held_out *view,
                             const struct held_render *render, double median, struct image *halves) {
    image_copy(&render->halves, halves);
    if (!photo->is_hdr)
        clip_image(halves, photo);
    return metrics_msre(&view->photograph, halves, median);
}

/* Renders the view of a photograph, again where its error is not known well, unless a time limit says how much is
 * done. */
static void render_view(struct reconstruction *r, struct photograph *photo, struct held_out *view, uint32_t samples,
                        double median, size_t views, const struct reconstruct_hooks *hooks) {
    const struct path_settings path = paths_of(r->settings);
    struct held_render render = {0};
    struct image halves;
    photograph_radiance(photo, &view->photograph);
    held_render_add(&render, &r->world, &photo->camera, samples, &path, 0, r->pool);
    held_render_mean(&render.halves, &view->render);
    fit_light(r, photo, view);
    struct metric msre = compare(photo, view, &render, median, &halves);
    while (!held_render_is_done(&render, msre, views) && isinf(r->plan.limit_sec) &&
           !hooks->stop_requested(hooks->user)) {
        image_release(&halves);
        image_release(&view->render);
        held_render_add(&render, &r->world, &photo->camera, samples, &path, render.rounds, r->pool);
        held_render_mean(&render.halves, &view->render);
        msre = compare(photo, view, &render, median, &halves);
    }
    if (!photo->is_hdr)
        clip_image(&view->render, photo);
    view->msre = msre.value;
    view->msre_noise_left = msre.noise;
    view->samples = render.spp;
    measure_view(r, photo, view, &halves, median);
    image_release(&halves);
    held_render_release(&render);
    move_pixels(&view->photograph, r->scene->spill);
    move_pixels(&view->render, r->scene->spill);
}

/* Compares a photograph with its view, at the size of camera_step; its exposure and gain are set where they are
 * fitted. */
static void compare_view(struct reconstruction *r, struct photograph *photo, struct held_out *view, uint32_t samples,
                         double median, size_t views, const struct reconstruct_hooks *hooks) {
    uint32_t step = camera_step(&photo->camera);
    struct photograph smaller;
    view->name = photo->name;
    view->step = step;
    view->camera = camera_reduced(&photo->camera, step);
    if (step == 1) {
        render_view(r, photo, view, samples, median, views, hooks);
        return;
    }
    photograph_reduce(photo, step, NULL, &smaller);
    render_view(r, &smaller, view, samples, median, views, hooks);
    photo->exposure = smaller.exposure;
    photo->gain = smaller.gain;
    photograph_release(&smaller);
}

void report_release_held_out(struct reconstruction *r) {
    for (size_t i = 0; i < r->held_out_count; i++) {
        struct image *both[] = {&r->held_out[i].photograph, &r->held_out[i].render};
        for (size_t k = 0; k < 2; k++) {
            spill_give(r->scene->spill, both[k]->pixel);
            both[k]->pixel = NULL;
            image_release(both[k]);
        }
    }
    mem_free(r->held_out);
    r->held_out = NULL;
    r->held_out_count = 0;
}

static cJSON *view_entry(const struct held_out *view) {
    cJSON *entry = cJSON_CreateObject();
    json_add_string(entry, "name", view->name);
    json_add_int(entry, "width", view->camera.width);
    json_add_int(entry, "height", view->camera.height);
    json_add_int(entry, "samples", view->samples);
    json_add_number(entry, "msre", view->msre);
    json_add_number(entry, "msre_noise_left", view->msre_noise_left);
    json_add_number(entry, "msre_render_noise", view->msre_render_noise);
    json_add_number(entry, "msre_photograph_noise", view->msre_photograph_noise);
    json_add_number(entry, "msre_at_outlines", view->msre_at_outlines);
    json_add_number(entry, "outline_share", view->outline_share);
    json_add_number(entry, "psnr_db", view->psnr_db);
    json_add_number(entry, "psnr_noise_left_db", view->psnr_noise_left_db);
    json_add_number(entry, "ssim", view->ssim);
    return entry;
}

enum status report_held_out(struct reconstruction *r, const struct views *views, const struct pace *pace,
                            struct error *err) {
    const struct reconstruct_hooks *hooks = pace->hooks;
    struct scene *scene = r->scene;
    size_t total = scene->photograph_count - views->train_count;
    double pixels_left = held_out_pixels(scene);
    struct held_out_means means = {0};
    cJSON *list = cJSON_AddArrayToObject(r->report, "views");
    enum status status = spill_reserve(scene->spill, "the held-out photographs and their renders", 2 * total,
                                       2 * 3 * sizeof(float) * (uint64_t)pixels_left, 0, err);
    if (status != STATUS_OK)
        return status;
    r->held_out = mem_calloc(total + 1, sizeof *r->held_out);
    for (size_t i = 0; i < scene->photograph_count; i++) {
        if (!scene->photograph[i].is_test)
            continue;
        struct held_out *view = &r->held_out[r->held_out_count++];
        uint32_t samples = samples_of(r, pixels_left);
        compare_view(r, &scene->photograph[i], view, samples, (double)views->median_radiance, total, hooks);
        double pixels = (double)view->camera.width * (double)view->camera.height;
        pixels_left -= pixels;
        held_out_means_add(&means, view);
        cJSON_AddItemToArray(list, view_entry(view));
        pace_advance(pace, "report", PLAN_REPORT, pixels * (double)view->samples);
        if (hooks->stop_requested(hooks->user))
            return error_set(err, STATUS_CANCELLED, "stopped while rendering the held-out views");
    }
    held_out_means_report(&means, total, hooks, r->report);
    r->materials.spread = hypotf(r->materials.spread, (float)held_out_means_brightness(&means));
    return STATUS_OK;
}

void report_grey_card(struct reconstruction *r, const struct reconstruct_hooks *hooks) {
    const struct grey_card *card = &r->grey_card;
    if (!card->is_given)
        return;
    const float *color = r->materials.base_color.texel[card->texel],
                point[3] = {card->point.x, card->point.y, card->point.z};
    double found = ((double)color[0] + (double)color[1] + (double)color[2]) / 3.0, place[3];
    for (int i = 0; i < 3; i++)
        place[i] = (double)point[i] + r->scene->mesh.offset[i];
    double ratio = found / card->pixel.value;
    cJSON *object = cJSON_AddObjectToObject(r->report, "grey_card");
    json_add_string(object, "photograph", card->pixel.photograph);
    json_add_int(object, "x", card->pixel.x);
    json_add_int(object, "y", card->pixel.y);
    json_add(object, "point", cJSON_CreateDoubleArray(place, 3));
    uint32_t segment = r->segments.of_triangle[card->triangle];
    const char *name = segments_name(&r->segments, &r->scene->mesh, segment);
    json_add_int(object, "segment", segment);
    if (name)
        json_add_string(object, "name", name);
    json_add_number(object, "reflectance", card->pixel.value);
    json_add_number(object, "base_color", found);
    json_add_number(object, "ratio", ratio);
    if (card->light_factor > 0.0)
        json_add_number(object, "unseen_light_scaled_by", card->light_factor);
    if (fabs(ratio - 1.0) <= CARD_TOLERANCE)
        return;
    char *text =
        mem_printf("grey card: base colour there came out as %.3g instead of %.3g; the light that is found there "
                   "is %.3g times that by which the card is right",
                   found, card->pixel.value, 1.0 / ratio);
    hooks->warning(hooks->user, text);
    mem_free(text);
}

void report_luminance(struct reconstruction *r, const struct reconstruct_hooks *hooks) {
    struct luminance_unit unit = luminance_unit_find(r->scene);
    double told = settings_number(r->settings, "luminance_per_unit");
    char line[160];
    if (!(told > 0.0) && unit.cd_per_m2 == 0.0)
        return;
    cJSON *object = cJSON_AddObjectToObject(r->report, "luminance_per_unit");
    r->luminance_per_unit = told > 0.0 ? told : unit.cd_per_m2;
    json_add_number(object, "cd_per_m2", r->luminance_per_unit);
    json_add_string(object, "source", told > 0.0 ? "setting" : "camera settings");
    if (unit.cd_per_m2 == 0.0)
        return;
    json_add_number(object, "by_camera_settings", unit.cd_per_m2);
    json_add_number(object, "within_factor", unit.within_factor);
    json_add_int(object, "photographs", (int64_t)unit.photographs);
    snprintf(
        line, sizeof line,
        "calibration: radiance 1 is %.3g cd/m2 by the camera settings of %zu photographs, within a factor of %.2g%s",
        unit.cd_per_m2, unit.photographs, unit.within_factor, told > 0.0 ? "; the setting says otherwise" : "");
    hooks->log(hooks->user, line);
}

void report_emitters(struct reconstruction *r) {
    cJSON *list = cJSON_AddArrayToObject(r->report, "emitters");
    for (size_t s = 0; s < r->segments.count; s++) {
        const struct emitter_evidence *evidence = &r->evidence[s];
        if (!r->is_emitter[s] && evidence->emitted_share < MIN_REPORTED_SHARE && evidence->changing_share == 0.0f)
            continue;
        cJSON *entry = cJSON_CreateObject();
        json_add_int(entry, "segment", (int64_t)s);
        json_add_int(entry, "object_id", r->segments.id[s]);
        const char *name = segments_name(&r->segments, &r->scene->mesh, s);
        if (name)
            json_add_string(entry, "name", name);
        json_add_bool(entry, "is_emitter", r->is_emitter[s]);
        json_add_bool(entry, "hidden", evidence->is_hidden);
        json_add_number(entry, "share_beyond_reflection", (double)evidence->emitted_share);
        json_add_number(entry, "probability_of_reflection", (double)evidence->reflection);
        json_add_number(entry, "share_that_changed", (double)evidence->changing_share);
        json_add_number(entry, "white_by_unseen_sky", (double)evidence->sky_lambert);
        const rgb *e = &r->materials.emission[s];
        const double radiance[3] = {(double)e->r, (double)e->g, (double)e->b};
        json_add(entry, "radiance", cJSON_CreateDoubleArray(radiance, 3));
        cJSON_AddItemToArray(list, entry);
    }
}
