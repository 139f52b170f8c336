/* reading_apply.c -- see reading_apply.h. */
#include "server/ingest/reading_apply.h"

#include <string.h>

#include "common/mem.h"

/* --- poses ---------------------------------------------------------------------------------- */

static bool is_opengl(enum matrix_axes axes) { return axes == AXES_OPENGL || axes == AXES_OPENGL_INVERSE; }
static bool is_inverse(enum matrix_axes axes) { return axes == AXES_OPENCV_INVERSE || axes == AXES_OPENGL_INVERSE; }

/* The pose of a camera whose y and z axes point the other way. */
static void flip(struct exact_pose *m) {
    for (int i = 0; i < 3; i++)
        for (int j = 1; j < 3; j++)
            m->rotation[i][j] = -m->rotation[i][j];
}

static struct exact_pose inverse_of(const struct exact_pose *m) {
    struct exact_pose out;
    for (int i = 0; i < 3; i++) {
        out.translation[i] = 0.0;
        for (int j = 0; j < 3; j++) {
            out.rotation[i][j] = m->rotation[j][i];
            out.translation[i] -= m->rotation[j][i] * m->translation[j];
        }
    }
    return out;
}

struct exact_pose reading_reinterpret(const struct exact_pose *world_from_camera, enum matrix_axes told,
                                      enum matrix_axes meant) {
    struct exact_pose m = *world_from_camera;
    if (told == meant || meant == AXES_OF_FORMAT)
        return m;
    if (is_opengl(told))
        flip(&m);
    if (is_inverse(told) != is_inverse(meant)) /* the file's matrix, read the other way round */
        m = inverse_of(&m);
    if (is_opengl(meant))
        flip(&m);
    return m;
}

/* Gives photograph i the pose of frame i + shift. */
static void shift_poses(struct frames *t, int shift) {
    if (shift == 0)
        return;
    struct exact_pose *pose = mem_array(t->frame_count, sizeof *pose);
    size_t kept = 0;
    for (size_t i = 0; i < t->frame_count; i++)
        pose[i] = t->frame[i].world_from_camera;
    for (size_t i = 0; i < t->frame_count; i++) {
        long other = (long)i + shift;
        struct frame *frame = &t->frame[i];
        if (other < 0 || other >= (long)t->frame_count) {
            frame_release(frame);
            continue;
        }
        frame->world_from_camera = pose[other];
        t->frame[kept++] = *frame;
    }
    t->frame_count = kept;
    mem_free(pose);
}

/* The pinhole of its focal length and principal point. */
static void lens_straighten(struct lens *lens) {
    lens->model = CAMERA_OPENCV;
    memset(lens->k, 0, sizeof lens->k);
    memset(lens->p, 0, sizeof lens->p);
    memset(lens->s, 0, sizeof lens->s);
    lens->k8 = 0.0;
}

void reading_apply_frames(const struct reading *r, struct frames *t) {
    for (size_t i = 0; i < t->frame_count; i++) {
        struct frame *frame = &t->frame[i];
        if (r->axes != AXES_OF_FORMAT && r->axes != t->axes)
            frame->world_from_camera = reading_reinterpret(&frame->world_from_camera, t->axes, r->axes);
        frame->lens.rescale = r->lens;
        if (r->ignores_distortion)
            lens_straighten(&frame->lens);
        if (r->ignores_exposures) {
            frame->exposure_source = EXPOSURE_UNKNOWN;
            frame->exposure = frame->settings_exposure = 0.0;
        }
    }
    shift_poses(t, r->shift);
}

/* --- the mesh ------------------------------------------------------------------------------- */

void reading_apply_mesh(const struct reading *r, struct mesh *mesh) {
    float scale = (float)r->scale;
    double offset[3];
    for (int i = 0; i < 3; i++)
        offset[i] = (double)r->mesh_axes.sign[i] * mesh->offset[r->mesh_axes.axis[i]] * r->scale + 0.0; /* not -0 */
    memcpy(mesh->offset, offset, sizeof offset);
    for (size_t i = 0; i < mesh->vertex_count; i++) {
        mesh->position[i] = vec3_scale(signed_axes_apply(&r->mesh_axes, mesh->position[i]), scale);
        if (mesh->normal)
            mesh->normal[i] = signed_axes_apply(&r->mesh_axes, mesh->normal[i]);
    }
    if (!signed_axes_is_mirror(&r->mesh_axes))
        return;
    for (size_t i = 0; i < mesh->triangle_count; i++) {
        uint32_t second = mesh->index[i][1];
        mesh->index[i][1] = mesh->index[i][2];
        mesh->index[i][2] = second;
    }
}
