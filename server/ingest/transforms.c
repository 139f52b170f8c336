/* transforms.c -- see transforms.h. */
#include "server/ingest/transforms.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "common/mem.h"
#include "server/ingest/frame_context.h"
#include "server/ingest/path.h"
#include "server/ingest/transforms_lens.h"

/* --- paths ------------------------------------------------------------------------------- */

/* A path in the bundle; NULL when absent or faulty. Backslashes (Windows tools) separate folders. */
static char *path(struct frame_context *c, const cJSON *object, const char *key) {
    const char *value = frame_context_string(c, object, key);
    if (!value)
        return NULL;
    char *copy = mem_strdup(value), *clean = NULL;
    for (char *p = copy; *p; p++)
        if (*p == '\\')
            *p = '/';
    struct error err;
    if (path_clean(copy, &clean, &err) != STATUS_OK) {
        frame_context_problem(c, "%s %s", key, err.message);
    } else if (clean[0] == '\0') {
        frame_context_problem(c, "%s is empty", key);
        mem_free(clean);
        clean = NULL;
    }
    mem_free(copy);
    return clean;
}

/* The name of a photograph, which may be one of another machine's. */
static char *photograph(struct frame_context *c, const char *key) {
    const char *value = frame_context_string(c, c->frame, key);
    char *clean = NULL;
    struct error err;
    if (value && path_clean_foreign(value, &clean, &err) != STATUS_OK)
        frame_context_problem(c, "%s %s", key, value[0] ? err.message : "is empty");
    return clean;
}

/* --- pose, exposure, split --------------------------------------------------------------- */

/* Reads 3 or 4 rows of 4 numbers; false when it is anything else. The last row is 0 0 0 1 unless it is
 * given. */
static bool read_matrix(const cJSON *matrix, double m[4][4]) {
    const cJSON *row, *cell;
    int rows = 0;
    m[3][3] = 1.0;
    cJSON_ArrayForEach(row, matrix) {
        int columns = 0;
        cJSON_ArrayForEach(cell, row) {
            if (rows < 4 && columns < 4)
                m[rows][columns] = frame_context_plain_number(cell, &m[rows][columns]) ? m[rows][columns] : (double)NAN;
            columns++;
        }
        if (columns != 4)
            return false;
        rows++;
    }
    return rows == 3 || rows == 4;
}

static void read_pose(struct frame_context *c, struct frame *frame) {
    double m[4][4] = {{0}};
    if (!read_matrix(cJSON_GetObjectItemCaseSensitive(c->frame, "transform_matrix"), m)) {
        frame_context_problem(c, "transform_matrix must be an array of 4 (or 3) rows of 4 numbers");
        return;
    }
    /* but for rounding of single precision */
    if (!(fabs(m[3][0]) + fabs(m[3][1]) + fabs(m[3][2]) + fabs(m[3][3] - 1.0) < 1e-5)) {
        frame_context_problem(c, "the last row of transform_matrix must be 0 0 0 1");
        return;
    }
    struct error err;
    bool scaled = false;
    if (pose_from_matrix((const double(*)[4])m, "transform_matrix", POSE_RIGHT_UP_BACK, &frame->world_from_camera,
                         &scaled, &err) != STATUS_OK)
        frame_context_problem(c, "%s", err.message);
    c->scaled_count += scaled;
}

static void read_exposure(struct frame_context *c, struct frame *frame) {
    double factor = frame_context_positive(c, "exposure"), time_sec = frame_context_positive(c, "exposure_time");
    double iso = frame_context_positive(c, "iso"), f_number = frame_context_positive(c, "f_number");
    frame->exposure = !isnan(factor) ? factor : isnan(time_sec) ? 0.0 : frame_exposure(time_sec, iso, f_number);
    frame->exposure_source = !isnan(factor) ? EXPOSURE_FACTOR : isnan(time_sec) ? EXPOSURE_UNKNOWN : EXPOSURE_CAMERA;
    frame->settings_exposure = frame_settings_exposure(time_sec, iso, f_number); /* NAN: not told */
}

static bool is_listed(const cJSON *list, const char *clean) {
    const cJSON *item;
    cJSON_ArrayForEach(item, list) {
        const char *name = cJSON_IsString(item) ? item->valuestring : "";
        while (strncmp(name, "./", 2) == 0)
            name += 2;
        if (strcmp(name, clean) == 0)
            return true;
    }
    return false;
}

/* False when the frame is in none of the file's split lists: it is left out, as in nerfstudio. */
static bool read_split(struct frame_context *c, struct frame *frame) {
    const char *split = frame_context_string(c, c->frame, "split");
    frame->is_test = false;
    if (split) {
        frame->is_test = strcmp(split, "test") == 0 || strcmp(split, "val") == 0;
        if (!frame->is_test && strcmp(split, "train") != 0)
            frame_context_problem(c, "split must be \"train\", \"test\" or \"val\"");
        return true;
    }
    if (is_listed(c->list[1], frame->file) || is_listed(c->list[2], frame->file)) {
        frame->is_test = true;
        return true;
    }
    return !c->list[0] || is_listed(c->list[0], frame->file);
}

/* --- the file ---------------------------------------------------------------------------- */

