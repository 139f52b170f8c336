/* frames.c -- see frames.h. */
#include "server/ingest/frames.h"

#include <math.h>

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
    camera_find_fold(camera);
    return STATUS_OK;
}

double frame_exposure(double time_sec, double iso, double f_number) {
    if (!(time_sec > 0.0))
        return 0.0;
    return time_sec * (iso > 0.0 ? iso / 100.0 : 1.0) / (f_number > 0.0 ? f_number * f_number : 1.0);
}
