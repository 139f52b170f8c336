/* colmap_cameras.c -- see colmap_cameras.h. */
#include "server/ingest/source/colmap_cameras.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/image.h"
#include "common/mem.h"
#include "server/ingest/source/colmap_cursor.h"

#define MAX_PARAMETERS 12 /* of a camera model: FULL_OPENCV and THIN_PRISM_FISHEYE */

/* Parameters of each model, in order: f both focal lengths, F G one each, x y the principal point, 1 to 6 radial, p q
 * tangential, s t thin prism. */
static const struct model {
    const char *name;
    int id;
    enum camera_model kind;
    const char *parameters;
} models[] = {
    {"SIMPLE_PINHOLE", 0, CAMERA_OPENCV, "fxy"},
    {"PINHOLE", 1, CAMERA_OPENCV, "FGxy"},
    {"SIMPLE_RADIAL", 2, CAMERA_OPENCV, "fxy1"},
    {"RADIAL", 3, CAMERA_OPENCV, "fxy12"},
    {"OPENCV", 4, CAMERA_OPENCV, "FGxy12pq"},
    {"OPENCV_FISHEYE", 5, CAMERA_OPENCV_FISHEYE, "FGxy1234"},
    {"FULL_OPENCV", 6, CAMERA_OPENCV, "FGxy12pq3456"},
    {"FOV", 7, CAMERA_FOV, "FGxy1"},
    {"SIMPLE_RADIAL_FISHEYE", 8, CAMERA_OPENCV_FISHEYE, "fxy1"},
    {"RADIAL_FISHEYE", 9, CAMERA_OPENCV_FISHEYE, "fxy12"},
    {"THIN_PRISM_FISHEYE", 10, CAMERA_THIN_PRISM_FISHEYE, "FGxy12pq34st"},
};

struct colmap_camera {
    uint32_t id;
    struct lens lens;
};

struct colmap_cameras {
    size_t count, capacity;
    struct colmap_camera *camera; /* sorted by id; owned */
};

static int by_id(const void *a, const void *b) {
    uint32_t x = ((const struct colmap_camera *)a)->id, y = ((const struct colmap_camera *)b)->id;
    return (x > y) - (x < y);
}

static enum status add_camera(const struct colmap_cursor *r, struct colmap_cameras *c, uint64_t id,
                              const struct model *model, double width, double height, const double *value) {
    struct lens lens = {.model = model->kind, .width = width, .height = height, .angle_x = NAN, .angle_y = NAN};
    if (!(width >= 1.0 && width <= IMAGE_MAX_SIDE && height >= 1.0 && height <= IMAGE_MAX_SIDE) ||
        width != floor(width) || height != floor(height))
        return error_set(r->err, STATUS_INPUT, "%s: camera %llu is %.9g x %.9g pixels, which cannot be", r->name,
                         (unsigned long long)id, width, height);
    for (size_t i = 0; model->parameters[i]; i++) {
        if (!isfinite(value[i]))
            return error_set(r->err, STATUS_INPUT, "%s: camera %llu has a parameter that is not finite", r->name,
                             (unsigned long long)id);
        switch (model->parameters[i]) {
        case 'f': lens.fl_x = lens.fl_y = value[i]; break;
        case 'F': lens.fl_x = value[i]; break;
        case 'G': lens.fl_y = value[i]; break;
        case 'x': lens.cx = value[i]; break;
        case 'y': lens.cy = value[i]; break;
        case 'p': lens.p[0] = value[i]; break;
        case 'q': lens.p[1] = value[i]; break;
        case 's': lens.s[0] = value[i]; break;
        case 't': lens.s[1] = value[i]; break;
        default: lens.k[model->parameters[i] - '1'] = value[i];
        }
    }
    if (c->count == FRAMES_MAX)
        return error_set(r->err, STATUS_INPUT, "%s has more than %d cameras", r->name, FRAMES_MAX);
    if (c->count == c->capacity) {
        c->capacity = c->capacity ? 2 * c->capacity : 16;
        c->camera = mem_realloc_array(c->camera, c->capacity, sizeof *c->camera);
    }
    c->camera[c->count++] = (struct colmap_camera){(uint32_t)id, lens};
    return STATUS_OK;
}

