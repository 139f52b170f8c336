/* polycam.c -- Polycam's raw data: keyframes/corrected_cameras/N.json (or cameras/, where no loop was closed) and the
 * photographs of the same name in corrected_images/ (or images/).
 *
 * t_00 .. t_23 is the camera-to-world matrix, row-major, with OpenGL's camera axes in ARKit's world (y up, metres). The
 * exported mesh (raw.glb) is that world turned by alignmentTransform of mesh_info.json, column-major, and so are the
 * poses here. Principal points have pixel centres at .5 as ARKit's. */
#include <stdio.h>
#include <string.h>

#include "common/mem.h"
#include "server/ingest/path.h"
#include "server/ingest/source/frame_list.h"
#include "server/ingest/source/photo_folder.h"
#include "server/ingest/source/values.h"
#include "server/scene/coordinates.h"

static const char *const folders[2][2] = {{"keyframes/corrected_cameras", "keyframes/corrected_images"},
                                          {"keyframes/cameras", "keyframes/images"}};

static char *recognise(const struct listing *l, const char *base) {
    for (int i = 0; i < 2; i++)
        if (listing_has_folder(l, base, folders[i][0]))
            return mem_printf("%s%s", base, folders[i][0]);
    return NULL;
}

/* Reads mesh_info.json, which may be absent; identity then. */
static enum status read_alignment(const struct source_place *place, double m[4][4], struct findings *f,
                                  struct error *err) {
    double column[16];
    cJSON *tree;
    struct error own;
    const struct listed_file *file = listing_find(place->listing, place->base, "mesh_info.json");
    for (int i = 0; i < 16; i++)
        m[i / 4][i % 4] = i % 5 == 0;
    if (!file)
        return STATUS_OK;
    enum status status = json_file_read(place->listing, file->path, &tree, &own);
    if (status == STATUS_OK && json_numbers(cJSON_GetObjectItemCaseSensitive(tree, "alignmentTransform"), 16, column))
        for (int i = 0; i < 16; i++)
            m[i % 4][i / 4] = column[i];
    cJSON_Delete(tree);
    return findings_settle(f, file->path, status, &own, err);
}

/* One frame; its faults are problems. */
static enum status read_frame(const struct source_place *place, const char *path, double alignment[4][4],
                              struct frame_list *list, struct error *err) {
    double stored[3][4], m[3][4];
    cJSON *tree;
    struct error own;
    const char *name = path_base(path);
    enum status status = json_file_read(place->listing, path, &tree, &own);
    for (int i = 0; i < 12; i++) {
        char key[16];
        snprintf(key, sizeof key, "t_%d%d", i / 4, i % 4);
        stored[i / 4][i % 4] = json_member(tree, key);
    }
    coordinates_product((const double(*)[4])alignment, (const double(*)[4])stored, m);
    struct lens lens = lens_pinhole(json_member(tree, "width"), json_member(tree, "height"), json_member(tree, "fx"),
                                    json_member(tree, "fy"), json_member(tree, "cx"), json_member(tree, "cy"));
    char *file = mem_printf("%.*s", (int)(path_extension(name) - name - 1), name);
    status = frame_list_settle(list, path, status, &own, m, &lens, file, "t_00 to t_23", err);
    mem_free(file);
    cJSON_Delete(tree);
    return status;
}

static enum status read(const struct source_place *place, struct frames *t, struct findings *f, struct error *err) {
    struct frame_list list = frame_list_make(t, place->found, AXES_OPENGL, f);
    struct error own;
    double alignment[4][4];
    size_t at = 0;
    const struct listed_file *file;
    char *base = mem_printf("%s/", place->found);
    bool is_corrected = strstr(place->found, "corrected") != NULL;
    char *photographs = mem_printf("%s%s/", place->base, folders[is_corrected ? 0 : 1][1]);
    enum status status = read_alignment(place, alignment, f, &own);
    while (status == STATUS_OK && (file = listing_match(place->listing, base, "*.json", &at)) != NULL)
        status = read_frame(place, file->path, alignment, &list, &own);
    frame_list_finish(&list);
    photo_folder_resolve(place->listing, photographs, false, t, f);
    mem_free(photographs);
    mem_free(base);
    return findings_settle(f, place->found, status, &own, err);
}

const struct source source_polycam = {"Polycam raw data", recognise, read};
