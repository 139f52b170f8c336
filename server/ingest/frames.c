/* frames.c -- see frames.h. */
#include "server/ingest/frames.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#include "common/buf.h"
#include "common/mem.h"

void frame_release(struct frame *frame) {
    mem_free(frame->file);
    mem_free(frame->mask);
}

void frames_release(struct frames *t) {
    for (size_t i = 0; i < t->frame_count; i++)
        frame_release(&t->frame[i]);
    mem_free(t->frame);
    mem_free(t->mesh);
    mem_free(t->point_cloud);
    *t = (struct frames){0};
}

/* --- coordinates ------------------------------------------------------------------------- */

#define FILE_COORDINATES "file"

void frames_add_coordinates(struct frames *t, const char *name, const char *text, const double poses_from[3][4]) {
    assert(t->other_count < COORDINATES_MAX);
    struct coordinates *added = &t->other[t->other_count++];
    *added = (struct coordinates){.name = name, .text = text};
    memcpy(added->poses_from, poses_from, sizeof added->poses_from);
}

/* The present ones take the place of the others' number `index`. */
static void move(struct frames *t, size_t index) {
    const struct coordinates to = t->other[index];
    double inverse[3][4], moved[3][4];
    coordinates_invert(to.poses_from, inverse);
    for (size_t i = 0; i < t->frame_count; i++)
        pose_transform((const double(*)[4])inverse, &t->frame[i].world_from_camera);
    for (size_t i = 0; i < t->other_count; i++) {
        coordinates_product((const double(*)[4])inverse, t->other[i].poses_from, moved);
        memcpy(t->other[i].poses_from, moved, sizeof moved);
    }
    struct coordinates *old = &t->other[index];
    *old = (struct coordinates){.name = t->coordinates ? t->coordinates : FILE_COORDINATES,
                                .text = "those of the cameras' file"};
    memcpy(old->poses_from, inverse, sizeof inverse);
    t->coordinates = to.name;
}

/* Cameras within the mesh's bounds, grown by their half, after `from` was undone. */
static size_t count_inside(const struct frames *t, const double poses_from[3][4], const struct mesh *mesh) {
    vec3 lower, upper;
    double inverse[3][4];
    size_t count = 0;
    mesh_bounds(mesh, &lower, &upper);
    const float low[3] = {lower.x, lower.y, lower.z}, high[3] = {upper.x, upper.y, upper.z};
    coordinates_invert(poses_from, inverse);
    for (size_t f = 0; f < t->frame_count; f++) {
        struct exact_pose pose = t->frame[f].world_from_camera;
        bool is_inside = true;
        pose_transform((const double(*)[4])inverse, &pose);
        for (int i = 0; i < 3; i++) {
            double at = pose.translation[i] - mesh->offset[i], grown = 0.5 * (double)(high[i] - low[i]);
            is_inside = is_inside && at > (double)low[i] - grown && at < (double)high[i] + grown;
        }
        count += is_inside;
    }
    return count;
}

static void move_to_mesh(struct frames *t, const struct mesh *mesh) {
    static const double identity[3][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}};
    size_t best = t->other_count, most = count_inside(t, identity, mesh);
    for (size_t i = 0; i < t->other_count; i++) {
        size_t count = count_inside(t, (const double(*)[4])t->other[i].poses_from, mesh);
        best = count > most ? i : best;
        most = count > most ? count : most;
    }
    t->stands_apart = most == 0;
    if (best < t->other_count)
        move(t, best);
}

enum status frames_choose_coordinates(struct frames *t, const char *given, const struct mesh *mesh, struct error *err) {
    if (!given) {
        if (t->is_placed_by_mesh && mesh)
            move_to_mesh(t, mesh);
        return STATUS_OK;
    }
    for (size_t i = 0; i < t->other_count; i++)
        if (strcmp(given, t->other[i].name) == 0) {
            move(t, i);
            return STATUS_OK;
        }
    if (strcmp(given, t->coordinates ? t->coordinates : FILE_COORDINATES) == 0)
        return STATUS_OK;
    struct buf known;
    buf_init(&known, 1024);
    for (size_t i = 0; i < t->other_count; i++)
        buf_printf(&known, ", \"%s\"", t->other[i].name);
    error_set(err, STATUS_INPUT, "coordinates=%s: the cameras' file knows no such coordinates, only \"%s\"%s", given,
              t->coordinates ? t->coordinates : FILE_COORDINATES, buf_text(&known));
    buf_release(&known);
    return err->status;
}

