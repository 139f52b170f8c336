/* relight_command.c -- see relight_command.h. */
#include "server/evaluate/relight_command.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "server/evaluate/relight.h"
#include "server/export/pictures.h"

const struct flag relight_flags[] = {
    {"--view", "N|NAME", "which camera: its number in the file, from 0, or its picture's name (0)"},
    {"--cameras", "FILE", "a transforms.json with w and h (OUTPUTS/views.json: held-out views)"},
    {"--environment", "FILE", "latitude-longitude map (.hdr, .exr, .png) in place of the recovered one; none: dark"},
    {"--environment-scale", "F", "factor on its radiance (1)"},
    {"--turn", "DEG", "turns FILE around the upward axis (0)"},
    {"--up", "x|y|z", "axis of the room that is FILE's top (y)"},
    {"--lights", "on|off", "whether recovered emitters emit (on)"},
    {"--out", "FILE", ".png, or .exr for linear radiance (relit.png)"},
    {"--exposure", "F", "factor on radiance in a .png; 0: chosen by the picture (0)"},
    {"--spp", "N", "paths per pixel (64)"},
    {"--max-depth", "N", "segments of a path (16)"},
    {"--threads", "N", "0: one per processor (0)"},
    COMMAND_HELP_FLAG,
    {0},
};

static bool has_ending(const char *name, const char *ending) {
    size_t length = strlen(name), wanted = strlen(ending);
    return length > wanted && strcmp(name + length - wanted, ending) == 0;
}

/* Settings whose values are words. */
static bool read_words(const struct arguments *a, struct relight_settings *s) {
    const char *up = arguments_value(a, "--up", (char[]){s->up, '\0'}), *lights = arguments_value(a, "--lights", "on");
    if (strlen(up) != 1 || !strchr("xyz", up[0])) {
        fprintf(stderr, "unbaked: --up must be x, y or z, not \"%s\"\n", up);
        return false;
    }
    if (strcmp(lights, "on") != 0 && strcmp(lights, "off") != 0) {
        fprintf(stderr, "unbaked: --lights must be on or off, not \"%s\"\n", lights);
        return false;
    }
    s->up = up[0];
    s->lights = strcmp(lights, "on") == 0;
    s->view = arguments_value(a, "--view", s->view);
    s->cameras = arguments_value(a, "--cameras", s->cameras);
    s->environment = arguments_value(a, "--environment", s->environment);
    return true;
}

int relight_command(int argc, char **argv) {
    struct relight_settings s = relight_default_settings();
    uint32_t threads = 0;
    float exposure = 0.0f;
    const struct number_flag numbers[] = {
        {"--environment-scale", 0, 1e9, .real = &s.environment_scale},
        {"--turn", -360, 360, .real = &s.turn_deg},
        {"--exposure", 0, 1e9, .real = &exposure},
        {"--spp", 1, 1 << 20, .count = &s.spp},
        {"--max-depth", 1, 32, .count = &s.max_depth},
        {"--threads", 0, 1024, .count = &threads},
    };
    struct arguments a;
    struct image image;
    struct error err;
    int code = arguments_begin(&a, argc, argv, relight_flags, numbers, sizeof numbers / sizeof *numbers, 1);
    if (code >= 0)
        return code;
    if (!read_words(&a, &s))
        return EXIT_USAGE;
    const char *out = arguments_value(&a, "--out", "relit.png");
    if (!has_ending(out, ".png") && !has_ending(out, ".exr")) {
        fprintf(stderr, "unbaked: --out must end in .png or .exr, not \"%s\"\n", out);
        return EXIT_USAGE;
    }
    struct parallel *pool = parallel_new((int)threads);
    enum status status = relight(a.words[0], &s, pool, &image, &err);
    parallel_free(pool);
    if (status == STATUS_OK && has_ending(out, ".exr"))
        status = image_write_exr(out, &image, IMAGE_FLOAT, false, &err);
    else if (status == STATUS_OK)
        status = image_write_png(out, &image, exposure > 0.0f ? exposure : picture_scale(&image), &err);
    image_release(&image);
    if (status == STATUS_OK)
        return EXIT_SUCCESS;
    fprintf(stderr, "unbaked relight: %s\n", err.message);
    return EXIT_FAILURE;
}
