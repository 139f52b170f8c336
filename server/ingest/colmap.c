/* colmap.c -- see colmap.h. Counts in a file are checked against its size. */
#include "server/ingest/colmap.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/file.h"
#include "common/mem.h"
#include "server/ingest/colmap_cursor.h"
#include "server/ingest/mapping.h"
#include "server/ingest/path.h"
#include "server/ingest/pose.h"

/* --- images --------------------------------------------------------------------------------- */

struct images {
    const struct colmap_cameras *cameras;
    const char *prefix; /* of names: "images/" or "" */
    struct transforms *t;
    size_t capacity;
    struct findings *findings;
};

/* World-to-camera, q = w x y z and t, to a camera-to-world matrix. */
static void invert(const double q[4], const double t[3], double m[3][4]) {
    double n = 1.0 / sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    double w = q[0] * n, x = q[1] * n, y = q[2] * n, z = q[3] * n;
    const double r[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)},
                            {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)},
                            {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)}};
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++)
            m[i][j] = r[j][i];
        m[i][3] = -(r[0][i] * t[0] + r[1][i] * t[1] + r[2][i] * t[2]);
    }
}

/* A faulty frame is left out with a problem; STATUS_INPUT for too many. */
static enum status add_image(const struct colmap_cursor *r, struct images *in, const double pose[7], uint64_t camera,
                             const char *name) {
    struct transforms *t = in->t;
    struct error own;
    char *clean = NULL, *full = mem_printf("%s%s", in->prefix, name);
    size_t number = t->named_count++;
    const struct lens *lens = colmap_cameras_find(in->cameras, (uint32_t)camera);
    struct transforms_frame frame = {.number = number, .exposure_source = EXPOSURE_UNKNOWN};
    double m[3][4];
    bool scaled;
    invert(pose, pose + 4, m);
    enum status status = STATUS_OK;
    if (number == TRANSFORMS_MAX_FRAMES)
        status = error_set(r->err, STATUS_INPUT, "%s has more than %d images", r->name, TRANSFORMS_MAX_FRAMES);
    else if (path_clean(full, &clean, &own) != STATUS_OK)
        findings_error(in->findings, r->name, &own);
    else if (!lens)
        findings_problem(in->findings, r->name, "image %s: there is no camera %llu", clean, (unsigned long long)camera);
    else if (pose_from_matrix((const double(*)[4])m, "its pose", POSE_RIGHT_DOWN_FORWARD, &frame.world_from_camera,
                              &scaled, &own) != STATUS_OK)
        findings_problem(in->findings, r->name, "image %s: %s", clean, own.message);
    else {
        if (t->frame_count == in->capacity) {
            in->capacity = in->capacity ? 2 * in->capacity : 64;
            t->frame = mem_realloc_array(t->frame, in->capacity, sizeof *t->frame);
        }
        frame.lens = *lens;
        frame.file = clean;
        clean = NULL;
        t->frame[t->frame_count++] = frame;
    }
    mem_free(clean);
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

static int by_file(const void *a, const void *b) {
    const struct transforms_frame *x = a, *y = b;
    int order = strcmp(x->file, y->file);
    return order ? order : (x->number > y->number) - (x->number < y->number);
}

enum status colmap_images_parse(const void *data, size_t size, const char *name, bool binary,
                                const struct colmap_cameras *cameras, const char *prefix, struct transforms *t,
                                struct findings *f, struct error *err) {
    struct colmap_cursor r = {.name = name, .data = data, .size = size, .err = err};
    struct images in = {.cameras = cameras, .prefix = prefix, .t = t, .findings = f};
    *t = (struct transforms){.axes = AXES_OPENCV_INVERSE};
    enum status status = binary ? read_images_binary(&r, &in) : read_images_text(&r, &in);
    if (t->frame_count > 1)
        qsort(t->frame, t->frame_count, sizeof *t->frame, by_file);
    return status;
}

/* --- files ---------------------------------------------------------------------------------- */

char *colmap_find(const char *root) {
    static const char *const folders[] = {"", "sparse/0/", "sparse/", "colmap/sparse/0/", "dense/sparse/"};
    static const char *const kinds[] = {"bin", "txt"};
    for (size_t i = 0; i < sizeof folders / sizeof *folders; i++) {
        for (size_t k = 0; k < 2; k++) {
            char *images = mem_printf("%simages.%s", folders[i], kinds[k]);
            char *cameras = mem_printf("%scameras.%s", folders[i], kinds[k]);
            bool found = file_is_in(root, images) && file_is_in(root, cameras);
            mem_free(cameras);
            if (found)
                return images;
            mem_free(images);
        }
    }
    return NULL;
}

enum status colmap_read(const char *root, const char *images, struct transforms *t, struct findings *f,
                        struct error *err) {
    const char *base = path_base(images);
    bool binary = strcmp(path_extension(images), "bin") == 0;
    char *cameras = mem_printf("%.*scameras.%s", (int)(base - images), images, binary ? "bin" : "txt");
    char *path = file_join(root, cameras);
    const char *prefix = file_is_in(root, "images") ? "images/" : "";
    struct colmap_cameras *found = NULL;
    struct mapping file;
    struct error own = {0};
    *t = (struct transforms){.axes = AXES_OPENCV_INVERSE};
    enum status status = mapping_open(&file, path, cameras, "a file of cameras", &own);
    if (status == STATUS_OK) {
        found = colmap_cameras_parse(file.data, file.size, cameras, binary, &own);
        status = found ? STATUS_OK : own.status;
    }
    mapping_close(&file);
    mem_free(path);
    enum status result = findings_settle(f, cameras, status, &own, err);
    if (found) {
        path = file_join(root, images);
        status = mapping_open(&file, path, images, "a file of images", &own);
        if (status == STATUS_OK)
            status = colmap_images_parse(file.data, file.size, images, binary, found, prefix, t, f, &own);
        mapping_close(&file);
        mem_free(path);
        result = findings_settle(f, images, status, &own, err);
    }
    colmap_cameras_free(found);
    mem_free(cameras);
    return result;
}