static enum status unknown_model(const struct colmap_cursor *r, const char *model) {
    error_set(r->err, STATUS_INPUT, "%s: unknown camera model %.64s", r->name, model);
    return error_hint(r->err, "colmap image_undistorter makes pinhole photographs of any");
}

static enum status read_cameras_binary(struct colmap_cursor *r, struct colmap_cameras *c) {
    uint64_t count, id, kind, width, height;
    double value[MAX_PARAMETERS];
    if (!colmap_take_whole(r, 8, &count))
        return colmap_cut_off(r);
    for (uint64_t i = 0; i < count; i++) {
        const struct model *model = NULL;
        if (!colmap_take_whole(r, 4, &id) || !colmap_take_whole(r, 4, &kind) || !colmap_take_whole(r, 8, &width) ||
            !colmap_take_whole(r, 8, &height))
            return colmap_cut_off(r);
        for (size_t m = 0; m < sizeof models / sizeof *models; m++)
            if ((uint64_t)models[m].id == kind)
                model = &models[m];
        char number[24];
        snprintf(number, sizeof number, "number %llu", (unsigned long long)kind);
        if (!model)
            return unknown_model(r, number);
        if (!colmap_take_doubles(r, strlen(model->parameters), value))
            return colmap_cut_off(r);
        enum status status = add_camera(r, c, id, model, (double)width, (double)height, value);
        if (status != STATUS_OK)
            return status;
    }
    return STATUS_OK;
}

static enum status read_cameras_text(struct colmap_cursor *r, struct colmap_cameras *c) {
    while (colmap_next_record(r)) {
        const struct model *model = NULL;
        char name[COLMAP_MAX_TOKEN];
        double size[2], value[MAX_PARAMETERS];
        uint64_t id;
        enum status status = colmap_read_id(r, &id);
        if (status == STATUS_OK && !colmap_next_token(r, name))
            status = colmap_line_error(r, "there is no camera model");
        if (status != STATUS_OK)
            return status;
        for (size_t m = 0; m < sizeof models / sizeof *models; m++)
            if (strcmp(models[m].name, name) == 0)
                model = &models[m];
        if (!model)
            return unknown_model(r, name);
        status = colmap_read_doubles(r, 2, size);
        if (status == STATUS_OK)
            status = colmap_read_doubles(r, strlen(model->parameters), value);
        if (status == STATUS_OK)
            status = add_camera(r, c, id, model, size[0], size[1], value);
        if (status != STATUS_OK)
            return status;
    }
    return STATUS_OK;
}

struct colmap_cameras *colmap_cameras_parse(const void *data, size_t size, const char *name, bool binary,
                                            struct error *err) {
    struct colmap_cameras *c = mem_calloc(1, sizeof *c);
    struct colmap_cursor r = {.name = name, .data = data, .size = size, .err = err};
    enum status status = binary ? read_cameras_binary(&r, c) : read_cameras_text(&r, c);
    if (c->count > 1)
        qsort(c->camera, c->count, sizeof *c->camera, by_id);
    for (size_t i = 1; i < c->count && status == STATUS_OK; i++)
        if (c->camera[i].id == c->camera[i - 1].id)
            status = error_set(err, STATUS_INPUT, "%s: there are two cameras %u", name, c->camera[i].id);
    if (status == STATUS_OK)
        return c;
    colmap_cameras_free(c);
    return NULL;
}

void colmap_cameras_free(struct colmap_cameras *c) {
    if (c)
        mem_free(c->camera);
    mem_free(c);
}

const struct lens *colmap_cameras_find(const struct colmap_cameras *c, uint32_t id) {
    const struct colmap_camera key = {.id = id};
    const struct colmap_camera *found = c->count == 0 ? NULL : bsearch(&key, c->camera, c->count, sizeof key, by_id);
    return found ? &found->lens : NULL;
}
