/* colmap.c -- a COLMAP reconstruction (colmap.github.io/format.html), .bin or .txt; .bin is preferred, as in COLMAP.
 *
 * Its poses are world-to-camera, with our axes. Its unit of length is arbitrary and must be that of the mesh, which
 * comes from the same reconstruction. Photographs are sorted by name. Of several models the one with most photographs
 * is read. Counts in a file are checked against its size. */
#include <stdlib.h>
#include <string.h>

#include "common/mem.h"
#include "server/ingest/path.h"
#include "server/ingest/source/colmap_cursor.h"
#include "server/ingest/source/colmap_images.h"
#include "server/ingest/source/frame_list.h"
#include "server/ingest/source/photo_folder.h"

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

/* Whether the present line is one of an image: nine fields, the ninth of which begins no number; the line of its points
 * has three numbers a point. `at` stays. */
static bool is_image_line(const struct colmap_cursor *r) {
    struct colmap_cursor own = *r;
    char token[COLMAP_MAX_TOKEN], *end;
    for (int i = 0; i < 10; i++) {
        if (!colmap_next_token(&own, token))
            return false;
        strtod(token, &end);
        if (i == 9)
            return *end != '\0';
        if (*end != '\0')
            return false;
    }
    return false;
}

/* Two lines per image, the second of which may be empty. People who write one by hand leave it out: a second line that
 * is an image's is taken for one. */
static enum status read_images_text(struct colmap_cursor *r, struct images *in) {
    bool has_line = colmap_next_record(r);
    while (has_line) {
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
        has_line = colmap_next_line(r);
        if (has_line && !is_image_line(r))
            has_line = colmap_next_record(r);
    }
    return STATUS_OK;
}

enum status colmap_images_parse(const void *data, size_t size, const char *name, bool binary,
                                const struct colmap_cameras *cameras, const char *prefix, struct frames *t,
                                struct findings *f, struct error *err) {
    struct colmap_cursor r = {.name = name, .data = data, .size = size, .err = err};
    struct images in = {.cameras = cameras, .prefix = prefix};
    in.list = frame_list_make(t, name, AXES_OPENCV_INVERSE, f);
    enum status status = binary ? read_images_binary(&r, &in) : read_images_text(&r, &in);
    frame_list_finish(&in.list);
    frame_list_sort(t);
    return status;
}

/* --- models ----------------------------------------------------------------------------------- */

/* Where models lie below a workspace: at its top, as COLMAP's commands and as scripts around them write them; a model
 * that was undistorted last, since the one before is as good and has the photographs' own pixels. */
static const char *const patterns[] = {"images.bin",
                                       "images.txt",
                                       "sparse/[0-9]*/images.bin",
                                       "sparse/[0-9]*/images.txt",
                                       "sparse/images.bin",
                                       "sparse/images.txt",
                                       "colmap/sparse/[0-9]*/images.bin",
                                       "colmap/sparse/[0-9]*/images.txt",
                                       "dense/[0-9]*/sparse/images.bin",
                                       "dense/[0-9]*/sparse/images.txt",
                                       "dense/sparse/images.bin",
                                       "dense/sparse/images.txt"};

/* The cameras file that belongs to an images file, the caller's. */
static char *cameras_of(const char *images) {
    return mem_printf("%.*scameras.%s", (int)(path_base(images) - images), images, path_extension(images));
}

/* The next model from (*pattern, *at) on, which move on: its images file. */
static const struct listed_file *next_model(const struct listing *l, const char *base, size_t *pattern, size_t *at) {
    for (; *pattern < sizeof patterns / sizeof *patterns; (*pattern)++, *at = 0) {
        const struct listed_file *file;
        while ((file = listing_match(l, base, patterns[*pattern], at)) != NULL) {
            char *cameras = cameras_of(file->path);
            bool is_model = listing_find(l, "", cameras) != NULL;
            mem_free(cameras);
            if (is_model)
                return file;
        }
    }
    return NULL;
}

static char *recognise(const struct listing *l, const char *base) {
    size_t pattern = 0, at = 0;
    const struct listed_file *file = next_model(l, base, &pattern, &at);
    return file ? mem_strdup(file->path) : NULL;
}

/* The folder from which a model's photographs are looked for: that of dense/0 for dense/0/sparse/. */
static char *workspace_of(const char *images, const char *base) {
    char *folder = mem_strndup(images, (size_t)(path_base(images) - images));
    char *dense = strstr(folder + strlen(base), "dense/"), *sparse = dense ? strstr(dense, "sparse/") : NULL;
    if (sparse)
        *sparse = '\0';
    char *own = mem_strdup(sparse ? folder : base);
    mem_free(folder);
    return own;
}

/* Reads one model; *found_count: how many of its photographs are there. */
static enum status read_model(const struct source_place *place, const char *images, struct frames *t,
                              size_t *found_count, struct findings *f, struct error *err) {
    const struct listing *l = place->listing;
    bool binary = strcmp(path_extension(images), "bin") == 0;
    char *cameras = cameras_of(images), *workspace = workspace_of(images, place->base);
    struct colmap_cameras *found = NULL;
    struct mapping file;
    struct error own = {0};
    *t = (struct frames){.axes = AXES_OPENCV_INVERSE};
    *found_count = 0;
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
            status = colmap_images_parse(file.data, file.size, images, binary, found, "", t, f, &own);
        mapping_close(&file);
        result = findings_settle(f, images, status, &own, err);
        *found_count = photo_folder_resolve(l, workspace, true, t, f);
    }
    colmap_cameras_free(found);
    mem_free(workspace);
    mem_free(cameras);
    return result;
}

/* The model of which most photographs are there: COLMAP writes one for each part that does not hang together. */
static enum status choose_model(const struct source_place *place, char **chosen, struct findings *f,
                                struct error *err) {
    size_t pattern = 0, at = 0, best = 0, model_count = 0;
    const struct listed_file *file;
    enum status status = STATUS_OK;
    *chosen = mem_strdup(place->found);
    while (status == STATUS_OK && (file = next_model(place->listing, place->base, &pattern, &at)) != NULL) {
        struct findings own = {.problems = cJSON_CreateArray()};
        struct frames t;
        size_t count;
        status = read_model(place, file->path, &t, &count, &own, err);
        model_count++;
        if (count > best) {
            best = count;
            mem_free(*chosen);
            *chosen = mem_strdup(file->path);
        }
        frames_release(&t);
        cJSON_Delete(own.problems);
        findings_release(&own);
    }
    if (model_count > 1)
        findings_warning(f, "there are %zu models of COLMAP: %s is taken, with most photographs (%zu)", model_count,
                         *chosen, best);
    return status;
}

static enum status read(const struct source_place *place, struct frames *t, struct findings *f, struct error *err) {
    size_t pattern = 0, at = 0, count;
    char *chosen = NULL;
    enum status status = STATUS_OK;
    *t = (struct frames){.axes = AXES_OPENCV_INVERSE};
    next_model(place->listing, place->base, &pattern, &at);
    if (next_model(place->listing, place->base, &pattern, &at))
        status = choose_model(place, &chosen, f, err);
    if (status == STATUS_OK)
        status = read_model(place, chosen ? chosen : place->found, t, &count, f, err);
    mem_free(chosen);
    return status;
}

const struct source source_colmap = {"COLMAP", recognise, read};
