/* relight_command.c -- `unbaked relight`: its options and the file that it writes. */
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "server/arguments.h"
#include "server/evaluate/relight.h"
#include "server/export/pictures.h"

static const char usage[] =
    "usage: unbaked relight OUTPUTS [option ...]\n"
    "\n"
    "Renders the room of a finished job (a folder that `unbake get` filled) under the light that was\n"
    "found, or under another.\n"
    "\n"
    "  --view N|NAME         which camera: its number in the file, from 0, or its picture's name (0)\n"
    "  --cameras FILE        a transforms.json with w and h (OUTPUTS/views.json: held-out views)\n"
    "  --environment FILE    distant light: .hdr, .exr or .png by latitude and longitude, in the place\n"
    "                        of what was found; none: darkness\n"
    "  --environment-scale F factor on its radiance (1)\n"
    "  --turn DEG            turns FILE around the upward axis (0)\n"
    "  --up x|y|z            axis of the room that is FILE's top (y)\n"
    "  --lights on|off       whether what was found to emit shines (on)\n"
    "  --out FILE            .png, or .exr for linear radiance (relit.png)\n"
    "  --exposure F          factor on radiance in a .png (0: chosen by the picture)\n"
    "  --spp N               paths per pixel (64)\n"
    "  --max-depth N         segments of a path (16)\n"
    "  --threads N           0: one for each processor (0)\n"
    "\n"
    "example: unbaked relight build/demo/out --lights off --environment sky.hdr --out sky.png\n";

struct arguments {
    struct relight_settings settings;
    double threads, exposure;
    const char *out, *outputs;
    bool help;
};

static bool read_word(const char *option, const char *text, const char *one, const char *other,
                      bool *is_one) {
    *is_one = strcmp(text, one) == 0;
    if (*is_one || strcmp(text, other) == 0)
        return true;
    fprintf(stderr, "unbaked relight: --%s wants %s or %s, not '%s'\n", option, one, other, text);
    return false;
}

static bool read_axis(const char *text, char *axis) {
    *axis = text[0];
    if (text[0] && strchr("xyz", text[0]) && text[1] == '\0')
        return true;
    fprintf(stderr, "unbaked relight: --up wants x, y or z, not '%s'\n", text);
    return false;
}

static bool has_ending(const char *name, const char *ending) {
    size_t length = strlen(name), wanted = strlen(ending);
    return length > wanted && strcmp(name + length - wanted, ending) == 0;
}

static bool read_option(int option, struct arguments *a) {
    struct relight_settings *s = &a->settings;
    double value = 0.0;
    bool ok = true;
    switch (option) {
    case 'v': s->view = optarg; break;
    case 'c': s->cameras = optarg; break;
    case 'e': s->environment = optarg; break;
    case 'f':
        ok = argument_number("relight", "environment-scale", optarg, 0.0, 1e9, false, &value);
        s->environment_scale = (float)value;
        break;
    case 'r':
        ok = argument_number("relight", "turn", optarg, -360.0, 360.0, false, &value);
        s->turn_deg = (float)value;
        break;
    case 'u': ok = read_axis(optarg, &s->up); break;
    case 'l': ok = read_word("lights", optarg, "on", "off", &s->lights); break;
    case 'o': a->out = optarg; break;
    case 'x': ok = argument_number("relight", "exposure", optarg, 0.0, 1e9, false, &a->exposure); break;
    case 's':
        ok = argument_number("relight", "spp", optarg, 1.0, 1048576.0, true, &value);
        s->spp = (uint32_t)value;
        break;
    case 'd':
        ok = argument_number("relight", "max-depth", optarg, 1.0, 32.0, true, &value);
        s->max_depth = (uint32_t)value;
        break;
    case 't': ok = argument_number("relight", "threads", optarg, 0.0, 1024.0, true, &a->threads); break;
    case 'h': a->help = true; break;
    default: ok = false;
    }
    return ok;
}

static bool read_arguments(int argc, char **argv, struct arguments *a) {
    static const struct option option[] = {
        {"view", required_argument, NULL, 'v'},        {"cameras", required_argument, NULL, 'c'},
        {"environment", required_argument, NULL, 'e'}, {"environment-scale", required_argument, NULL, 'f'},
        {"turn", required_argument, NULL, 'r'},        {"up", required_argument, NULL, 'u'},
        {"lights", required_argument, NULL, 'l'},      {"out", required_argument, NULL, 'o'},
        {"exposure", required_argument, NULL, 'x'},    {"spp", required_argument, NULL, 's'},
        {"max-depth", required_argument, NULL, 'd'},   {"threads", required_argument, NULL, 't'},
        {"help", no_argument, NULL, 'h'},              {NULL, 0, NULL, 0},
    };
    optind = 1;
    for (int c; (c = getopt_long(argc, argv, "", option, NULL)) != -1;)
        if (!read_option(c, a))
            return false;
    if (a->help)
        return true;
    if (optind != argc - 1) {
        fprintf(stderr, "unbaked relight: name the outputs' folder; --help says more\n");
        return false;
    }
    if (!has_ending(a->out, ".png") && !has_ending(a->out, ".exr")) {
        fprintf(stderr, "unbaked relight: --out wants a name that ends in .png or .exr, not '%s'\n", a->out);
        return false;
    }
    a->outputs = argv[optind];
    return true;
}

int relight_command(int argc, char **argv) {
    struct arguments a = {.settings = relight_default_settings(), .out = "relit.png"};
    struct image image;
    struct error err;
    if (!read_arguments(argc, argv, &a))
        return EXIT_USAGE;
    if (a.help) {
        fputs(usage, stdout);
        return EXIT_SUCCESS;
    }
    struct parallel *pool = parallel_new((int)a.threads);
    enum status status = relight(a.outputs, &a.settings, pool, &image, &err);
    parallel_free(pool);
    if (status == STATUS_OK && has_ending(a.out, ".exr"))
        status = image_write_exr(a.out, &image, IMAGE_FLOAT, false, &err);
    else if (status == STATUS_OK)
        status = image_write_png(a.out, &image, a.exposure > 0.0 ? (float)a.exposure : picture_scale(&image),
                                 &err);
    image_release(&image);
    if (status == STATUS_OK)
        return EXIT_SUCCESS;
    fprintf(stderr, "unbaked relight: %s\n", err.message);
    return EXIT_FAILURE;
}
