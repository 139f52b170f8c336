/* trajectory.c -- see trajectory.h. */
#include "server/ingest/trajectory.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/file.h"
#include "common/json.h"
#include "common/mem.h"
#include "server/ingest/mapping.h"
#include "server/ingest/pose.h"

#define TRAJECTORY "traj.txt"
#define PARAMETERS "cam_params.json"
#define POSES "pose"
#define INTRINSIC "intrinsic/intrinsic_color.txt"
#define MAX_FILE_BYTES ((size_t)1 << 16) /* of a matrix or a few parameters */
#define PIXEL_CENTRE 0.5

const char *trajectory_find(const char *root) {
    if (file_is_in(root, TRAJECTORY) && file_is_in(root, PARAMETERS))
        return TRAJECTORY;
    return file_is_in(root, POSES "/.") && file_is_in(root, INTRINSIC) ? POSES : NULL;
}

/* --- matrices ------------------------------------------------------------------------------- */

/* Reads a small text file; the caller's. `name` is relative to the folder and used in messages. */
static enum status read_text(const char *root, const char *name, char **text, struct error *err) {
    struct mapping file;
    char *path = file_join(root, name);
    enum status status = mapping_open(&file, path, name, "a text", err);
    if (status == STATUS_OK && file.size > MAX_FILE_BYTES)
        status = error_set(err, STATUS_INPUT, "%s is larger than %zu bytes", name, MAX_FILE_BYTES);
    *text = status == STATUS_OK ? mem_strndup(file.data, file.size) : NULL;
    mapping_close(&file);
    mem_free(path);
    return status;
}

/* Parses 16 numbers of a NUL-terminated text; false when it contains anything else. */
static bool read_matrix(const char *text, double m[4][4]) {
    for (int i = 0; i < 16; i++) {
        char *end;
        m[i / 4][i % 4] = strtod(text, &end);
        if (end == text)
            return false;
        text = end;
    }
    return text[strspn(text, " \t\r\n")] == '\0';
}

static bool is_finite(double m[4][4]) {
    for (int i = 0; i < 12; i++)
        if (!isfinite(m[i / 4][i % 4]))
            return false;
    return true;
}

/* Adds a frame; takes `file`. Faulty poses are problems, lost ones are counted. */
static void add_frame(struct transforms *t, double m[4][4], const struct lens *lens, char *file, const char *name,
                      const char *place, struct findings *f, size_t *lost_count) {
    struct transforms_frame frame = {
        .number = t->named_count++, .file = file, .lens = *lens, .exposure_source = EXPOSURE_UNKNOWN};
    struct error err;
    bool scaled;
    if (!is_finite(m)) {
        (*lost_count)++;
    } else if (pose_from_matrix((const double(*)[4])m, "the matrix", POSE_RIGHT_DOWN_FORWARD, &frame.world_from_camera,
                                &scaled, &err) != STATUS_OK) {
        findings_problem(f, name, "%s: %s", place, err.message);
    } else {
        t->frame[t->frame_count++] = frame;
        return;
    }
    mem_free(file);
}

static void warn_of_lost(const char *name, size_t lost_count, struct findings *f) {
    if (lost_count > 0)
        findings_warning(f, "%s: %zu poses are not finite and were left out", name, lost_count);
}

/* --- NICE-SLAM's Replica -------------------------------------------------------------------- */

enum status trajectory_parse(const void *data, size_t size, const char *name, const struct lens *lens,
                             struct transforms *t, struct findings *f, struct error *err) {
    const char *text = data, *end = size > 0 ? text + size : text;
    size_t line = 0, capacity = 0, lost_count = 0;
    *t = (struct transforms){.axes = AXES_OPENCV};
    while (text < end) {
        const char *newline = memchr(text, '\n', (size_t)(end - text)), *stop = newline ? newline : end;
        char *own = mem_strndup(text, (size_t)(stop - text)), place[48];
        double m[4][4];
        bool is_blank = own[strspn(own, " \t\r")] == '\0', is_matrix = !is_blank && read_matrix(own, m);
        line++;
        text = stop + 1;
        mem_free(own);
        if (is_blank)
            continue;
        if (!is_matrix)
            return error_set(err, STATUS_INPUT, "%s, line %zu: expected the 16 numbers of a matrix", name, line);
        if (t->named_count == TRANSFORMS_MAX_FRAMES)
            return error_set(err, STATUS_INPUT, "%s has more than %d poses", name, TRANSFORMS_MAX_FRAMES);
        if (t->frame_count == capacity) {
            capacity = capacity ? 2 * capacity : 64;
            t->frame = mem_realloc_array(t->frame, capacity, sizeof *t->frame);
        }
        snprintf(place, sizeof place, "line %zu", line);
        char *file = mem_printf("results/frame%06zu", t->named_count);
        add_frame(t, m, lens, file, name, place, f, &lost_count);
    }
    warn_of_lost(name, lost_count, f);
    return STATUS_OK;
}

