/* select.c -- see select.h. */
#include "server/scene/select.h"

#include <fnmatch.h>
#include <string.h>

#include "common/mem.h"

static bool is_match(const char *pattern, const char *name) {
    const char *slash = strrchr(name, '/');
    return fnmatch(pattern, name, 0) == 0 || (slash && fnmatch(pattern, slash + 1, 0) == 0);
}

/* Marks what one pattern matches; false when that is nothing. */
static bool mark(const struct scene *scene, const char *pattern, bool *is_out) {
    bool any = false;
    for (size_t i = 0; i < scene->photograph_count; i++)
        if (is_match(pattern, scene->photograph[i].name))
            any = is_out[i] = true;
    return any;
}

static enum status mark_all(const struct scene *scene, const char *patterns, bool *is_out, struct error *err) {
    enum status status = STATUS_OK;
    for (const char *at = patterns; *at && status == STATUS_OK;) {
        size_t length = strcspn(at, ",");
        char *pattern = mem_strndup(at, length);
        if (length > 0 && !mark(scene, pattern, is_out))
            status = error_set(err, STATUS_INPUT, "exclude: no photograph is named %s", pattern);
        mem_free(pattern);
        at += length + (at[length] == ',');
    }
    return status;
}

enum status scene_exclude(struct scene *scene, const char *patterns, size_t *left_out, struct error *err) {
    bool *is_out = mem_calloc(scene->photograph_count + 1, sizeof *is_out);
    size_t kept = 0;
    *left_out = 0;
    enum status status = mark_all(scene, patterns, is_out, err);
    for (size_t i = 0; status == STATUS_OK && i < scene->photograph_count; i++) {
        if (is_out[i])
            photograph_release(&scene->photograph[i]);
        else
            scene->photograph[kept++] = scene->photograph[i];
    }
    if (status == STATUS_OK) {
        *left_out = scene->photograph_count - kept;
        scene->photograph_count = kept;
    }
    mem_free(is_out);
    return status;
}

/* Whether a triangle's centre is in the box, which has the input's coordinates. */
static bool is_inside(const struct mesh *mesh, size_t triangle, const double lower[3], const double upper[3]) {
    vec3 p = mesh_point(mesh, triangle, 1.0f / 3.0f, 1.0f / 3.0f);
    const double c[3] = {(double)p.x + mesh->offset[0], (double)p.y + mesh->offset[1], (double)p.z + mesh->offset[2]};
    for (int i = 0; i < 3; i++)
        if (!(c[i] >= lower[i] && c[i] <= upper[i]))
            return false;
    return true;
}

enum status scene_crop(struct scene *scene, const double lower[3], const double upper[3], size_t *left_out,
                       struct error *err) {
    struct mesh *mesh = &scene->mesh;
    size_t kept = 0;
    for (size_t t = 0; t < mesh->triangle_count; t++)
        kept += is_inside(mesh, t, lower, upper);
    *left_out = mesh->triangle_count - kept;
    if (kept == 0)
        return error_set(err, STATUS_INPUT, "crop: no triangle of the mesh has its centre in the box");
    kept = 0;
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        if (!is_inside(mesh, t, lower, upper))
            continue;
        mesh_move_triangle(mesh, t, kept);
        kept++;
    }
    mesh->triangle_count = kept;
    return STATUS_OK;
}
