/* scanner3d.c -- 3D Scanner App's "all data": frame_N.json with cameraPoseARFrame (4 x 4, row-major, camera-to-world
 * with OpenGL's camera axes in ARKit's world) and intrinsics (3 x 3, row-major), beside frame_N.jpg; the mesh of its
 * export (export.obj, textured_output.obj) is in the same world. Not every frame has a photograph. */
#include <math.h>

#include "common/mem.h"
#include "server/ingest/path.h"
#include "server/ingest/source/frame_list.h"
#include "server/ingest/source/photo_folder.h"
#include "server/ingest/source/values.h"

static char *recognise(const struct listing *l, const char *base) {
    const struct listed_file *file = listing_first(l, base, "frame_[0-9]*.json");
    bool has_photographs = file && listing_first(l, base, "frame_[0-9]*.jp*g");
    return has_photographs ? mem_printf("%s", file->path) : NULL;
}

static enum status read_frame(const struct source_place *place, const char *path, struct frame_list *list,
                              struct error *err) {
    double m[4][4], k[9] = {0};
    cJSON *tree;
    struct error own;
    const char *name = path_base(path);
    char *file = mem_printf("%.*s.jpg", (int)(path_extension(name) - name - 1), name);
    enum status status = json_file_read(place->listing, path, &tree, &own);
    if (status == STATUS_OK && (!json_numbers(cJSON_GetObjectItemCaseSensitive(tree, "cameraPoseARFrame"), 16, m[0]) ||
                                !json_numbers(cJSON_GetObjectItemCaseSensitive(tree, "intrinsics"), 9, k)))
        status = error_set(&own, STATUS_INPUT,
                           "%s: expected \"cameraPoseARFrame\" of 16 numbers and \"intrinsics\" of 9", path);
    struct lens lens = lens_pinhole(NAN, NAN, k[0], k[4], k[2], k[5]);
    status = frame_list_settle(list, path, status, &own, m, &lens, file, "cameraPoseARFrame", err);
    mem_free(file);
    cJSON_Delete(tree);
    return status;
}

static enum status read(const struct source_place *place, struct frames *t, struct findings *f, struct error *err) {
    struct frame_list list = frame_list_make(t, place->found, AXES_OPENGL, f);
    struct error own;
    size_t at = 0;
    const struct listed_file *file;
    enum status status = STATUS_OK;
    while (status == STATUS_OK &&
           (file = listing_match(place->listing, place->base, "frame_[0-9]*.json", &at)) != NULL) {
        char *photograph = mem_printf("%.*s.jpg", (int)(path_extension(file->path) - file->path - 1), file->path);
        if (listing_find(place->listing, "", photograph))
            status = read_frame(place, file->path, &list, &own);
        mem_free(photograph);
    }
    frame_list_finish(&list);
    photo_folder_resolve(place->listing, place->base, false, t, f);
    return findings_settle(f, place->found, status, &own, err);
}

const struct source source_scanner3d = {"3D Scanner App", recognise, read};