/* Reads w h fx fy cx cy from the member "camera". */
static enum status read_parameters(const char *root, struct lens *lens, struct error *err) {
    static const char *const key[6] = {"w", "h", "fx", "fy", "cx", "cy"};
    double value[6];
    cJSON *tree = NULL;
    char *text;
    enum status status = read_text(root, PARAMETERS, &text, err);
    if (status == STATUS_OK)
        status = json_parse(text, strlen(text), PARAMETERS, &tree, err);
    const cJSON *camera = cJSON_GetObjectItemCaseSensitive(tree, "camera");
    for (int i = 0; i < 6 && status == STATUS_OK; i++) {
        status = json_number(camera, key[i], PARAMETERS, NAN, &value[i], err);
        if (status == STATUS_OK && isnan(value[i]))
            status = error_set(err, STATUS_INPUT, PARAMETERS ": \"camera\" has no %s", key[i]);
    }
    if (status == STATUS_OK)
        *lens = (struct lens){.model = CAMERA_OPENCV,
                              .width = value[0],
                              .height = value[1],
                              .fl_x = value[2],
                              .fl_y = value[3],
                              .cx = value[4] + PIXEL_CENTRE,
                              .cy = value[5] + PIXEL_CENTRE,
                              .angle_x = NAN,
                              .angle_y = NAN};
    cJSON_Delete(tree);
    mem_free(text);
    return status;
}

static enum status read_replica(const char *root, struct transforms *t, struct findings *f, struct error *err) {
    struct lens lens;
    struct mapping file;
    enum status status = read_parameters(root, &lens, err);
    if (status != STATUS_OK)
        return status;
    char *path = file_join(root, TRAJECTORY);
    status = mapping_open(&file, path, TRAJECTORY, "a list of poses", err);
    if (status == STATUS_OK)
        status = trajectory_parse(file.data, file.size, TRAJECTORY, &lens, t, f, err);
    mapping_close(&file);
    mem_free(path);
    return status;
}

/* --- ScanNet -------------------------------------------------------------------------------- */

static enum status read_matrix_file(const char *root, const char *name, double m[4][4], struct error *err) {
    char *text;
    enum status status = read_text(root, name, &text, err);
    if (status == STATUS_OK && !read_matrix(text, m))
        status = error_set(err, STATUS_INPUT, "%s: expected the 16 numbers of a matrix", name);
    mem_free(text);
    return status;
}

static int by_value(const void *a, const void *b) {
    long x = *(const long *)a, y = *(const long *)b;
    return (x > y) - (x < y);
}

/* Numbers N of the files N.txt in the folder, without leading zeros as ScanNet writes them; ascending, the caller's. */
static enum status list_poses(const char *root, long **number, size_t *count, struct error *err) {
    char *path = file_join(root, POSES), **names;
    size_t name_count;
    *number = NULL;
    *count = 0;
    enum status status = file_list(path, &names, &name_count, err);
    mem_free(path);
    if (status != STATUS_OK)
        return status;
    *number = mem_calloc(name_count + 1, sizeof **number);
    for (size_t i = 0; i < name_count; i++) {
        char name[32];
        long value = strtol(names[i], NULL, 10);
        snprintf(name, sizeof name, "%ld.txt", value);
        if (value >= 0 && strcmp(names[i], name) == 0)
            (*number)[(*count)++] = value;
    }
    file_free_names(names, name_count);
    if (*count > 1)
        qsort(*number, *count, sizeof **number, by_value);
    if (*count > TRANSFORMS_MAX_FRAMES)
        return error_set(err, STATUS_INPUT, POSES " has more than %d poses", TRANSFORMS_MAX_FRAMES);
    return STATUS_OK;
}

static enum status read_scannet(const char *root, struct transforms *t, struct findings *f, struct error *err) {
    double k[4][4], m[4][4];
    long *number = NULL;
    size_t count = 0, lost_count = 0;
    enum status status = read_matrix_file(root, INTRINSIC, k, err);
    if (status == STATUS_OK)
        status = list_poses(root, &number, &count, err);
    struct lens lens = {.model = CAMERA_OPENCV, .width = NAN, .height = NAN, .angle_x = NAN, .angle_y = NAN};
    if (status == STATUS_OK) {
        lens.fl_x = k[0][0];
        lens.fl_y = k[1][1];
        lens.cx = k[0][2] + PIXEL_CENTRE;
        lens.cy = k[1][2] + PIXEL_CENTRE;
        t->frame = mem_calloc(count + 1, sizeof *t->frame);
    }
    for (size_t i = 0; i < count && status == STATUS_OK; i++) {
        struct error own;
        char *name = mem_printf(POSES "/%ld.txt", number[i]);
        status = read_matrix_file(root, name, m, &own);
        if (status == STATUS_OK)
            add_frame(t, m, &lens, mem_printf("color/%ld", number[i]), name, "the pose", f, &lost_count);
        else
            status = findings_settle(f, name, status, &own, err);
        mem_free(name);
    }
    warn_of_lost(POSES, lost_count, f);
    mem_free(number);
    return status;
}

enum status trajectory_read(const char *root, const char *found, struct transforms *t, struct findings *f,
                            struct error *err) {
    struct error own = {0};
    *t = (struct transforms){.axes = AXES_OPENCV};
    bool is_replica = strcmp(found, TRAJECTORY) == 0;
    enum status status = is_replica ? read_replica(root, t, f, &own) : read_scannet(root, t, f, &own);
    return findings_settle(f, found, status, &own, err);
}