static bool read_frame(struct frame_context *c, const cJSON *object, struct frame *frame) {
    *frame = (struct frame){.number = frame->number};
    c->ok = true;
    c->frame = object;
    snprintf(c->place, sizeof c->place, "frames[%zu]", frame->number);
    if (!cJSON_IsObject(object)) {
        frame_context_problem(c, "must be an object");
        return false;
    }
    frame->file = photograph(c, "file_path");
    if (!frame->file) {
        if (c->ok)
            frame_context_problem(c, "no file_path");
        return false;
    }
    snprintf(c->place, sizeof c->place, "frames[%zu] (%.200s)", frame->number, frame->file);
    frame->mask = photograph(c, "mask_path");
    if (cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(object, "is_bad"))) {
        c->bad_count++;
        return false;
    }
    struct lens *lens = &frame->lens;
    transforms_lens_read(c, lens);
    if (c->ok && isnan(lens->fl_x) && isnan(lens->fl_y) && isnan(lens->angle_x) && isnan(lens->angle_y))
        frame_context_problem(c, "no focal length: expected fl_x, fl_y or camera_angle_x");
    read_pose(c, frame);
    read_exposure(c, frame);
    bool listed = read_split(c, frame);
    c->unlisted_count += !listed;
    return c->ok && listed;
}

static void read_applied(struct frame_context *c, struct frames *t) {
    const cJSON *matrix = cJSON_GetObjectItemCaseSensitive(c->root, "applied_transform");
    double m[4][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}, scale = frame_context_positive(c, "applied_scale");
    if (matrix && !cJSON_IsNull(matrix) && !read_matrix(matrix, m))
        frame_context_problem(c, "applied_transform must be an array of 3 (or 4) rows of 4 numbers");
    memcpy(t->applied, m, sizeof t->applied);
    t->applied_scale = isnan(scale) ? 1.0 : scale;
    t->has_applied = cJSON_IsArray(matrix) || !isnan(scale);
}

/* Faults at the top level are reported here once, and not per frame. */
static bool read_top(struct frame_context *c, struct frames *t) {
    static const char *const lists[3] = {"train_filenames", "val_filenames", "test_filenames"};
    struct frame scratch;
    const cJSON *frames = cJSON_GetObjectItemCaseSensitive(c->root, "frames");
    snprintf(c->place, sizeof c->place, "at the top");
    c->ok = true;
    if (!cJSON_IsObject(c->root) || !cJSON_IsArray(frames)) {
        frame_context_problem(c, "expected an object with an array \"frames\"");
        return false;
    }
    int count = cJSON_GetArraySize(frames);
    if (count > FRAMES_MAX) {
        frame_context_problem(c, "there are %d frames; %d are the limit", count, FRAMES_MAX);
        return false;
    }
    t->mesh = path(c, c->root, "mesh");
    t->point_cloud = path(c, c->root, "ply_file_path");
    for (int i = 0; i < 3; i++) {
        c->list[i] = cJSON_GetObjectItemCaseSensitive(c->root, lists[i]);
        if (c->list[i] && !cJSON_IsArray(c->list[i])) {
            frame_context_problem(c, "train_filenames, val_filenames and test_filenames must be arrays");
            return false;
        }
    }
    transforms_lens_read(c, &scratch.lens);
    read_exposure(c, &scratch);
    read_applied(c, t);
    return c->ok;
}

/* Adds the frames of an array; all of `test_frames` are held out. */
static void read_frames(struct frame_context *c, const cJSON *frames, bool is_test, struct frames *t) {
    const cJSON *object;
    cJSON_ArrayForEach(object, frames) {
        struct frame *frame = &t->frame[t->frame_count];
        frame->number = t->named_count++;
        if (read_frame(c, object, frame)) {
            frame->is_test = frame->is_test || is_test;
            t->frame_count++;
        } else {
            frame_release(frame);
        }
    }
}

static void warn(const struct frame_context *c) {
    if (c->scaled_count > 0)
        findings_warning(c->findings, "%s: the rotation of %zu frames carries a scale, which was taken out", c->name,
                         c->scaled_count);
    if (c->bad_count > 0)
        findings_warning(c->findings, "%s: %zu frames are marked is_bad and were left out", c->name, c->bad_count);
    if (c->unlisted_count > 0)
        findings_warning(c->findings,
                         "%s: %zu frames are in none of train_filenames, val_filenames and "
                         "test_filenames and were left out",
                         c->name, c->unlisted_count);
}

void transforms_read(const cJSON *root, const char *name, struct frames *t, struct findings *f) {
    struct frame_context c = {.root = root, .name = name, .findings = f};
    *t = (struct frames){.axes = AXES_OPENGL};
    if (!read_top(&c, t))
        return;
    const cJSON *frames = cJSON_GetObjectItemCaseSensitive(root, "frames");
    const cJSON *test_frames = cJSON_GetObjectItemCaseSensitive(root, "test_frames");
    t->frame =
        mem_calloc((size_t)cJSON_GetArraySize(frames) + (size_t)cJSON_GetArraySize(test_frames) + 1, sizeof *t->frame);
    read_frames(&c, frames, false, t);
    if (cJSON_IsArray(test_frames) && cJSON_GetArraySize(test_frames) <= FRAMES_MAX) {
        size_t before = t->frame_count;
        memset(c.list, 0, sizeof c.list);
        read_frames(&c, test_frames, true, t);
        if (t->frame_count > before)
            findings_warning(f, "%s: the %zu frames of test_frames are held out", name, t->frame_count - before);
    }
    warn(&c);
}
