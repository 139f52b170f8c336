/* demo_command.c -- see demo_command.h. */
#include "server/demo/demo_command.h"

#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "server/demo/generate.h"

const struct command_option demo_flags[] = {
    {"width", 0, OPTION_TEXT, "N", "pixels across a photograph (160)"},
    {"height", 0, OPTION_TEXT, "N", "pixels down (120)"},
    {"frames", 0, OPTION_TEXT, "N", "photographs to reconstruct from (40)"},
    {"test-frames", 0, OPTION_TEXT, "N", "photographs held out (8)"},
    {"spp", 0, OPTION_TEXT, "N", "paths per pixel (48)"},
    {"test-spp", 0, OPTION_TEXT, "N", "paths per pixel of the held-out ones (128)"},
    {"max-depth", 0, OPTION_TEXT, "N", "segments of a path (12)"},
    {"wall-radiance", 0, OPTION_TEXT, "V", "of the emitter on the wall; 0: off (15)"},
    {"ceiling-radiance", 0, OPTION_TEXT, "V", "of the emitter at the ceiling (15)"},
    {"sdr", 0, OPTION_FLAG, NULL, "8-bit photographs, exposures cycling over three values"},
    {"opening", 0, OPTION_FLAG, NULL,
     "the wall emitter is a window: behind it the wall is open, which shows where it is removed"},
    {"flush-lamps", 0, OPTION_FLAG, NULL, "lamps lie in the planes of wall and ceiling, as those of offices"},
    {"texture-size", 0, OPTION_TEXT, "N", "texels a side of the room's own textures (1024)"},
    {"seed", 0, OPTION_TEXT, "N", "of random numbers and viewpoints (1)"},
    {"threads", 0, OPTION_TEXT, "N", "0: one per processor (0)"},
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
        {"width", 8, 8192, .count = &s.width},
        {"height", 8, 8192, .count = &s.height},
        {"frames", 3, 160, .count = &s.train_count},
        {"test-frames", 0, 60, .count = &s.test_count},
        {"spp", 4, 65536, .count = &s.spp},
        {"test-spp", 4, 65536, .count = &s.test_spp},
        {"max-depth", 2, 32, .count = &s.max_depth},
        {"wall-radiance", 0, 1e6, .real = &s.wall_radiance},
        {"ceiling-radiance", 0, 1e6, .real = &s.ceiling_radiance},
        {"texture-size", 128, 8192, .count = &s.texture_size},
        {"seed", 0, 9007199254740991.0, .large = &s.seed}, /* 2^53 - 1: whole in double precision */
        {"threads", 0, 1024, .count = &threads},
    };
    struct options a;
    struct error err;
    int code = arguments_begin(&a, argc, argv, demo_flags, numbers, sizeof numbers / sizeof *numbers, 1);
    if (code >= 0)
        return code;
    if (options_flag(&a, "opening") && options_flag(&a, "flush-lamps")) {
        fprintf(stderr, "unbaked demo-room: --opening and --flush-lamps: only one of them\n");
        options_release(&a);
        return EXIT_USAGE;
    }
    s.sdr = options_flag(&a, "sdr");
    s.lamps = options_flag(&a, "opening")       ? ROOM_LAMPS_OPENING
              : options_flag(&a, "flush-lamps") ? ROOM_LAMPS_FLUSH
                                                : ROOM_LAMPS_FRAMED;
    struct parallel *pool = parallel_new((int)threads);
    const char *dir = a.word[0];
    options_release(&a);
    enum status status = demo_generate(dir, &s, pool, show_progress, NULL, &err);
    parallel_free(pool);
    if (status != STATUS_OK) {
        fprintf(stderr, "unbaked demo-room: %s\n", err.message);
        return EXIT_FAILURE;
    }
    printf("%s: %u photographs to reconstruct from, %u held out\n", dir, s.train_count, s.test_count);
    return EXIT_SUCCESS;
}
