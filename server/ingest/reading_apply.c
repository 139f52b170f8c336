/* reading_apply.c -- see reading_apply.h. */
#include "server/ingest/reading_apply.h"

#include "common/mem.h"

/* --- poses ---------------------------------------------------------------------------------- */

static bool is_opengl(enum matrix_axes axes) { return axes == AXES_OPENGL || axes == AXES_OPENGL_INVERSE; }
static bool is_inverse(enum matrix_axes axes) { return axes == AXES_OPENCV_INVERSE || axes == AXES_OPENGL_INVERSE; }

/* The pose of a camera whose y and z axes point the other way. */
static struct rigid flip(const struct rigid *m) {
    struct rigid out = *m;
    for (int i = 0; i < 3; i++)
        for (int j = 1; j < 3; j++)
            out.rotation[i][j] = -m->rotation[i][j];
    return out;
}

struct rigid reading_reinterpret(const struct rigid *world_from_camera, enum matrix_axes told, enum matrix_axes meant) {
    struct rigid m = *world_from_camera;
    if (told == meant || meant == AXES_OF_FORMAT)
        return m;
    if (is_opengl(told))
        m = flip(&m);
    if (is_inverse(told) != is_inverse(meant)) /* the file's matrix, read the other way round */
        m = rigid_inverse(&m);
    return is_opengl(meant) ? flip(&m) : m;
}

/* Gives photograph i the pose of frame i + shift. */
static void shift_poses(struct transforms *t, int shift) {
    if (shift == 0)
        return;
    struct rigid *from = mem_array(t->frame_count, sizeof *from), *to = mem_array(t->frame_count, sizeof *to);
    size_t kept = 0;
    for (size_t i = 0; i < t->frame_count; i++) {
        from[i] = t->frame[i].world_from_camera;
        to[i] = t->frame[i].camera_from_world;
    }
    for (size_t i = 0; i < t->frame_count; i++) {
        long other = (long)i + shift;
        struct transforms_frame *frame = &t->frame[i];
        if (other < 0 || other >= (long)t->frame_count) {
            transforms_frame_release(frame);
            continue;
        }
        frame->world_from_camera = from[other];
        frame->camera_from_world = to[other];
        t->frame[kept++] = *frame;
    }
    t->frame_count = kept;
    mem_free(from);
    mem_free(to);
}

void reading_apply_frames(const struct reading *r, struct transforms *t) {
    for (size_t i = 0; i < t->frame_count; i++) {
        struct transforms_frame *frame = &t->frame[i];
        if (r->axes != AXES_OF_FORMAT && r->axes != t->axes) {
            frame->world_from_camera = reading_reinterpret(&frame->world_from_camera, t->axes, r->axes);
            frame->camera_from_world = rigid_inverse(&frame->world_from_camera);
        }
        if (r->ignores_exposures) {
            frame->exposure_source = EXPOSURE_UNKNOWN;
            frame->exposure = 0.0;
        }
    }
    shift_poses(t, r->shift);
}

/* --- the mesh ------------------------------------------------------------------------------- */

void reading_apply_mesh(const struct reading *r, struct mesh *mesh) {
    float scale = (float)r->scale;
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
