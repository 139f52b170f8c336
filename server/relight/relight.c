/* relight.c -- see relight.h. Pictures in the order of their numbers: all suns of the first view, then the next. */
#include "server/relight/relight.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/clock.h"
#include "common/file.h"
#include "common/mem.h"
#include "common/output_names.h"
#include "common/protocol.h"
#include "server/export/pictures.h"
#include "server/export/views_json.h"
#include "server/ingest/mesh/mesh_file.h"
#include "server/relight/cameras.h"
#include "server/relight/denoise.h"
#include "server/relight/environment.h"
#include "server/relight/luminance_per_unit.h"
#include "server/relight/output.h"
#include "server/relight/picture.h"
#include "server/relight/relight_plan.h"
#include "server/relight/relit.h"
#include "server/render/film.h"

#define ROULETTE_DEPTH 5 /* segment of a path from which Russian roulette may end it */
#define UNTIL_SPP 65536  /* with noise or time_limit, where spp is not given */
#define METER_WIDTH 80   /* pixels of the picture that chooses the exposure; before the first preview: kept cheap */
#define METER_SPP 16     /* samples a pixel of that picture, whose mean is what counts */
#define PREVIEW_INTERVAL_SEC 1.0                  /* between two previews of a picture that is being rendered */
#define PICTURE_SEED UINT64_C(0x9e3779b97f4a7c15) /* between the seeds of two pictures */

struct relight_state {
    const struct relight_job *job;
    const struct relight_watch *watch;
    struct parallel *pool;
    struct cameras views;
    struct relit room;
    struct output output;
    struct path_settings path;
    struct picture_goal goal;
    uint32_t suns, sun;            /* sun: of distant light now */
    uint64_t picture;              /* being rendered */
    size_t part;                   /* of it: 0: all sources, then each alone */
    double done, total, shown_sec; /* shown_sec: when the last preview was written */
    bool has_direct, has_first, needs_light;
};

static bool wants(const struct relight_state *r, const char *pass) {
    return render_settings_lists(r->job->settings, "passes", pass);
}

static void say(const struct relight_state *r, const char *text) {
    if (r->watch->message)
        r->watch->message(r->watch->user, text);
}

static bool shines(const struct relight_state *r) { return lights_any(r->room.world.lights); }

static bool is_black(const struct image *image) {
    size_t values = (size_t)image->width * image->height * image->channel_count;
    for (size_t i = 0; i < values; i++)
        if (image->pixel[i] != 0.0f)
            return false;
    return true;
}

static void say_black(const struct relight_state *r, const char *why) {
    char text[128];
    snprintf(text, sizeof text, "picture %llu is black: %s", (unsigned long long)r->picture, why);
    say(r, text);
}

/* --- one picture ------------------------------------------------------------------------------------------------ */

/* How much of the picture is done, as far as its part is by that share. */
static double share_done(const struct relight_state *r, double of_part) {
    size_t alone = render_settings_bool(r->job->settings, "per_light") ? r->room.source_count : 0;
    size_t first = r->needs_light ? 0 : 1;
    return ((double)(r->part - first) + fmin(1.0, of_part)) / (double)(alone + 1 - first);
}

/* A look at the picture between two rounds. */
static bool look(void *user, const struct image *so_far, struct picture_quality quality) {
    struct relight_state *r = user;
    const struct relight_watch *w = r->watch;
    bool is_last = quality.spp >= r->goal.max_spp;
    if (w->should_stop && w->should_stop(w->user))
        return false;
    if (w->progress)
        w->progress(w->user, r->done + share_done(r, (double)quality.spp / r->goal.max_spp), r->total);
    if (w->preview && !is_last && r->part == 0 && clock_sec() - r->shown_sec >= PREVIEW_INTERVAL_SEC) {
        struct image shown;
        image_take_rgb(so_far, &shown);
        output_preview(&r->output, r->picture, &shown, NULL); /* a picture that is missed does no harm */
        image_release(&shown);
        r->shown_sec = clock_sec();
    }
    return true;
}

static struct path_settings path_of(const struct relight_state *r, uint64_t stream) {
    struct path_settings path = r->path;
    path.seed += PICTURE_SEED * stream;
    return path;
}

#define PASSES_MAX 16 /* of one view; the table of passes.c has fewer */

static struct output_formats formats_of(const struct relight_state *r) {
    const char *format = render_settings_text(r->job->settings, "format");
    return (struct output_formats){strcmp(format, "png") != 0, strcmp(format, "exr") != 0};
}

