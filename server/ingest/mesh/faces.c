/* faces.c -- see faces.h. */
#include "server/ingest/mesh/faces.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>

#include "common/mem.h"
#include "server/ingest/mesh/positions.h"

void faces_note(struct faces_report *report, const char *format, ...) {
    if (report->note_count == FACES_MAX_NOTES)
        return;
    va_list args;
    va_start(args, format);
    vsnprintf(report->note[report->note_count++], FACES_NOTE_BYTES, format, args);
    va_end(args);
}

struct faces *faces_new(struct mesh *mesh, const char *name, size_t triangle_limit, bool has_object_id) {
    struct faces *f = mem_calloc(1, sizeof *f);
    f->mesh = mesh;
    f->name = name;
    f->limit = triangle_limit < MESH_MAX_TRIANGLES ? triangle_limit : MESH_MAX_TRIANGLES;
    f->has_object_id = has_object_id;
    return f;
}

void faces_reserve(struct faces *f, size_t wanted) {
    if (wanted <= f->capacity)
        return;
    struct mesh *mesh = f->mesh;
    size_t grown = f->capacity + f->capacity / 2;
    f->capacity = grown > wanted ? grown : wanted;
    mesh->index = mem_realloc_array(mesh->index, f->capacity, sizeof *mesh->index);
    mesh->face = mem_realloc_array(mesh->face, f->capacity, sizeof *mesh->face);
    if (f->has_object_id)
        mesh->object_id = mem_realloc_array(mesh->object_id, f->capacity, sizeof *mesh->object_id);
    if (mesh->uv)
        mesh->uv = mem_realloc_array(mesh->uv, f->capacity, sizeof *mesh->uv);
}

/* Those of the polygon's triangle `made`, for triangle `at`. The array begins with the first face that has some. */
static void put_uv(struct faces *f, size_t made, size_t at) {
    struct mesh *mesh = f->mesh;
    if (!mesh->uv && !f->has_uv)
        return;
    if (!mesh->uv) {
        mesh->uv = mem_array(f->capacity, sizeof *mesh->uv);
        for (size_t i = 0; i < 3 * at; i++)
            mesh->uv[i / 3][i % 3] = (vec2){NAN, NAN};
    }
    for (int k = 0; k < 3; k++)
        mesh->uv[at][k] = f->has_uv ? f->uv[f->triangle[made][k]] : (vec2){NAN, NAN};
}

/* Corners in single precision: as they are or, where its steps are too coarse, relative to the first. */
static void place_corners(const struct faces *f, vec3 *corner) {
    const double *first = f->position[0], none[3] = {0.0, 0.0, 0.0};
    double farthest = fmax(fabs(first[0]), fmax(fabs(first[1]), fabs(first[2])));
    const double *from = positions_step(farthest) > POSITIONS_STEP_M ? first : none;
    for (size_t i = 0; i < f->corner_count; i++) {
        const double *at = f->position[i];
        corner[i] = vec3_make((float)(at[0] - from[0]), (float)(at[1] - from[1]), (float)(at[2] - from[2]));
    }
}

enum status faces_add(struct faces *f, int64_t object_id, struct error *err) {
    struct mesh *mesh = f->mesh;
    uint32_t face = (uint32_t)mesh->face_count++;
    if (f->corner_count < 3) {
        f->report.small_count++;
        f->has_uv = false;
        return STATUS_OK;
    }
    f->report.polygon_count += f->corner_count > 4;
    size_t made = f->corner_count - 2;
    if (made > f->limit - mesh->triangle_count)
        return error_set(err, STATUS_LIMIT, "%s has more than %zu triangles, the limit", f->name, f->limit);
    faces_reserve(f, mesh->triangle_count + made);
    place_corners(f, f->single);
    polygon_triangulate(f->single, f->corner_count, f->triangle);
    for (size_t i = 0; i < made; i++) {
        size_t at = mesh->triangle_count++;
        for (int k = 0; k < 3; k++)
            mesh->index[at][k] = f->corner[f->triangle[i][k]];
        mesh->face[at] = face;
        if (f->has_object_id)
            mesh->object_id[at] = object_id;
        put_uv(f, i, at);
    }
    f->has_uv = false;
    return STATUS_OK;
}
