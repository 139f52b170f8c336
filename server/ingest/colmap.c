/* colmap.c -- see colmap.h. Counts that a file promises are held against the bytes that are there. */
#include "server/ingest/colmap.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/file.h"
#include "common/image.h"
#include "common/mem.h"
#include "server/ingest/mapping.h"
#include "server/ingest/path.h"
#include "server/ingest/pose.h"

#define MAX_PARAMETERS 12
#define MAX_TOKEN 256

/* What a model's parameters are, in order: f both focal lengths, F G each, x y the principal point,
 * 1 to 6 radial, p q tangential. */
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
    {"SIMPLE_RADIAL_FISHEYE", 8, CAMERA_OPENCV_FISHEYE, "fxy1"},
    {"RADIAL_FISHEYE", 9, CAMERA_OPENCV_FISHEYE, "fxy12"},
};

struct colmap_camera {
    uint32_t id;
    struct lens lens;
};

struct colmap_cameras {
    size_t count, capacity;
    struct colmap_camera *camera; /* sorted by id; owned */
};

/* One file: a cursor over its bytes, or its lines. */
struct reader {
    const char *name;
    const uint8_t *data;
    size_t size, at, line_end, line;
    struct error *err;
};

/* --- bytes ---------------------------------------------------------------------------------- */

static bool take(struct reader *r, void *to, size_t length) {
    if (r->size - r->at < length)
        return false;
    memcpy(to, r->data + r->at, length);
    r->at += length;
    return true;
}

/* COLMAP's files are little-endian. */
static bool take_whole(struct reader *r, size_t bytes, uint64_t *value) {
    uint8_t raw[8];
    *value = 0;
    if (!take(r, raw, bytes))
        return false;
    for (size_t i = bytes; i-- > 0;)
        *value = *value << 8 | raw[i];
    return true;
}

static bool take_doubles(struct reader *r, size_t count, double *value) {
    for (size_t i = 0; i < count; i++) {
        uint64_t bits;
        if (!take_whole(r, 8, &bits))
            return false;
        memcpy(&value[i], &bits, sizeof bits);
    }
    return true;
}

static enum status cut_off(const struct reader *r) {
    return error_set(r->err, STATUS_INPUT, "%s is cut off at byte %zu", r->name, r->at);
}

/* --- lines ---------------------------------------------------------------------------------- */

static bool next_line(struct reader *r) {
    size_t from = r->line == 0 ? 0 : r->line_end + 1;
    if (from >= r->size)
        return false;
    const uint8_t *newline = memchr(r->data + from, '\n', r->size - from);
    r->at = from;
    r->line_end = newline ? (size_t)(newline - r->data) : r->size;
    r->line++;
    return true;
}

/* The next line that is neither empty nor a comment. */
static bool next_record(struct reader *r) {
    while (next_line(r)) {
        while (r->at < r->line_end && strchr(" \t\r", r->data[r->at]))
            r->at++;
        if (r->at < r->line_end && r->data[r->at] != '#')
            return true;
    }
    return false;
}

static bool next_token(struct reader *r, char token[MAX_TOKEN]) {
    size_t length = 0;
    while (r->at < r->line_end && strchr(" \t\r", r->data[r->at]))
        r->at++;
    for (; r->at < r->line_end && !strchr(" \t\r", r->data[r->at]); r->at++)
        if (length + 1 < MAX_TOKEN)
            token[length++] = (char)r->data[r->at];
    token[length] = '\0';
    return length > 0;
}

static enum status line_error(const struct reader *r, const char *what) {
    return error_set(r->err, STATUS_INPUT, "%s, line %zu: %s", r->name, r->line, what);
}

static enum status read_doubles(struct reader *r, size_t count, double *value) {
    char token[MAX_TOKEN], *end;
    for (size_t i = 0; i < count; i++) {
        if (!next_token(r, token))
            return line_error(r, "there are fewer values than there must be");
        value[i] = strtod(token, &end);
        if (*end != '\0')
            return line_error(r, "there is a value that is not a number");
    }
    return STATUS_OK;
}