/* Passes of the picture as files, EXR as layers of one where that is asked for. */
static enum status put_passes(struct relight_state *r, const struct image *light, const struct image *first,
                              cJSON *files, struct error *err) {
    size_t count;
    const struct render_pass *pass = passes_table(&count);
    struct output_formats formats = formats_of(r);
    bool is_wanted[PASSES_MAX], is_layered = render_settings_bool(r->job->settings, "multilayer");
    struct image image;
    enum status status = STATUS_OK;
    for (size_t i = 0; i < count; i++)
        is_wanted[i] = wants(r, pass[i].name);
    if (is_layered) {
        passes_layered(is_wanted, &r->output.look, light, first, &image);
        status = output_layers(&r->output, r->picture, &image, files, err);
        image_release(&image);
        formats.is_exr = false;
    }
    for (size_t i = 0; i < count && status == STATUS_OK; i++) {
        if (!is_wanted[i] || (is_layered && pass[i].kind == PASS_DATA))
            continue;
        pass_take(&pass[i], light, first, &image);
        status = output_pass(&r->output, r->picture, &pass[i], pass[i].name, formats, &image, files, err);
        image_release(&image);
    }
    return status;
}

/* Each source alone. Their noise is independent. */
static enum status put_sources(struct relight_state *r, const struct camera *camera, cJSON *files, struct error *err) {
    enum status status = STATUS_OK;
    for (size_t i = 0; i < r->room.source_count && status == STATUS_OK; i++) {
        struct path_settings path = path_of(r, r->picture + ((uint64_t)(i + 1) << 32));
        struct picture_quality quality;
        struct image image;
        relit_light(&r->room, i, r->pool);
        r->part = i + 1;
        status =
            picture_render(&r->room.world, camera, &path, &r->goal, false, look, r, r->pool, &image, &quality, err);
        if (status != STATUS_OK)
            break;
        status = output_pass(&r->output, r->picture, passes_radiance(), r->room.source[i].name,
                             (struct output_formats){.is_exr = true}, &image, files, err);
        image_release(&image);
    }
    relit_light(&r->room, RELIT_ALL, r->pool);
    r->part = 0;
    return status;
}

static void add_sun(const struct relight_state *r, cJSON *record) {
    struct sky sky;
    if (!render_settings_is(r->job->settings, "environment", "sky") ||
        environment_sky(r->job, r->sun, &sky, NULL) != STATUS_OK)
        return;
    cJSON *sun = cJSON_AddObjectToObject(record, "sun");
    json_add_number(sun, "elevation_deg", sky.sun.elevation * 180.0 / PI);
    json_add_number(sun, "azimuth_deg", sky.sun.azimuth * 180.0 / PI);
}

/* Takes `files`. */
static enum status record(struct relight_state *r, const struct placed_camera *view, struct picture_quality quality,
                          cJSON *files, struct error *err) {
    cJSON *entry = views_json_frame(view->name, NULL, &view->camera, r->room.mesh.offset);
    json_add_int(entry, "picture", (int64_t)r->picture);
    add_sun(r, entry);
    if (r->needs_light) {
        json_add_int(entry, "spp", quality.spp);
        json_add_number(entry, "noise", quality.noise);
        json_add_bool(entry, "denoised", r->output.note != NULL);
    }
    json_add(entry, "files", files);
    return output_record(&r->output, r->picture, entry, err);
}

/* Radiance and direct light lose their noise; what is left of the former, indirect light, is their difference. */
static enum status denoise(struct relight_state *r, struct image *light, const struct image *first, struct error *err) {
    enum status status = denoiser_run(r->job->denoiser, light, 0, first, err);
    if (status == STATUS_OK && r->has_direct)
        status = denoiser_run(r->job->denoiser, light, 3, first, err);
    return status;
}

static enum status render_picture(struct relight_state *r, struct error *err) {
    const struct placed_camera *view = &r->views.view[r->picture / r->suns];
    const struct camera *camera = &view->camera;
    bool is_denoised = r->needs_light && render_settings_bool(r->job->settings, "denoise");
    struct image light = {0}, first = {0};
    struct picture_quality quality = {0};
    struct path_settings path = path_of(r, r->picture);
    cJSON *files = cJSON_CreateArray();
    enum status status = STATUS_OK;
    if (r->has_first || is_denoised)
        film_render_first_hits(&r->room.world, camera, RELIGHT_FIRST_HIT_SPP, r->path.seed, r->pool, &first);
    if (r->needs_light)
        status = picture_render(&r->room.world, camera, &path, &r->goal, r->has_direct, look, r, r->pool, &light,
                                &quality, err);
    if (status == STATUS_OK && r->needs_light && is_black(&light) && shines(r))
        say_black(r, "no light reaches what it shows");
    if (status == STATUS_OK && is_denoised)
        status = denoise(r, &light, &first, err);
    if (status == STATUS_OK)
        status = put_passes(r, &light, &first, files, err);
    if (status == STATUS_OK && render_settings_bool(r->job->settings, "per_light"))
        status = put_sources(r, camera, files, err);
    if (status == STATUS_OK)
        status = record(r, view, quality, files, err);
    else
        cJSON_Delete(files);
    image_release(&light);
    image_release(&first);
    return status;
}

