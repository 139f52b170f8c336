/* matterport.c -- Matterport3D (github.com/niessner/Matterport, data_organization.md), a house's folder.
 *
 * matterport_camera_poses/PANO_pose_C_Y.txt: camera-to-world, 4 x 4, row-major, with our camera axes;
 * matterport_camera_intrinsics/PANO_intrinsics_C.txt: w h fx fy cx cy k1 k2 p1 p2 k3 in OpenCV's notation; photographs
 * matterport_color_images/PANO_iC_Y.jpg. */
#include <string.h>

#include "common/mem.h"
#include "server/ingest/path.h"
#include "server/ingest/source/frame_list.h"
#include "server/ingest/source/photo_folder.h"
#include "server/ingest/source/values.h"

#define POSES "matterport_camera_poses"

static char *recognise(const struct listing *l, const char *base) {
    bool is_one =
        listing_first(l, base, POSES "/*_pose_*.txt") && listing_has_folder(l, base, "matterport_camera_intrinsics");
    return is_one ? mem_printf("%s" POSES, base) : NULL;
}

static enum status read_lens(const struct source_place *place, const char *pano, char camera, struct lens *lens,
                             struct error *err) {
    double v[11];
    char *path = mem_printf("%smatterport_camera_intrinsics/%s_intrinsics_%c.txt", place->base, pano, camera);
    enum status status = numbers_read(place->listing, path, 11, "a lens (w h fx fy cx cy k1 k2 p1 p2 k3)", v, err);
    mem_free(path);
    if (status != STATUS_OK)
        return status;
    *lens = lens_pinhole(v[0], v[1], v[2], v[3], v[4], v[5]);
    memcpy(lens->k, v + 6, 2 * sizeof *v);
    memcpy(lens->p, v + 8, 2 * sizeof *v);
    lens->k[2] = v[10];
    return STATUS_OK;
}

/* One pose; its faults are problems. Names that are not of the form are passed over. */
static enum status read_pose(const struct source_place *place, const char *path, struct frame_list *list,
                             struct error *err) {
    double m[4][4];
    struct lens lens;
    struct error own;
    const char *name = path_base(path), *mark = strstr(name, "_pose_");
    if (!mark || strlen(mark) != strlen("_pose_C_Y.txt"))
        return STATUS_OK;
    char *pano = mem_strndup(name, (size_t)(mark - name)), camera = mark[6], yaw = mark[8];
    char *file = mem_printf("matterport_color_images/%s_i%c_%c.jpg", pano, camera, yaw);
    enum status status = numbers_read(place->listing, path, 16, "a matrix", m[0], &own);
    if (status == STATUS_OK)
        status = read_lens(place, pano, camera, &lens, &own);
    status = frame_list_settle(list, path, status, &own, m, &lens, file, "the matrix", err);
    mem_free(file);
    mem_free(pano);
    return status;
}

static enum status read(const struct source_place *place, struct frames *t, struct findings *f, struct error *err) {
    struct frame_list list = frame_list_make(t, place->found, AXES_OPENCV, f);
    struct error own;
    const struct listed_file *file;
    enum status status = STATUS_OK;
    for (size_t at = 0;
         status == STATUS_OK && (file = listing_match(place->listing, place->base, POSES "/*.txt", &at)) != NULL;)
        status = read_pose(place, file->path, &list, &own);
    photo_folder_resolve(place->listing, place->base, false, t, f);
    return findings_settle(f, place->found, status, &own, err);
}

const struct source source_matterport = {"Matterport3D", recognise, read};
