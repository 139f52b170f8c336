/* record3d.c -- Record3D's .r3d (a zip archive) and its export: "metadata" or metadata.json with w, h, K (3 x 3,
 * column-major), poses ([x y z w  tx ty tz] a frame) and perhaps perFrameIntrinsicCoeffs ([fx fy cx cy] a frame);
 * photographs rgb/N.jpg or rgbd/N.jpg. Poses are camera-to-world with OpenGL's camera axes in ARKit's world. */
#include <stdio.h>

#include "common/mem.h"
#include "server/ingest/source/frame_list.h"
#include "server/ingest/source/photo_folder.h"
#include "server/ingest/source/values.h"

static char *recognise(const struct listing *l, const char *base) {
    static const char *const names[] = {"metadata", "metadata.json"};
    bool has_photographs = listing_has_folder(l, base, "rgb") || listing_has_folder(l, base, "rgbd");
    return has_photographs ? listing_find_any(l, base, names, 2) : NULL;
}

/* The lens of a frame: its own, or that of all. */
static struct lens lens_of(const cJSON *tree, const double k[9], const cJSON *own) {
    double c[4] = {k[0], k[4], k[6], k[7]};
    json_numbers(own, 4, c);
    return lens_pinhole(json_member(tree, "w"), json_member(tree, "h"), c[0], c[1], c[2], c[3]);
}

static enum status read_frames(const cJSON *tree, const char *folder, struct frame_list *list, struct error *err) {
    const cJSON *poses = cJSON_GetObjectItemCaseSensitive(tree, "poses"), *pose;
    const cJSON *lenses = cJSON_GetObjectItemCaseSensitive(tree, "perFrameIntrinsicCoeffs");
    const cJSON *own = lenses ? lenses->child : NULL;
    double k[9], q[7], r[3][3], m[3][4];
    enum status status = STATUS_OK;
    size_t number = 0;
    if (!json_numbers(cJSON_GetObjectItemCaseSensitive(tree, "K"), 9, k) || !cJSON_IsArray(poses))
        return error_set(err, STATUS_INPUT, "%s: expected \"K\" of 9 numbers and an array \"poses\"", list->name);
    cJSON_ArrayForEach(pose, poses) {
        char place[32];
        snprintf(place, sizeof place, "poses[%zu]", number);
        if (!json_numbers(pose, 7, q))
            return error_set(err, STATUS_INPUT, "%s: %s must be 7 numbers", list->name, place);
        rotation_from_quaternion(q[3], q[0], q[1], q[2], r);
        for (int i = 0; i < 12; i++)
            m[i / 4][i % 4] = i % 4 < 3 ? r[i / 4][i % 4] : q[4 + i / 4];
        struct lens lens = lens_of(tree, k, own);
        char *file = mem_printf("%s/%zu", folder, number++);
        status = frame_list_add(list, m, &lens, file, place, NULL, err);
        mem_free(file);
        own = own ? own->next : NULL;
        if (status != STATUS_OK)
            return status;
    }
    return STATUS_OK;
}

static enum status read(const struct source_place *place, struct frames *t, struct findings *f, struct error *err) {
    struct frame_list list = frame_list_make(t, place->found, AXES_OPENGL, f);
    struct error own;
    cJSON *tree;
    const char *folder = listing_has_folder(place->listing, place->base, "rgb") ? "rgb" : "rgbd";
    enum status status = json_file_read(place->listing, place->found, &tree, &own);
    if (status == STATUS_OK)
        status = read_frames(tree, folder, &list, &own);
    frame_list_finish(&list);
    photo_folder_resolve(place->listing, place->base, false, t, f);
    cJSON_Delete(tree);
    return findings_settle(f, place->found, status, &own, err);
}

const struct source source_record3d = {"Record3D", recognise, read};
