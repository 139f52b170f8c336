/* scannet.c -- ScanNet as its SensReader exports it: pose/N.txt, a camera-to-world matrix each, row-major, COLMAP's
 * axes; intrinsic/intrinsic_color.txt; photographs color/N.jpg. Pixel centres are at integers. Poses that are not
 * finite (tracking lost) are left out. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/mem.h"
#include "server/ingest/path.h"
#include "server/ingest/source/frame_list.h"
#include "server/ingest/source/photo_folder.h"
#include "server/ingest/source/values.h"

#define POSES "pose"
#define INTRINSIC "intrinsic/intrinsic_color.txt"

static char *recognise(const struct listing *l, const char *base) {
    bool is_one = listing_has_folder(l, base, POSES) && listing_find(l, base, INTRINSIC);
    return is_one ? mem_printf("%s" POSES, base) : NULL;
}

static int by_value(const void *a, const void *b) {
    long x = *(const long *)a, y = *(const long *)b;
    return (x > y) - (x < y);
}

/* Numbers N of the files N.txt in the folder, without leading zeros as ScanNet writes them; ascending, the caller's. */
static size_t list_poses(const struct source_place *place, long **number) {
    size_t at = 0, count = 0;
    const struct listed_file *file;
    *number = mem_array(listing_match_count(place->listing, place->base, POSES "/*.txt") + 1, sizeof **number);
    while ((file = listing_match(place->listing, place->base, POSES "/*.txt", &at)) != NULL) {
        char name[32];
        const char *base = path_base(file->path);
        long value = strtol(base, NULL, 10);
        snprintf(name, sizeof name, "%ld.txt", value);
        if (value >= 0 && strcmp(base, name) == 0)
            (*number)[count++] = value;
    }
    if (count > 1)
        qsort(*number, count, sizeof **number, by_value);
    return count;
}

/* A faulty pose is a problem of its own. */
static enum status read_pose(const struct source_place *place, long number, const struct lens *lens,
                             struct frame_list *list, struct error *err) {
    double m[4][4];
    struct error own;
    char *name = mem_printf("%s/%ld.txt", place->found, number), *file = mem_printf("color/%ld", number);
    enum status status = numbers_read(place->listing, name, 16, "a matrix", m[0], &own);
    status = frame_list_settle(list, name, status, &own, m, lens, file, "the matrix", err);
    mem_free(file);
    mem_free(name);
    return status;
}

static enum status read(const struct source_place *place, struct frames *t, struct findings *f, struct error *err) {
    double k[4][4];
    struct error own;
    long *number;
    struct frame_list list = frame_list_make(t, place->found, AXES_OPENCV, f);
    list.may_be_lost = true;
    char *intrinsic = mem_printf("%s" INTRINSIC, place->base);
    enum status status = numbers_read(place->listing, intrinsic, 16, "a matrix", k[0], &own);
    mem_free(intrinsic);
    if (status != STATUS_OK)
        return findings_settle(f, place->found, status, &own, err);
    struct lens lens =
        lens_pinhole(NAN, NAN, k[0][0], k[1][1], k[0][2] + LENS_PIXEL_CENTRE, k[1][2] + LENS_PIXEL_CENTRE);
    size_t count = list_poses(place, &number);
    for (size_t i = 0; i < count && status == STATUS_OK; i++)
        status = read_pose(place, number[i], &lens, &list, &own);
    frame_list_finish(&list);
    mem_free(number);
    photo_folder_resolve(place->listing, place->base, false, t, f);
    return findings_settle(f, place->found, status, &own, err);
}

const struct source source_scannet = {"ScanNet", recognise, read};
