/* hypothesis.c -- see hypothesis.h. */
#include "server/check/hypothesis.h"

#include <string.h>

#include "common/buf.h"
#include "common/mem.h"
#include "server/ingest/reading_apply.h"

static const struct signed_axes identity = {{0, 1, 2}, {1.0f, 1.0f, 1.0f}};

static bool same_axes(const struct signed_axes *a, const struct signed_axes *b) {
    for (int i = 0; i < 3; i++)
        if (a->axis[i] != b->axis[i] || a->sign[i] != b->sign[i])
            return false;
    return true;
}

struct hypothesis hypothesis_given(void) {
    return (struct hypothesis){.mesh_axes = identity, .scale = 1.0, .lens = 1.0};
}

bool hypothesis_is_given(const struct hypothesis *h) {
    return h->axes == AXES_OF_FORMAT && same_axes(&h->mesh_axes, &identity) && h->scale == 1.0 && h->shift == 0 &&
           !h->coordinates.name && h->lens == 1.0 && !h->is_pinhole;
}

struct signed_axes hypothesis_signed_axes(int number) {
    static const int order[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {2, 1, 0}, {1, 0, 2}};
    struct signed_axes out;
    bool mirror = number >= 24;
    int permutation = number % 24 / 4, signs = number % 4;
    bool is_odd = permutation >= 3;
    for (int i = 0; i < 3; i++)
        out.axis[i] = order[permutation][i];
    out.sign[0] = signs & 1 ? -1.0f : 1.0f;
    out.sign[1] = signs & 2 ? -1.0f : 1.0f;
    out.sign[2] = out.sign[0] * out.sign[1] * (is_odd != mirror ? -1.0f : 1.0f);
    return out;
}

static void apply_inverse(const struct signed_axes *axes, double v[3]) {
    double out[3];
    for (int i = 0; i < 3; i++)
        out[axes->axis[i]] = (double)axes->sign[i] * v[i];
    memcpy(v, out, sizeof out);
}

/* The pose in the coordinates of the bundle, of which the scene's are moved by the mesh's offset. */
static struct exact_pose told_pose(const struct rigid *world_from_camera, const double offset[3]) {
    const vec3 t = world_from_camera->translation;
    struct exact_pose pose = {
        .translation = {(double)t.x + offset[0], (double)t.y + offset[1], (double)t.z + offset[2]}};
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            pose.rotation[i][j] = (double)world_from_camera->rotation[i][j];
    return pose;
}

/* Moves the pose as the mesh would have to be moved, the other way. */
static struct rigid placed_pose(const struct hypothesis *h, struct exact_pose *pose, const double offset[3]) {
    struct rigid out;
    for (int j = 0; j < 3; j++) {
        double column[3] = {pose->rotation[0][j], pose->rotation[1][j], pose->rotation[2][j]};
        apply_inverse(&h->mesh_axes, column);
        for (int i = 0; i < 3; i++)
            out.rotation[i][j] = (float)column[i];
    }
    double *t = pose->translation;
    apply_inverse(&h->mesh_axes, t);
    out.translation = vec3_make((float)(t[0] / h->scale - offset[0]), (float)(t[1] / h->scale - offset[1]),
                                (float)(t[2] / h->scale - offset[2]));
    return out;
}

bool hypothesis_camera(const struct hypothesis *h, const struct scene *scene, size_t index, struct camera *camera) {
    long source = (long)index + h->shift;
    if (source < 0 || source >= (long)scene->photograph_count)
        return false;
    *camera = scene->photograph[index].camera;
    if (h->shift != 0 || h->axes != AXES_OF_FORMAT || h->coordinates.name || h->scale != 1.0 ||
        !same_axes(&h->mesh_axes, &identity)) {
        struct exact_pose pose = told_pose(&scene->photograph[source].camera.world_from_camera, scene->mesh.offset);
        if (h->axes != AXES_OF_FORMAT)
            pose = reading_reinterpret(&pose, scene->pose_axes, h->axes);
        if (h->coordinates.name) {
            double inverse[3][4];
            coordinates_invert(h->coordinates.poses_from, inverse);
            pose_transform((const double(*)[4])inverse, &pose);
        }
        camera->world_from_camera = placed_pose(h, &pose, scene->mesh.offset);
        camera->camera_from_world = rigid_inverse(&camera->world_from_camera);
    }
    if (h->offset.x != 0.0f || h->offset.y != 0.0f || h->offset.z != 0.0f) {
        camera->world_from_camera.translation = vec3_sub(camera->world_from_camera.translation, h->offset);
        camera->camera_from_world = rigid_inverse(&camera->world_from_camera);
    }
    if (h->is_pinhole) {
        camera->model = CAMERA_OPENCV;
        memset(camera->k, 0, sizeof camera->k);
        memset(camera->p, 0, sizeof camera->p);
        memset(camera->s, 0, sizeof camera->s);
        camera->k8 = camera->fold = 0.0f;
    }
    if (h->lens != 1.0) {
        camera->fx *= (float)h->lens;
        camera->fy *= (float)h->lens;
        camera->cx *= (float)h->lens;
        camera->cy *= (float)h->lens;
        camera_find_fold(camera);
    }
    return true;
}

