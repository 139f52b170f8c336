/* colmap.c -- a COLMAP reconstruction (colmap.github.io/format.html), .bin or .txt; .bin is preferred, as in COLMAP.
 *
 * Its poses are world-to-camera, with our axes. Its unit of length is arbitrary and must be that of the mesh, which
 * comes from the same reconstruction. Photographs are sorted by name; names are relative to images/ if that folder
 * exists. Counts in a file are checked against its size. */
#include <string.h>

#include "common/mem.h"
#include "server/ingest/path.h"
#include "server/ingest/source/colmap_cursor.h"
#include "server/ingest/source/colmap_images.h"
#include "server/ingest/source/frame_list.h"

/* --- images --------------------------------------------------------------------------------- */

struct images {
    const struct colmap_cameras *cameras;
    const char *prefix; /* of names: "images/" or "" */
    struct frame_list list;
};

/* A faulty frame is left out with a problem; STATUS_INPUT for too many. */
static enum status add_image(const struct colmap_cursor *r, struct images *in, const double pose[7], uint64_t camera,
                             const char *name) {
    const struct lens *lens = colmap_cameras_find(in->cameras, (uint32_t)camera);
    double rotation[3][3], m[3][4];
    char *full = mem_printf("%s%s", in->prefix, name), *place = mem_printf("image %s", full);
    enum status status = STATUS_OK;
    rotation_from_quaternion(pose[0], pose[1], pose[2], pose[3], rotation);
    pose_invert(rotation, pose + 4, m);
    if (lens) {
        status = frame_list_add(&in->list, m, lens, full, place, NULL, r->err);
    } else {
        in->list.t->named_count++;
        findings_problem(in->list.findings, r->name, "%s: there is no camera %llu", place, (unsigned long long)camera);
    }
    mem_free(place);
    mem_free(full);
    return status;
}

static enum status read_images_binary(struct colmap_cursor *r, struct images *in) {
    uint64_t count, id, camera, points;
    double pose[7];
    if (!colmap_take_whole(r, 8, &count))
        return colmap_cut_off(r);
    for (uint64_t i = 0; i < count; i++) {
        if (!colmap_take_whole(r, 4, &id) || !colmap_take_doubles(r, 7, pose) || !colmap_take_whole(r, 4, &camera))
            return colmap_cut_off(r);
        const char *name = (const char *)r->data + r->at;
        const char *end = memchr(name, '\0', r->size - r->at);
        if (!end)
            return colmap_cut_off(r);
        r->at += (size_t)(end - name) + 1;
        if (!colmap_take_whole(r, 8, &points) || points > (r->size - r->at) / 24)
            return colmap_cut_off(r);
        r->at += (size_t)points * 24; /* x, y, point id */
        enum status status = add_image(r, in, pose, camera, name);
        if (status != STATUS_OK)
            return status;
    }
    return STATUS_OK;
}

/* Two lines per image, the second of which may be empty. */
static enum status read_images_text(struct colmap_cursor *r, struct images *in) {
    while (colmap_next_record(r)) {
        double pose[7];
        uint64_t id, camera;
        enum status status = colmap_read_id(r, &id);
        if (status == STATUS_OK)
            status = colmap_read_doubles(r, 7, pose);
        if (status == STATUS_OK)
            status = colmap_read_id(r, &camera);
        if (status != STATUS_OK)
            return status;
        size_t from = r->at, to = r->line_end;
        while (from < to && strchr(" \t", r->data[from]))
            from++;
        while (to > from && strchr(" \t\r", r->data[to - 1]))
            to--;
        if (from == to || memchr(r->data + from, '\0', to - from))
            return colmap_line_error(r, "there is no name of a photograph");
        char *name = mem_strndup((const char *)r->data + from, to - from);
        status = add_image(r, in, pose, camera, name);
        mem_free(name);
        if (status != STATUS_OK)
            return status;
        colmap_next_line(r);
    }
    return STATUS_OK;
}

enum status colmap_images_parse(const void *data, size_t size, const char *name, bool binary,
                                const struct colmap_cameras *cameras, const char *prefix, struct transforms *t,
                                struct findings *f, struct error *err) {
    struct colmap_cursor r = {.name = name, .data = data, .size = size, .err = err};
    struct images in = {.cameras = cameras, .prefix = prefix};
    in.list = frame_list_make(t, name, AXES_OPENCV_INVERSE, f);
    enum status status = binary ? read_images_binary(&r, &in) : read_images_text(&r, &in);
    frame_list_finish(&in.list);
    frame_list_sort(t);
    return status;
}

/* --- files ---------------------------------------------------------------------------------- */

static char *recognise(const struct listing *l, const char *base) {
    static const char *const folders[] = {"", "sparse/0/", "sparse/", "colmap/sparse/0/", "dense/sparse/"};
    static const char *const kinds[] = {"bin", "txt"};
    for (size_t i = 0; i < sizeof folders / sizeof *folders; i++) {
        for (size_t k = 0; k < 2; k++) {
            char *images = mem_printf("%simages.%s", folders[i], kinds[k]);
            char *cameras = mem_printf("%scameras.%s", folders[i], kinds[k]);
            const struct listed_file *file = listing_find(l, base, images);
            bool found = file && listing_find(l, base, cameras);
            mem_free(cameras);
            mem_free(images);
            if (found)
                return mem_strdup(file->path);
        }
    }
    return NULL;
}

static enum status read(const struct source_place *place, struct transforms *t, struct findings *f, struct error *err) {
    const char *images = place->found, *base = path_base(images);
    const struct listing *l = place->listing;
    bool binary = strcmp(path_extension(images), "bin") == 0;
    char *cameras = mem_printf("%.*scameras.%s", (int)(base - images), images, binary ? "bin" : "txt");
    char *prefix = mem_printf("%s%s", place->base, listing_has_folder(l, place->base, "images") ? "images/" : "");
    struct colmap_cameras *found = NULL;
    struct mapping file;
    struct error own = {0};
    *t = (struct transforms){.axes = AXES_OPENCV_INVERSE};
    enum status status = listing_open(l, cameras, "a file of cameras", &file, &own);
    if (status == STATUS_OK) {
        found = colmap_cameras_parse(file.data, file.size, cameras, binary, &own);
        status = found ? STATUS_OK : own.status;
    }
    mapping_close(&file);
    enum status result = findings_settle(f, cameras, status, &own, err);
    if (found) {
        status = listing_open(l, images, "a file of images", &file, &own);
        if (status == STATUS_OK)
            status = colmap_images_parse(file.data, file.size, images, binary, found, prefix, t, f, &own);
        mapping_close(&file);
        result = findings_settle(f, images, status, &own, err);
    }
    colmap_cameras_free(found);
    mem_free(prefix);
    mem_free(cameras);
    return result;
}

const struct source source_colmap = {"COLMAP", recognise, read};
