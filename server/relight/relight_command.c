/* relight_command.c -- see relight_command.h. */
#include "server/relight/relight_command.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"
#include "server/relight/cameras.h"
#include "server/relight/denoise.h"
#include "server/relight/relight.h"
#include "server/relight/relight_plan.h"
#include "server/relight/setting_files.h"

const struct command_option relight_flags[] = {
    {"out", 0, OPTION_TEXT, "FILE|DIR",
     "one picture (.png, or .exr for linear radiance), or a folder for all files (relit.png)"},
    {"set", 0, OPTION_TEXT, "NAME=VALUE", "a setting; --settings lists them; may be given many times"},
    {"settings", 0, OPTION_FLAG, NULL, "print what can be set"},
    {"view", 0, OPTION_TEXT, "WHICH",
     "--set view=WHICH: numbers of cameras from 0, names of their pictures, or all (0)"},
    {"cameras", 0, OPTION_TEXT, "WHICH",
     "--set cameras=WHICH: held_out, photographs, or a transforms.json with w and h (held_out)"},
    {"lights", 0, OPTION_TEXT, "on|off", "--set lights=on|off: whether the room's emitters shine (on)"},
    {"environment", 0, OPTION_TEXT, "WHICH",
     "--set environment=WHICH: found, none, sky, or a latitude-longitude map (found)"},
    {"environment-scale", 0, OPTION_TEXT, "F", "--set environment_scale=F: factor on its radiance (1)"},
    {"turn", 0, OPTION_TEXT, "DEG", "--set environment_turn=DEG: turns the map around the upward axis (0)"},
    {"up", 0, OPTION_TEXT, "AXIS", "--set up=AXIS: auto, x, y or z, the room's axis that is up (auto)"},
    {"exposure", 0, OPTION_TEXT, "F", "--set exposure=F: factor on radiance in a PNG; 0: chosen by the picture (0)"},
    {"spp", 0, OPTION_TEXT, "N", "--set spp=N: paths per pixel (64)"},
    {"max-depth", 0, OPTION_TEXT, "N", "--set max_depth=N: segments of a path (16)"},
    {"threads", 0, OPTION_TEXT, "N", "0: one per processor (0)"},
    {"quiet", 0, OPTION_FLAG, NULL, "no progress"},
    COMMAND_HELP_FLAG,
    {0},
};

/* Flags that stand for settings. */
static const struct {
    const char *flag, *setting;
} shorthands[] = {
    {"view", "view"},
    {"cameras", "cameras"},
    {"lights", "lights"},
    {"environment", "environment"},
    {"environment-scale", "environment_scale"},
    {"turn", "environment_turn"},
    {"up", "up"},
    {"exposure", "exposure"},
    {"spp", "spp"},
    {"max-depth", "max_depth"},
};

static bool has_ending(const char *name, const char *ending) {
    size_t length = strlen(name), wanted = strlen(ending);
    return length > wanted && strcmp(name + length - wanted, ending) == 0;
}

static void print_settings(void) {
    size_t count;
    const struct render_setting *t = render_settings_table(&count);
    for (size_t i = 0; i < count; i++)
        printf("  %-22s %s [%s%s%s]\n", t[i].name, t[i].help, t[i].default_text, *t[i].unit ? " " : "", t[i].unit);
}

/* --- settings of the command line ------------------------------------------------------------------------------- */

static enum status add_settings(const struct options *a, cJSON *settings, struct error *err) {
    enum status status = STATUS_OK;
    for (size_t i = 0; i < sizeof shorthands / sizeof *shorthands && status == STATUS_OK; i++) {
        const char *value = options_text(a, shorthands[i].flag, NULL);
        char *text = value ? mem_printf("%s=%s", shorthands[i].setting, value) : NULL;
        if (text)
            status = render_settings_parse_assignment(text, settings, err);
        mem_free(text);
    }
    for (size_t i = 0; i < a->given_count && status == STATUS_OK; i++)
        if (strcmp(a->given[i].option->name, "set") == 0)
            status = render_settings_parse_assignment(a->given[i].text, settings, err);
    return status;
}

/* What the room has not that the settings name; where a file cannot be read, rendering tells it. */
static enum status check_room(const char *outputs, const cJSON *settings, cJSON *problems) {
    const struct relight_job job = {.outputs = outputs, .settings = settings};
    cJSON *report = setting_files_report(&job), *cameras = cameras_own(&job);
    enum status status = render_settings_check_room(
        settings, report->child ? report : NULL, cJSON_GetObjectItemCaseSensitive(cameras, "frames"), problems, NULL);
    cJSON_Delete(report);
    cJSON_Delete(cameras);
    return status;
}

/* All faults, a line each. */
static bool settings_are_good(const char *outputs, const cJSON *settings) {
    cJSON *problems = cJSON_CreateArray();
    enum status status = render_settings_check(settings, RENDER_FILES_ANYWHERE, problems, NULL);
    if (status == STATUS_OK)
        status = check_room(outputs, settings, problems);
    for (const cJSON *p = problems->child; p; p = p->next) {
        const char *hint = cJSON_GetStringValue(cJSON_GetObjectItem(p, "hint"));
        fprintf(stderr, "unbaked: setting %s: %s%s%s\n", cJSON_GetStringValue(cJSON_GetObjectItem(p, "name")),
                cJSON_GetStringValue(cJSON_GetObjectItem(p, "reason")), hint ? "; " : "", hint ? hint : "");
    }
    cJSON_Delete(problems);
    return status == STATUS_OK;
}