/* --- as a reading ------------------------------------------------------------------------------- */

struct reading hypothesis_reading(const struct hypothesis *h, const struct reading *loaded) {
    struct reading r = reading_copy(loaded);
    if (h->axes != AXES_OF_FORMAT)
        r.axes = h->axes;
    for (int i = 0; i < 3; i++) { /* the hypothesis' turn after the one that was applied */
        r.mesh_axes.axis[i] = loaded->mesh_axes.axis[h->mesh_axes.axis[i]];
        r.mesh_axes.sign[i] = h->mesh_axes.sign[i] * loaded->mesh_axes.sign[h->mesh_axes.axis[i]];
    }
    r.scale *= h->scale;
    r.shift += h->shift;
    if (h->coordinates.name) {
        mem_free(r.coordinates);
        r.coordinates = mem_strdup(h->coordinates.name);
    }
    r.lens *= h->lens;
    r.ignores_distortion = r.ignores_distortion || h->is_pinhole;
    return r;
}

static const char *axes_meaning(enum matrix_axes axes) {
    switch (axes) {
    case AXES_OPENCV: return "camera-to-world with OpenCV's camera axes";
    case AXES_OPENGL: return "camera-to-world with OpenGL's camera axes";
    case AXES_OPENCV_INVERSE: return "world-to-camera with OpenCV's camera axes";
    case AXES_OPENGL_INVERSE: return "world-to-camera with OpenGL's camera axes";
    default: return "as the format says";
    }
}

static void describe_mesh(const struct hypothesis *h, struct buf *text) {
    static const struct {
        double scale;
        const char *unit;
    } units[] = {{1e-3, "millimetres"}, {1e-2, "centimetres"}, {0.0254, "inches"}, {0.3048, "feet"}};
    static const struct signed_axes y_up = {{0, 2, 1}, {1.0f, -1.0f, 1.0f}};
    if (same_axes(&h->mesh_axes, &y_up))
        buf_printf(text, "%sthe mesh is y-up and the cameras are z-up", text->length ? "; " : "");
    else if (!same_axes(&h->mesh_axes, &identity))
        buf_printf(text, "%sthe mesh is %s against the cameras", text->length ? "; " : "",
                   signed_axes_is_mirror(&h->mesh_axes) ? "mirrored" : "turned");
    if (h->scale == 1.0)
        return;
    for (size_t i = 0; i < sizeof units / sizeof *units; i++)
        if (h->scale == units[i].scale) {
            buf_printf(text, "%sthe mesh is in %s and the cameras are in metres", text->length ? "; " : "",
                       units[i].unit);
            return;
        }
    buf_printf(text, "%sone unit of the mesh is %.4g of the cameras'", text->length ? "; " : "", h->scale);
}

char *hypothesis_text(const struct hypothesis *h, const struct reading *loaded) {
    struct buf text;
    buf_init(&text, 4096);
    if (h->axes != AXES_OF_FORMAT)
        buf_printf(&text, "the pose matrices are %s", axes_meaning(h->axes));
    if (h->coordinates.name)
        buf_printf(&text, "%sthe mesh's coordinates are %s", text.length ? "; " : "", h->coordinates.text);
    describe_mesh(h, &text);
    if (h->shift != 0)
        buf_printf(&text, "%seach photograph has the pose of the frame %s it", text.length ? "; " : "",
                   h->shift == 1    ? "after"
                   : h->shift == -1 ? "before"
                   : h->shift > 0   ? "some frames after"
                                    : "some frames before");
    if (h->is_pinhole)
        buf_printf(&text, "%sthe pictures have no lens distortion", text.length ? "; " : "");
    if (h->lens != 1.0)
        buf_printf(&text, "%sfocal length and principal point are those of a picture of %.4g times the size",
                   text.length ? "; " : "", 1.0 / h->lens);
    struct reading reading = hypothesis_reading(h, loaded);
    cJSON *now = reading_json(&reading), *before = reading_json(loaded), *member;
    const char *glue = ": set ";
    cJSON_ArrayForEach(member, now) {
        const cJSON *old = cJSON_GetObjectItemCaseSensitive(before, member->string);
        if (old && cJSON_Compare(old, member, true))
            continue;
        char *value = json_text(member);
        buf_printf(&text, "%s%s=%s", glue, member->string, value);
        mem_free(value);
        glue = ", ";
    }
    cJSON_ArrayForEach(member, before)
        if (!cJSON_HasObjectItem(now, member->string))
            buf_printf(&text, "; give no %s", member->string);
    cJSON_Delete(now);
    cJSON_Delete(before);
    reading_release(&reading);
    char *result = mem_strdup(buf_text(&text));
    buf_release(&text);
    return result;
}