/* --- cameras ----------------------------------------------------------------------------- */

enum status frame_camera(const struct frame *frame, uint32_t width, uint32_t height, const double offset[3],
                         struct camera *camera, struct error *err) {
    const struct lens *lens = &frame->lens;
    double stated_width = isnan(lens->width) ? width : lens->width;
    double stated_height = isnan(lens->height) ? height : lens->height;
    if (stated_width != width || stated_height != height)
        return error_set(err, STATUS_INPUT, "the picture is %u x %u pixels, but frames[%zu] says %.0f x %.0f", width,
                         height, frame->number, stated_width, stated_height);
    double fx = lens->fl_x, fy = lens->fl_y;
    if (isnan(fx) && !isnan(lens->angle_x))
        fx = 0.5 * width / tan(0.5 * lens->angle_x);
    if (isnan(fy) && !isnan(lens->angle_y))
        fy = 0.5 * height / tan(0.5 * lens->angle_y);
    /* square pixels by default */
    fx = isnan(fx) ? fy : fx;
    fy = isnan(fy) ? fx : fy;
    double cx = isnan(lens->cx) ? 0.5 * width : lens->cx;
    double cy = isnan(lens->cy) ? 0.5 * height : lens->cy;
    if (lens->is_relative) {
        double longer = width > height ? width : height;
        fx *= longer;
        fy *= longer;
        cx = 0.5 * width + lens->cx * longer;
        cy = 0.5 * height + lens->cy * longer;
    }
    if (!(fx > 1e-3 * width && fx < 1e4 * width && fy > 1e-3 * height && fy < 1e4 * height))
        return error_set(err, STATUS_INPUT,
                         "a focal length of %.6g x %.6g pixels cannot belong to a picture of %u x %u", fx, fy, width,
                         height);
    if (!(fabs(cx) < 10.0 * width && fabs(cy) < 10.0 * height))
        return error_set(err, STATUS_INPUT, "the principal point %.6g, %.6g lies far outside the picture of %u x %u",
                         cx, cy, width, height);
    if (lens->model == CAMERA_FOV && !(lens->k[0] >= 0.0 && lens->k[0] < 3.1))
        return error_set(err, STATUS_INPUT, "the lens's omega is %.9g, it must be an angle in radians below pi",
                         lens->k[0]);
    *camera = (struct camera){
        .model = lens->model,
        .width = width,
        .height = height,
        .fx = (float)fx,
        .fy = (float)fy,
        .cx = (float)cx,
        .cy = (float)cy,
    };
    pose_to_rigid(&frame->world_from_camera, offset, &camera->world_from_camera, &camera->camera_from_world);
    for (int i = 0; i < 6; i++)
        camera->k[i] = (float)lens->k[i];
    camera->k8 = (float)lens->k8;
    for (int i = 0; i < 2; i++) {
        camera->p[i] = (float)lens->p[i];
        camera->s[i] = (float)lens->s[i];
    }
    if (lens->rescale > 0.0) {
        camera->fx *= (float)lens->rescale;
        camera->fy *= (float)lens->rescale;
        camera->cx *= (float)lens->rescale;
        camera->cy *= (float)lens->rescale;
    }
    camera_find_fold(camera);
    return STATUS_OK;
}

double frame_exposure(double time_sec, double iso, double f_number) {
    if (!(time_sec > 0.0))
        return 0.0;
    return time_sec * (iso > 0.0 ? iso / 100.0 : 1.0) / (f_number > 0.0 ? f_number * f_number : 1.0);
}

double frame_settings_exposure(double time_sec, double iso, double f_number) {
    return iso > 0.0 && f_number > 0.0 ? frame_exposure(time_sec, iso, f_number) : 0.0;
}
