/* frame_list.c -- see frame_list.h. */
#include "server/ingest/source/frame_list.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/mem.h"
#include "server/ingest/path.h"
#include "server/scene/coordinates.h"

/* --- frames ----------------------------------------------------------------------------------- */

struct frame_list frame_list_make(struct frames *t, const char *name, enum matrix_axes axes, struct findings *f) {
    bool is_opengl = axes == AXES_OPENGL || axes == AXES_OPENGL_INVERSE;
    *t = (struct frames){.axes = axes};
    return (struct frame_list){
        .t = t, .name = name, .axes = is_opengl ? POSE_RIGHT_UP_BACK : POSE_RIGHT_DOWN_FORWARD, .findings = f};
}

static bool is_finite(double m[3][4]) {
    for (int i = 0; i < 12; i++)
        if (!isfinite(m[i / 4][i % 4]))
            return false;
    return true;
}

enum status frame_list_add(struct frame_list *in, double m[3][4], const struct lens *lens, const char *file,
                           const char *place, struct frame **frame, struct error *err) {
    struct frames *t = in->t;
    struct frame made = {.number = t->named_count, .lens = *lens, .exposure_source = EXPOSURE_UNKNOWN};
    struct error own;
    bool scaled;
    if (frame)
        *frame = NULL;
    if (t->named_count == FRAMES_MAX)
        return error_set(err, STATUS_INPUT, "%s has more than %d frames", in->name, FRAMES_MAX);
    t->named_count++;
    if (in->may_be_lost && !is_finite(m)) {
        in->lost_count++;
        return STATUS_OK;
    }
    if (path_clean_foreign(file, &made.file, &own) != STATUS_OK) {
        findings_problem(in->findings, in->name, "%s: %s", place, own.message);
        return STATUS_OK;
    }
    if (pose_from_matrix((const double(*)[4])m, "the pose", in->axes, &made.world_from_camera, &scaled, &own) !=
        STATUS_OK) {
        findings_problem(in->findings, in->name, "%s: %s", place, own.message);
        mem_free(made.file);
        return STATUS_OK;
    }
    if (t->frame_count == in->capacity) {
        in->capacity = in->capacity ? 2 * in->capacity : 64;
        t->frame = mem_realloc_array(t->frame, in->capacity, sizeof *t->frame);
    }
    t->frame[t->frame_count++] = made;
    if (frame)
        *frame = &t->frame[t->frame_count - 1];
    return STATUS_OK;
}

enum status frame_list_settle(struct frame_list *in, const char *path, enum status status, const struct error *own,
                              double m[3][4], const struct lens *lens, const char *file, const char *place,
                              struct error *err) {
    const char *list_name = in->name;
    if (status != STATUS_OK)
        return findings_settle(in->findings, path, status, own, err);
    in->name = path;
    status = frame_list_add(in, m, lens, file, place, NULL, err);
    in->name = list_name;
    return status;
}

void frame_list_warn_unposed(const struct frame_list *in, size_t count) {
    if (count > 0)
        findings_warning(in->findings, "%s: %zu photographs have no pose and are not used", in->name, count);
}

void frame_list_finish(const struct frame_list *in) {
    if (in->lost_count > 0)
        findings_warning(in->findings, "%s: %zu poses are not finite and were left out", in->name, in->lost_count);
}

static int by_file(const void *a, const void *b) {
    const struct frame *x = a, *y = b;
    int order = strcmp(x->file, y->file);
    return order ? order : (x->number > y->number) - (x->number < y->number);
}

void frame_list_sort(struct frames *t) {
    if (t->frame_count > 1)
        qsort(t->frame, t->frame_count, sizeof *t->frame, by_file);
}

/* --- geometry --------------------------------------------------------------------------------- */

struct lens lens_pinhole(double width, double height, double fx, double fy, double cx, double cy) {
    return (struct lens){.model = CAMERA_OPENCV,
                         .width = width,
                         .height = height,
                         .fl_x = fx,
                         .fl_y = fy,
                         .cx = cx,
                         .cy = cy,
                         .angle_x = NAN,
                         .angle_y = NAN};
}

void rotation_from_quaternion(double w, double x, double y, double z, double r[3][3]) {
    double n = 1.0 / sqrt(w * w + x * x + y * y + z * z);
    coordinates_rotation((const double[4]){w * n, x * n, y * n, z * n}, r);
}

void rotation_from_axis_angle(const double v[3], double r[3][3]) {
    double angle = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    double s = angle > 0.0 ? sin(0.5 * angle) / angle : 0.0; /* the quaternion's vector part per v */
    rotation_from_quaternion(cos(0.5 * angle), s * v[0], s * v[1], s * v[2], r);
}

void pose_at_centre(double r[3][3], const double centre[3], double m[3][4]) {
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++)
            m[i][j] = r[j][i];
        m[i][3] = centre[i];
    }
}

void pose_invert(double r[3][3], const double t[3], double m[3][4]) {
    double centre[3];
    for (int i = 0; i < 3; i++)
        centre[i] = -(r[0][i] * t[0] + r[1][i] * t[1] + r[2][i] * t[2]);
    pose_at_centre(r, centre, m);
}