/* --- all -------------------------------------------------------------------------------------------------------- */

static void read_settings(struct relight_state *r) {
    const cJSON *s = r->job->settings;
    double noise = render_settings_number(s, "noise"), seconds = render_settings_number(s, "time_limit");
    bool is_until = (noise > 0.0 || seconds > 0.0) && !render_settings_has(s, "spp");
    size_t count;
    const struct render_pass *pass = passes_table(&count);
    r->goal = (struct picture_goal){is_until ? UNTIL_SPP : (uint32_t)render_settings_number(s, "spp"), noise, seconds};
    r->path = (struct path_settings){.max_depth = (int)render_settings_number(s, "max_depth"),
                                     .roulette_depth = ROULETTE_DEPTH,
                                     .seed = (uint64_t)render_settings_number(s, "seed")};
    r->suns = environment_suns(r->job);
    r->needs_light = relight_plan_needs_light(s);
    r->has_direct = wants(r, "direct") || wants(r, "indirect");
    for (size_t i = 0; i < count; i++)
        r->has_first = r->has_first || (!pass[i].is_light && wants(r, pass[i].name));
}

static enum status use_sun(struct relight_state *r, uint32_t sun, struct error *err) {
    if (sun == r->sun)
        return STATUS_OK;
    r->sun = sun;
    return relit_set_sun(&r->room, r->job, &r->views.compass, sun, r->pool, err);
}

/* The exposure of all PNGs: told, or chosen by a small render of the first view under the middle sun, so that each part
 * of a job has the same. */
static enum status choose_exposure(struct relight_state *r, struct error *err) {
    const cJSON *s = r->job->settings;
    double told = render_settings_number(s, "exposure"), unit = render_settings_number(s, "luminance_per_unit");
    struct camera camera = r->views.view[0].camera;
    struct picture_quality quality;
    struct image image;
    r->output.look =
        (struct view_look){told > 0.0 ? (float)told : 1.0f, render_settings_is(s, "view_transform", "filmic"),
                           render_settings_is(s, "unit", "nits") ? (float)unit : 1.0f};
    if (told > 0.0 || render_settings_is(s, "format", "exr") || !(r->needs_light || wants(r, "emission")))
        return STATUS_OK;
    if (camera.width > METER_WIDTH)
        camera_resize(&camera, METER_WIDTH, (uint32_t)fmax(1.0, (double)METER_WIDTH * camera.height / camera.width));
    enum status status = use_sun(r, r->suns / 2, err);
    if (status == STATUS_OK)
        status = picture_render(&r->room.world, &camera, &r->path, &(struct picture_goal){.max_spp = METER_SPP}, false,
                                NULL, NULL, r->pool, &image, &quality, err);
    if (status != STATUS_OK)
        return status;
    r->output.look.exposure = picture_scale(&image);
    image_release(&image);
    return STATUS_OK;
}

static enum status check_denoiser(const struct relight_state *r, struct error *err) {
    if (!render_settings_bool(r->job->settings, "denoise") || r->job->denoiser)
        return STATUS_OK;
    enum status status =
        error_set(err, STATUS_UNAVAILABLE, "setting denoise: the library Open Image Denoise is not installed here");
    error_hint(err, "deploy/install-deps.sh oidn installs it");
    return status;
}

static enum status say_dark(struct error *err) {
    enum status status = error_set(err, STATUS_INPUT, "Nothing shines: the picture will be black.");
    error_hint(err, "light an emitter (light.N=on), add a lamp (lamp.1.kind=sphere), or give an environment");
    return status;
}

