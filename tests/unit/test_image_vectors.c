/* test_image_vectors.c -- pictures from other projects' test suites: PngSuite decodes as
 * ImageMagick decodes it and its corrupt files are refused; no damaged EXR does harm; rendered
 * frames, photographs and environment maps have the means that other programs find. */
#include "common/image.h"

#include <dirent.h>

#include "tests/check.h"

static struct error err;

/* Reads every file of a folder; counts those that decode. */
static void read_folder(const char *name, int *good, int *refused) {
    *good = *refused = 0;
    char folder[1024], path[2048];
    snprintf(folder, sizeof folder, "%s", check_data(name));
    DIR *dir = opendir(folder);
    CHECK(dir != NULL);
    struct dirent *entry;
    while (dir && (entry = readdir(dir)) != NULL) {
        if (entry->d_name[0] == '.')
            continue;
        snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
        struct image image;
        err.message[0] = '\0';
        enum status status = image_read(path, &image, NULL, &err);
        CHECK_THAT(status == STATUS_OK ||
                       ((status == STATUS_INPUT || status == STATUS_LIMIT) && strstr(err.message, entry->d_name)),
                   "%s: %s: %s", entry->d_name, status_name(status), err.message);
        *(status == STATUS_OK ? good : refused) += 1;
        image_release(&image);
    }
    if (dir)
        closedir(dir);
}

static void check_counts(const char *folder, int wanted_good, int wanted_refused) {
    int good, refused;
    read_folder(folder, &good, &refused);
    CHECK_THAT(good == wanted_good && refused == wanted_refused, "%s: %d decode, %d are refused; wanted %d and %d",
               folder, good, refused, wanted_good, wanted_refused);
}

/* The means of the first three channels. */
static void check_means(const char *name, double r, double g, double b) {
    struct image image;
    enum status status = image_read(check_data(name), &image, NULL, &err);
    CHECK_THAT(status == STATUS_OK, "%s", err.message);
    size_t count = (size_t)image.width * image.height;
    const double wanted[3] = {r, g, b};
    for (uint32_t c = 0; status == STATUS_OK && c < 3; c++) {
        double sum = 0;
        for (size_t i = 0; i < count; i++)
            sum += (double)image.pixel[i * image.channel_count + c];
        CHECK_NEAR(sum / (double)count, wanted[c], 1e-6 * wanted[c]);
    }
    image_release(&image);
}

#define PNG_SUITE "vectors/png-suite/tests/pngsuite/"
#define TINY_EXR "vectors/exr-tinyexr/"

int main(void) {
    check_counts(PNG_SUITE "primary", 77, 0);
    check_counts(PNG_SUITE "16bit", 23, 0);
    check_counts(PNG_SUITE "unused", 60, 0);
    check_counts(PNG_SUITE "corrupt", 0, 14);
    check_counts(PNG_SUITE "iphone", 0, 7); /* Apple's own variant, no PNG */
    check_counts("vectors/exr-damaged", 1, 185);
    check_counts(TINY_EXR "test/unit/regression", 7, 12);
    /* ImageMagick without colour management. */
    check_means(PNG_SUITE "16bit/basi6a16.png", 0.4999960064, 0.4999960064, 0.2499960064);
    check_means(PNG_SUITE "16bit/oi9n2c16.png", 0.5, 0.5, 0.1718744039);
    check_means(PNG_SUITE "primary/basi3p04.png", 0.2729166667, 0.7020833333, 0.5375);
    check_means(PNG_SUITE "primary/s39i3p04.png", 0.465658558, 0.4404120096, 0.4209949595);
    check_means(PNG_SUITE "primary/tbbn0g04.png", 0.6733723958, 0.6733723958, 0.6733723958);
    check_means(PNG_SUITE "unused/cs3n3p08.png", 0.40625, 0.75, 0.34375);
    /* OpenEXR's Python module. */
    check_means("rooms/staircase2/images/000.exr", 0.8019295231501261, 0.4764033489425977, 0.20041682459414006);
    check_means(TINY_EXR "asakusa.exr", 0.4543026706075537, 0.44411304473876956, 0.43971586689804537);
    check_means(TINY_EXR "test/unit/regression/000-issue194.exr", 0.08731053244065379, 0.08732513639228046,
                0.08730849056792067);
    check_means(TINY_EXR "test/unit/regression/issue-160-piz-decode.exr", 0.2382904362472616, 0.24185217369596018,
                0.2436735310306566);
    /* Pillow. */
    check_means("redkitchen/images/frame-000056.color.jpg", 0.4885940053, 0.398431781, 0.3923687449);
    /* A decoder of its own in Python. */
    check_means("hdri/autoshop_01_1k.hdr", 0.534574082, 0.5742136127, 0.5368167649);
    check_means("hdri/lythwood_room_1k.hdr", 1.17049401, 0.8760428149, 0.5549853674);
    return check_result();
}