/* Whether `out` can be written: a name that ends like a picture of another format is hardly meant to be a folder. */
static bool is_writable(const char *out) {
    static const char *const others[] = {".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp", ".hdr", ".heic", ".avif"};
    for (size_t i = 0; i < sizeof others / sizeof *others; i++) {
        if (!has_ending(out, others[i]))
            continue;
        fprintf(stderr, "unbaked: --out %.200s: pictures are .png, or .exr for linear radiance\n", out);
        return false;
    }
    return true;
}

/* A file's ending says the format. */
static bool add_format(const char *out, cJSON *settings) {
    bool is_exr = has_ending(out, ".exr");
    if (render_settings_has(settings, "format") || render_settings_has(settings, "passes")) {
        fputs("unbaked: with --out FILE there is one picture of radiance; give --out a folder for more\n", stderr);
        return false;
    }
    json_add_string(settings, "format", is_exr ? "exr" : "png");
    return true;
}

/* --- rendering -------------------------------------------------------------------------------------------------- */

static void on_progress(void *user, double done, double total) {
    (void)user;
    fprintf(stderr, "\r%5.1f %% of %.0f %s ", 100.0 * done / total, total, total > 1.0 ? "pictures" : "picture");
}

static void on_message(void *user, const char *text) {
    (void)user;
    fprintf(stderr, "\nunbaked relight: %s\n", text);
}

static enum status run_into(struct relight_job *job, uint32_t threads, bool is_quiet, struct error *err) {
    struct relight_watch watch = {.message = on_message};
    struct denoiser *denoiser = NULL;
    enum status status = STATUS_OK;
    if (!is_quiet && isatty(STDERR_FILENO))
        watch.progress = on_progress;
    if (render_settings_bool(job->settings, "denoise"))
        status = denoiser_open((int)threads, &denoiser, err);
    struct parallel *pool = parallel_new((int)threads);
    job->denoiser = denoiser;
    if (status == STATUS_OK)
        status = relight_run(job, &watch, pool, err);
    if (watch.progress)
        fputc('\n', stderr);
    parallel_free(pool);
    denoiser_free(denoiser);
    return status;
}

/* One picture, through a folder beside it. */
static enum status run_one(struct relight_job *job, const char *out, uint32_t threads, bool is_quiet,
                           struct error *err) {
    uint64_t pictures, pixels;
    char *folder = mem_printf("%s.part-%ld", out, (long)getpid());
    char *file = mem_printf("%s/00000_radiance%s", folder, strrchr(out, '.'));
    enum status status = relight_plan_count(job, &pictures, &pixels, err);
    if (status == STATUS_OK && pictures != 1)
        status = error_set(err, STATUS_INPUT, "the settings mean %llu pictures: give --out a folder for them",
                           (unsigned long long)pictures);
    job->out = folder;
    if (status == STATUS_OK)
        status = run_into(job, threads, is_quiet, err);
    if (status == STATUS_OK && rename(file, out) != 0)
        status = error_set_errno(err, errno, "cannot write %s", out);
    file_remove_tree(folder, NULL);
    mem_free(file);
    mem_free(folder);
    return status;
}

static int finish(enum status status, const struct error *err) {
    if (status == STATUS_OK)
        return EXIT_SUCCESS;
    fprintf(stderr, "unbaked relight: %s%s%s\n", err->message, *err->hint ? "; " : "", err->hint);
    return EXIT_FAILURE;
}

int relight_command(int argc, char **argv) {
    uint32_t threads = 0;
    const struct number_flag numbers[] = {{"threads", 0, 1024, .count = &threads}};
    struct options a;
    struct error err = {0};
    if (argc == 2 && strcmp(argv[1], "--settings") == 0) {
        print_settings();
        return EXIT_SUCCESS;
    }
    int code = arguments_begin(&a, argc, argv, relight_flags, numbers, sizeof numbers / sizeof *numbers, 1);
    if (code >= 0)
        return code;
    const char *out = options_text(&a, "out", "relit.png");
    bool is_file = has_ending(out, ".png") || has_ending(out, ".exr"), is_quiet = options_flag(&a, "quiet");
    cJSON *settings = cJSON_CreateObject();
    enum status status = add_settings(&a, settings, &err);
    if (status != STATUS_OK)
        fprintf(stderr, "unbaked: %s\n", err.message);
    code = EXIT_USAGE;
    if (status == STATUS_OK && settings_are_good(a.word[0], settings) && is_writable(out) &&
        (!is_file || add_format(out, settings))) {
        struct relight_job job = {.outputs = a.word[0], .settings = settings, .out = out};
        status = is_file ? run_one(&job, out, threads, is_quiet, &err) : run_into(&job, threads, is_quiet, &err);
        code = finish(status, &err);
    }
    cJSON_Delete(settings);
    options_release(&a);
    return code;
}
