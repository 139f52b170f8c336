/* demo_command.c -- see demo_command.h. */
#include "server/demo/demo_command.h"

#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "server/demo/generate.h"

const struct flag demo_flags[] = {
    {"--width", "N", "pixels across a photograph (160)"},
    {"--height", "N", "pixels down (120)"},
    {"--frames", "N", "photographs to reconstruct from (40)"},
    {"--test-frames", "N", "photographs held out (8)"},
    {"--spp", "N", "paths per pixel (48)"},
    {"--test-spp", "N", "paths per pixel of the held-out ones (128)"},
    {"--max-depth", "N", "segments of a path (12)"},
    {"--wall-radiance", "V", "of the emitter on the wall; 0: off (15)"},
    {"--ceiling-radiance", "V", "of the emitter at the ceiling (15)"},
    {"--sdr", NULL, "8-bit photographs, exposures cycling over three values"},
    {"--opening", NULL, "the wall emitter is a window: behind it the wall is open, which shows where it is removed"},
    {"--flush-lamps", NULL, "lamps lie in the planes of wall and ceiling, as those of offices"},
    {"--texture-size", "N", "texels a side of the room's own textures (1024)"},
    {"--seed", "N", "of random numbers and viewpoints (1)"},
    {"--threads", "N", "0: one per processor (0)"},
    COMMAND_HELP_FLAG,
    {0},
};

static void show_progress(void *user, uint32_t done, uint32_t total) {
    (void)user;
    if (isatty(STDERR_FILENO))
        fprintf(stderr, "\rphotograph %u of %u%s", done, total, done == total ? "\n" : "");
}

int demo_command(int argc, char **argv) {
    struct demo_settings s = demo_default_settings();
    uint32_t threads = 0;
    const struct number_flag numbers[] = {
        {"--width", 8, 8192, .count = &s.width},
        {"--height", 8, 8192, .count = &s.height},
        {"--frames", 3, 160, .count = &s.train_count},
        {"--test-frames", 0, 60, .count = &s.test_count},
        {"--spp", 4, 65536, .count = &s.spp},
        {"--test-spp", 4, 65536, .count = &s.test_spp},
        {"--max-depth", 2, 32, .count = &s.max_depth},
        {"--wall-radiance", 0, 1e6, .real = &s.wall_radiance},
        {"--ceiling-radiance", 0, 1e6, .real = &s.ceiling_radiance},
        {"--texture-size", 128, 8192, .count = &s.texture_size},
        {"--seed", 0, 9007199254740991.0, .large = &s.seed}, /* 2^53 - 1: whole in double precision */
        {"--threads", 0, 1024, .count = &threads},
    };
    struct arguments a;
    struct error err;
    int code = arguments_begin(&a, argc, argv, demo_flags, numbers, sizeof numbers / sizeof *numbers, 1);
    if (code >= 0)
        return code;
    if (arguments_have(&a, "--opening") && arguments_have(&a, "--flush-lamps")) {
        fprintf(stderr, "unbaked demo-room: --opening and --flush-lamps: only one of them\n");
        return EXIT_USAGE;
    }
    s.sdr = arguments_have(&a, "--sdr");
    s.lamps = arguments_have(&a, "--opening")       ? ROOM_LAMPS_OPENING
              : arguments_have(&a, "--flush-lamps") ? ROOM_LAMPS_FLUSH
                                                    : ROOM_LAMPS_FRAMED;
    struct parallel *pool = parallel_new((int)threads);
    enum status status = demo_generate(a.words[0], &s, pool, show_progress, NULL, &err);
    parallel_free(pool);
    if (status != STATUS_OK) {
        fprintf(stderr, "unbaked demo-room: %s\n", err.message);
        return EXIT_FAILURE;
    }
    printf("%s: %u photographs to reconstruct from, %u held out\n", a.words[0], s.train_count, s.test_count);
    return EXIT_SUCCESS;
}