/* Views, room and output; what was made is released by run_close, also after a failure. */
static enum status run_open(struct relight_state *r, struct error *err) {
    struct mesh mesh = {0};
    char *scene = file_join(r->job->outputs, OUTPUT_MESH);
    enum status status = check_denoiser(r, err);
    if (status == STATUS_OK)
        status = mesh_file_read(scene, scene, MESH_MAX_TRIANGLES, &mesh, NULL, err);
    if (status == STATUS_NOT_FOUND)
        error_hint(err, "give a folder that `unbake get` has filled with a job's outputs");
    if (status == STATUS_OK)
        status = cameras_read(r->job, mesh.offset, &r->views, err);
    if (status == STATUS_OK)
        status = relit_make(r->job, &mesh, &r->views.compass, r->pool, &r->room, err);
    for (size_t i = 0; i < r->room.note_count && status == STATUS_OK; i++)
        say(r, r->room.note[i]);
    if (status == STATUS_OK)
        status = output_open(&r->output, r->job, r->watch, err);
    if (status == STATUS_OK && r->needs_light)
        status = use_sun(r, r->suns / 2, err);
    if (status == STATUS_OK && r->needs_light && !shines(r))
        status = say_dark(err);
    if (status == STATUS_OK)
        status = choose_exposure(r, err);
    if (status ==
        STATUS_OK) /* not before all that it needs is there: a wrong folder or setting leaves nothing behind */
        status = file_make_dirs(r->job->out, err);
    if (render_settings_bool(r->job->settings, "denoise") && r->job->denoiser)
        r->output.note = denoiser_version(r->job->denoiser);
    mesh_release(&mesh);
    mem_free(scene);
    return status;
}

static void run_close(struct relight_state *r) {
    output_close(&r->output);
    relit_release(&r->room);
    cameras_release(&r->views);
}

static enum status render_one(struct relight_state *r, struct error *err) {
    if (r->watch->should_stop && r->watch->should_stop(r->watch->user))
        return error_set(err, STATUS_CANCELLED, "the render was stopped");
    if (output_is_done(&r->output, r->picture))
        return STATUS_OK;
    enum status status = use_sun(r, (uint32_t)(r->picture % r->suns), err);
    if (status == STATUS_OK && r->needs_light && !shines(r))
        say_black(r, "the sun is below the horizon and nothing else shines");
    return status == STATUS_OK ? render_picture(r, err) : status;
}

/* Where all pictures are there, whoever rendered them. */
static enum status finish(struct relight_state *r, uint64_t pictures, struct error *err) {
    for (uint64_t i = 0; i < pictures; i++) {
        char key[24];
        snprintf(key, sizeof key, "%llu", (unsigned long long)i);
        if (!cJSON_GetObjectItemCaseSensitive(r->output.done, key))
            return STATUS_OK;
    }
    cJSON *head = cJSON_CreateObject();
    double unit = render_settings_number(r->job->settings, "luminance_per_unit");
    json_add_string(head, "unbake_version", UNBAKE_VERSION);
    json_add(head, "settings", cJSON_Duplicate(r->job->settings, true));
    json_add_number(head, "seed", render_settings_number(r->job->settings, "seed")); /* also where none was given */
    json_add_number(head, "exposure", (double)r->output.look.exposure);
    json_add_string(head, "unit", render_settings_text(r->job->settings, "unit"));
    if (unit > 0.0)
        json_add_number(head, "luminance_per_unit", unit);
    if (r->output.note)
        json_add_string(head, "denoiser", r->output.note);
    return output_views(&r->output, pictures, head, err);
}

enum status relight_run(const struct relight_job *job, const struct relight_watch *watch, struct parallel *pool,
                        struct error *err) {
    static const struct relight_watch nobody = {0};
    struct relight_job resolved = *job;
    struct relight_state r = {.job = &resolved, .watch = watch ? watch : &nobody, .pool = pool};
    cJSON *settings;
    enum status status = luminance_per_unit_resolve(job, r.watch, &settings, err);
    resolved.settings = settings;
    read_settings(&r);
    if (status == STATUS_OK)
        status = run_open(&r, err);
    uint64_t pictures = (uint64_t)r.views.count * r.suns, last = pictures;
    output_count(&r.output, pictures);
    if (status == STATUS_OK && job->view_count > 0 && job->view_count < pictures - job->first_view)
        last = job->first_view + job->view_count;
    r.total = (double)(last - job->first_view);
    for (r.picture = job->first_view; status == STATUS_OK && r.picture < last; r.picture++) {
        status = render_one(&r, err);
        r.done += 1.0;
        if (status == STATUS_OK && r.watch->progress)
            r.watch->progress(r.watch->user, r.done, r.total);
    }
    if (status == STATUS_OK)
        status = finish(&r, pictures, err);
    run_close(&r);
    cJSON_Delete(settings);
    return status;
}