static enum status read_id(struct reader *r, uint64_t *id) {
    double value;
    enum status status = read_doubles(r, 1, &value);
    if (status == STATUS_OK && (!(value >= 0.0 && value < UINT32_MAX) || value != floor(value)))
        status = line_error(r, "there is a number that is no id");
    *id = status == STATUS_OK ? (uint64_t)value : 0;
    return status;
}

/* --- cameras -------------------------------------------------------------------------------- */

static int by_id(const void *a, const void *b) {
    uint32_t x = ((const struct colmap_camera *)a)->id, y = ((const struct colmap_camera *)b)->id;
    return (x > y) - (x < y);
}

static enum status add_camera(const struct reader *r, struct colmap_cameras *c, uint64_t id,
                              const struct model *model, double width, double height, const double *value) {
    struct lens lens = {.model = model->kind, .width = width, .height = height, .angle_x = NAN,
                        .angle_y = NAN};
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
        default: lens.k[model->parameters[i] - '1'] = value[i];
        }
    }
    if (c->count == TRANSFORMS_MAX_FRAMES)
        return error_set(r->err, STATUS_INPUT, "%s has more than %d cameras", r->name, TRANSFORMS_MAX_FRAMES);
    if (c->count == c->capacity) {
        c->capacity = c->capacity ? 2 * c->capacity : 16;
        c->camera = mem_realloc_array(c->camera, c->capacity, sizeof *c->camera);
    }
    c->camera[c->count++] = (struct colmap_camera){(uint32_t)id, lens};
    return STATUS_OK;
}

static enum status unknown_model(const struct reader *r, const char *model) {
    error_set(r->err, STATUS_INPUT, "%s: unknown camera model %.64s", r->name, model);
    return error_hint(r->err, "colmap image_undistorter makes pinhole photographs of any");
}

static enum status read_cameras_binary(struct reader *r, struct colmap_cameras *c) {
    uint64_t count, id, kind, width, height;
    double value[MAX_PARAMETERS];
    if (!take_whole(r, 8, &count))
        return cut_off(r);
    for (uint64_t i = 0; i < count; i++) {
        const struct model *model = NULL;
        if (!take_whole(r, 4, &id) || !take_whole(r, 4, &kind) || !take_whole(r, 8, &width) ||
            !take_whole(r, 8, &height))
            return cut_off(r);
        for (size_t m = 0; m < sizeof models / sizeof *models; m++)
            if ((uint64_t)models[m].id == kind)
                model = &models[m];
        char number[24];
        snprintf(number, sizeof number, "number %llu", (unsigned long long)kind);
        if (!model)
            return unknown_model(r, number);
        if (!take_doubles(r, strlen(model->parameters), value))
            return cut_off(r);
        enum status status = add_camera(r, c, id, model, (double)width, (double)height, value);
        if (status != STATUS_OK)
            return status;
    }
    return STATUS_OK;
}

