/* sevenscenes.c -- Microsoft's 7-Scenes: seq-NN/frame-NNNNNN.color.png and .pose.txt, a camera-to-world matrix,
 * row-major, with our camera axes. The lens is in none of the files. The data set's page gives 585 pixels and 320, 240
 * for the depth camera of 640 x 480; colour is not registered to it, and works that use it take 525 (Brachmann & Rother
 * 2017), the nominal one of the camera. */
#include <string.h>

#include "common/mem.h"
#include "server/ingest/source/frame_list.h"
#include "server/ingest/source/photo_folder.h"
#include "server/ingest/source/values.h"

#define POSE_END ".pose.txt"

static const char *const patterns[] = {"frame-[0-9]*" POSE_END, "seq-[0-9]*/frame-[0-9]*" POSE_END};

static char *recognise(const struct listing *l, const char *base) {
    for (int i = 0; i < 2; i++) {
        const struct listed_file *file = listing_first(l, base, patterns[i]);
        if (file)
            return mem_strdup(file->path);
    }
    return NULL;
}

static enum status read_pose(const struct source_place *place, const char *path, const struct lens *lens,
                             struct frame_list *list, struct error *err) {
    double m[4][4];
    struct error own;
    const char *inner = path + strlen(place->base);
    char *file = mem_printf("%.*s.color.png", (int)(strlen(inner) - strlen(POSE_END)), inner);
    enum status status = numbers_read(place->listing, path, 16, "a matrix", m[0], &own);
    status = frame_list_settle(list, path, status, &own, m, lens, file, "the matrix", err);
    mem_free(file);
    return status;
}

static enum status read(const struct source_place *place, struct frames *t, struct findings *f, struct error *err) {
    struct lens lens = lens_pinhole(640, 480, 525, 525, 320, 240);
    struct frame_list list = frame_list_make(t, place->found, AXES_OPENCV, f);
    struct error own;
    enum status status = STATUS_OK;
    list.may_be_lost = true;
    for (int i = 0; i < 2; i++) {
        const struct listed_file *file;
        for (size_t at = 0;
             status == STATUS_OK && (file = listing_match(place->listing, place->base, patterns[i], &at)) != NULL;)
            status = read_pose(place, file->path, &lens, &list, &own);
    }
    frame_list_finish(&list);
    findings_warning(f,
                     "7-Scenes states no lens of its colour camera: a focal length of 525 pixels is taken, the nominal "
                     "one; a transforms.json beside the sequences says another");
    photo_folder_resolve(place->listing, place->base, false, t, f);
    return findings_settle(f, place->found, status, &own, err);
}

const struct source source_sevenscenes = {"7-Scenes", recognise, read};
