/* command.c -- `unbaked demo-room`: its options. */
#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "server/arguments.h"
#include "server/demo/generate.h"

static const char usage[] =
    "usage: unbaked demo-room DIR [option ...]\n"
    "\n"
    "Makes a furnished room whose materials and lights are known, photographs it and writes a\n"
    "bundle to DIR that `unbake submit DIR` takes, with the truth in DIR/truth.\n"
    "\n"
    "  --width N              pixels across a photograph (160)\n"
    "  --height N             pixels down (120)\n"
    "  --frames N             photographs to reconstruct from (40)\n"
    "  --test-frames N        photographs held out (8)\n"
    "  --spp N                paths per pixel (48)\n"
    "  --test-spp N           paths per pixel of the held-out ones (128)\n"
    "  --max-depth N          segments of a path (12)\n"
    "  --wall-radiance V      of the emitter on the wall (15); 0: it is off\n"
    "  --ceiling-radiance V   of the emitter at the ceiling (15)\n"
    "  --sdr                  8-bit photographs, exposures cycling over three values\n"
    "  --texture-size N       texels a side of the room's own textures (1024)\n"
    "  --seed N               names the random numbers and viewpoints (1)\n"
    "  --threads N            0: one for each processor (0)\n"
    "\n"
    "example: unbaked demo-room /tmp/room --sdr --wall-radiance 25 --ceiling-radiance 3\n";

struct arguments {
    struct demo_settings settings;
    uint32_t threads;
    const char *dir;
};

/* EXIT_SUCCESS to go on, EXIT_USAGE to stop; --help is handled by the caller (-1). */
static int read_arguments(int argc, char **argv, struct arguments *a) {
    struct demo_settings *s = &a->settings;
    double seed = (double)s->seed;
    const struct {
        const char *name;
        double low, high;
        uint32_t *whole;
        float *real;
    } number[] = {
        {"width", 8, 8192, &s->width, NULL},
        {"height", 8, 8192, &s->height, NULL},
        {"frames", 3, 160, &s->train_count, NULL},
        {"test-frames", 0, 60, &s->test_count, NULL},
        {"spp", 4, 65536, &s->spp, NULL},
        {"test-spp", 4, 65536, &s->test_spp, NULL},
        {"max-depth", 2, 32, &s->max_depth, NULL},
        {"wall-radiance", 0, 1e6, NULL, &s->wall_radiance},
        {"ceiling-radiance", 0, 1e6, NULL, &s->ceiling_radiance},
        {"texture-size", 128, 8192, &s->texture_size, NULL},
        {"threads", 0, 1024, &a->threads, NULL},
    };
    enum { NUMBERS = sizeof number / sizeof *number, SEED = NUMBERS, SDR, HELP };
    struct option option[HELP + 2] = {{0}};
    for (int i = 0; i < NUMBERS; i++)
        option[i] = (struct option){number[i].name, required_argument, NULL, 'A' + i};
    option[SEED] = (struct option){"seed", required_argument, NULL, 'A' + SEED};
    option[SDR] = (struct option){"sdr", no_argument, NULL, 'A' + SDR};
    option[HELP] = (struct option){"help", no_argument, NULL, 'A' + HELP};
    optind = 1;
    for (int c; (c = getopt_long(argc, argv, "", option, NULL)) != -1;) {
        int i = c - 'A';
        double value;
        if (c == '?')
            return EXIT_USAGE;
        if (i == HELP)
            return -1;
        if (i == SDR) {
            s->sdr = true;
        } else if (i == SEED) {
            if (!argument_number("demo-room", "seed", optarg, 0, 9007199254740991.0, true, &seed))
                return EXIT_USAGE;
            s->seed = (uint64_t)seed;
        } else {
            if (!argument_number("demo-room", number[i].name, optarg, number[i].low, number[i].high,
                             number[i].whole != NULL, &value))
                return EXIT_USAGE;
            if (number[i].whole)
                *number[i].whole = (uint32_t)value;
            else
                *number[i].real = (float)value;
        }
    }
    if (optind != argc - 1) {
        fprintf(stderr, "unbaked demo-room: name one folder to write to; --help says more\n");
        return EXIT_USAGE;
    }
    a->dir = argv[optind];
    return EXIT_SUCCESS;
}

static void show_progress(void *user, uint32_t done, uint32_t total) {
    (void)user;
    if (isatty(STDERR_FILENO))
        fprintf(stderr, "\rphotograph %u of %u%s", done, total, done == total ? "\n" : "");
}

int demo_command(int argc, char **argv) {
    struct arguments a = {demo_default_settings(), 0, NULL};
    struct error err;
    int code = read_arguments(argc, argv, &a);
    if (code == -1) {
        fputs(usage, stdout);
        return EXIT_SUCCESS;
    }
    if (code != EXIT_SUCCESS)
        return code;
    struct parallel *pool = parallel_new((int)a.threads);
    enum status status = demo_generate(a.dir, &a.settings, pool, show_progress, NULL, &err);
    parallel_free(pool);
    if (status != STATUS_OK) {
        fprintf(stderr, "unbaked demo-room: %s\n", err.message);
        return EXIT_FAILURE;
    }
    printf("%s: %u photographs to reconstruct from, %u held out\n", a.dir, a.settings.train_count,
           a.settings.test_count);
    return EXIT_SUCCESS;
}