static enum status read_cameras_text(struct reader *r, struct colmap_cameras *c) {
    while (next_record(r)) {
        const struct model *model = NULL;
        char name[MAX_TOKEN];
        double size[2], value[MAX_PARAMETERS];
        uint64_t id;
        enum status status = read_id(r, &id);
        if (status == STATUS_OK && !next_token(r, name))
            status = line_error(r, "there is no camera model");
        if (status != STATUS_OK)
            return status;
        for (size_t m = 0; m < sizeof models / sizeof *models; m++)
            if (strcmp(models[m].name, name) == 0)
                model = &models[m];
        if (!model)
            return unknown_model(r, name);
        status = read_doubles(r, 2, size);
        if (status == STATUS_OK)
            status = read_doubles(r, strlen(model->parameters), value);
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
    struct reader r = {.name = name, .data = data, .size = size, .err = err};
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

/* --- images --------------------------------------------------------------------------------- */

struct images {
    const struct colmap_cameras *cameras;
    const char *prefix; /* of names: "images/" or "" */
    struct transforms *t;
    size_t capacity;
    struct findings *findings;
};

/* world-to-camera, q = w x y z and t, as camera-to-world rows. */
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

/* A frame at fault is a problem, and left out; false where there are too many. */
static enum status add_image(const struct reader *r, struct images *in, const double pose[7], uint64_t camera,
                             const char *name) {
    struct transforms *t = in->t;
    struct error own;
    char *clean = NULL, *full = mem_printf("%s%s", in->prefix, name);
    size_t number = t->named_count++;
    const struct colmap_camera key = {.id = (uint32_t)camera};
    const struct colmap_camera *found = in->cameras->count == 0 ? NULL :
        bsearch(&key, in->cameras->camera, in->cameras->count, sizeof key, by_id);
    struct transforms_frame frame = {.number = number, .exposure_source = EXPOSURE_UNKNOWN};
    double m[3][4];
    bool scaled;
    invert(pose, pose + 4, m);
    enum status status = STATUS_OK;
    if (number == TRANSFORMS_MAX_FRAMES)
        status = error_set(r->err, STATUS_INPUT, "%s has more than %d images", r->name, TRANSFORMS_MAX_FRAMES);
    else if (path_clean(full, &clean, &own) != STATUS_OK)
        findings_error(in->findings, r->name, &own);
    else if (!found)
        findings_problem(in->findings, r->name, "image %s: there is no camera %llu", clean,
                         (unsigned long long)camera);
    else if (pose_from_matrix((const double(*)[4])m, POSE_RIGHT_DOWN_FORWARD, &frame.world_from_camera,
                              &frame.camera_from_world, &scaled, &own) != STATUS_OK)
        findings_problem(in->findings, r->name, "image %s: its pose: %s", clean, own.message);
    else {
        if (t->frame_count == in->capacity) {
            in->capacity = in->capacity ? 2 * in->capacity : 64;
            t->frame = mem_realloc_array(t->frame, in->capacity, sizeof *t->frame);
        }
        frame.lens = found->lens;
        frame.file = clean;
        clean = NULL;
        t->frame[t->frame_count++] = frame;
    }
    mem_free(clean);
    mem_free(full);
    return status;
}

static enum status read_images_binary(struct reader *r, struct images *in) {
    uint64_t count, id, camera, points;
    double pose[7];
    if (!take_whole(r, 8, &count))
        return cut_off(r);
    for (uint64_t i = 0; i < count; i++) {
        if (!take_whole(r, 4, &id) || !take_doubles(r, 7, pose) || !take_whole(r, 4, &camera))
            return cut_off(r);
        const char *name = (const char *)r->data + r->at;
        const char *end = memchr(name, '\0', r->size - r->at);
        if (!end)
            return cut_off(r);
        r->at += (size_t)(end - name) + 1;
        if (!take_whole(r, 8, &points) || points > (r->size - r->at) / 24)
            return cut_off(r);
        r->at += (size_t)points * 24; /* x, y, the number of a point */
        enum status status = add_image(r, in, pose, camera, name);
        if (status != STATUS_OK)
            return status;
    }
    return STATUS_OK;
}

/* Two lines an image, the second of which may be empty. */
static enum status read_images_text(struct reader *r, struct images *in) {
    while (next_record(r)) {
        double pose[7];
        uint64_t id, camera;
        enum status status = read_id(r, &id);
        if (status == STATUS_OK)
            status = read_doubles(r, 7, pose);
        if (status == STATUS_OK)
            status = read_id(r, &camera);
        if (status != STATUS_OK)
            return status;
        size_t from = r->at, to = r->line_end;
        while (from < to && strchr(" \t", r->data[from]))
            from++;
        while (to > from && strchr(" \t\r", r->data[to - 1]))
            to--;
        if (from == to || memchr(r->data + from, '\0', to - from))
            return line_error(r, "there is no name of a photograph");
        char *name = mem_strndup((const char *)r->data + from, to - from);
        status = add_image(r, in, pose, camera, name);
        mem_free(name);
        if (status != STATUS_OK)
            return status;
        next_line(r);
    }
    return STATUS_OK;
}

static int by_file(const void *a, const void *b) {
    const struct transforms_frame *x = a, *y = b;
    int order = strcmp(x->file, y->file);
    return order ? order : (x->number > y->number) - (x->number < y->number);
}

enum status colmap_images_parse(const void *data, size_t size, const char *name, bool binary,
                                const struct colmap_cameras *cameras, const char *prefix,
                                struct transforms *t, struct findings *f, struct error *err) {
    struct reader r = {.name = name, .data = data, .size = size, .err = err};
    struct images in = {.cameras = cameras, .prefix = prefix, .t = t, .findings = f};
    *t = (struct transforms){0};
    enum status status = binary ? read_images_binary(&r, &in) : read_images_text(&r, &in);
    if (t->frame_count > 1)
        qsort(t->frame, t->frame_count, sizeof *t->frame, by_file);
    return status;
}

/* --- files ---------------------------------------------------------------------------------- */

static bool is_there(const char *root, const char *name) {
    char *path = file_join(root, name);
    bool there = access(path, F_OK) == 0;
    mem_free(path);
    return there;
}

char *colmap_find(const char *root) {
    static const char *const folders[] = {"", "sparse/0/", "sparse/", "colmap/sparse/0/", "dense/sparse/"};
    static const char *const kinds[] = {"bin", "txt"};
    for (size_t i = 0; i < sizeof folders / sizeof *folders; i++) {
        for (size_t k = 0; k < 2; k++) {
            char *images = mem_printf("%simages.%s", folders[i], kinds[k]);
            char *cameras = mem_printf("%scameras.%s", folders[i], kinds[k]);
            bool found = is_there(root, images) && is_there(root, cameras);
            mem_free(cameras);
            if (found)
                return images;
            mem_free(images);
        }
    }
    return NULL;
}

/* Faults of the user's become problems. */
static enum status settle(enum status status, const char *name, const struct error *own, struct findings *f,
                          struct error *err) {
    if (status == STATUS_INPUT || status == STATUS_LIMIT || status == STATUS_NOT_FOUND) {
        findings_error(f, name, own);
        return STATUS_OK;
    }
    if (status != STATUS_OK && err)
        *err = *own;
    return status;
}

enum status colmap_read(const char *root, const char *images, struct transforms *t, struct findings *f,
                        struct error *err) {
    const char *base = path_base(images);
    bool binary = strcmp(path_extension(images), "bin") == 0;
    char *cameras = mem_printf("%.*scameras.%s", (int)(base - images), images, binary ? "bin" : "txt");
    char *path = file_join(root, cameras);
    const char *prefix = is_there(root, "images") ? "images/" : "";
    struct colmap_cameras *found = NULL;
    struct mapping file;
    struct error own = {0};
    *t = (struct transforms){0};
    enum status status = mapping_open(&file, path, cameras, "a file of cameras", &own);
    if (status == STATUS_OK) {
        found = colmap_cameras_parse(file.data, file.size, cameras, binary, &own);
        status = found ? STATUS_OK : own.status;
    }
    mapping_close(&file);
    mem_free(path);
    enum status result = settle(status, cameras, &own, f, err);
    if (found) {
        path = file_join(root, images);
        status = mapping_open(&file, path, images, "a file of images", &own);
        if (status == STATUS_OK)
            status = colmap_images_parse(file.data, file.size, images, binary, found, prefix, t, f, &own);
        mapping_close(&file);
        mem_free(path);
        result = settle(status, images, &own, f, err);
    }
    colmap_cameras_free(found);
    mem_free(cameras);
    return result;
}
