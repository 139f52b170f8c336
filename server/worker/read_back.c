/* read_back.c -- see read_back.h. */
#include "server/worker/read_back.h"

#include <math.h>
#include <string.h>

#include "common/json.h"
#include "server/ingest/mesh/mesh_file.h"

#define JSON_LIMIT ((size_t)1 << 30) /* bytes; our files are far smaller */

/* Invariants of a mesh under reordering of triangles and vertices and rotation about the origin. */
struct sums {
    size_t triangle_count;
    double area;       /* m^2 */
    double squares;    /* mean of the corners' squared distances from their centre, m^2 */
    double distance_m; /* of that centre from the input's origin */
};

static struct sums sums_of(const struct mesh *mesh) {
    struct sums sums = {.triangle_count = mesh->triangle_count, .area = mesh_area(mesh)};
    double centre[3] = {0.0, 0.0, 0.0}, squares = 0.0, count = 3.0 * (double)mesh->triangle_count;
    for (size_t t = 0; t < mesh->triangle_count; t++)
        for (int c = 0; c < 3; c++) {
            vec3 p = mesh->position[mesh->index[t][c]];
            squares += (double)p.x * (double)p.x + (double)p.y * (double)p.y + (double)p.z * (double)p.z;
            centre[0] += (double)p.x / count;
            centre[1] += (double)p.y / count;
            centre[2] += (double)p.z / count;
        }
    double far[3];
    sums.squares = squares / count;
    for (int i = 0; i < 3; i++) {
        sums.squares -= centre[i] * centre[i];
        far[i] = mesh->offset[i] + centre[i];
    }
    sums.distance_m = sqrt(far[0] * far[0] + far[1] * far[1] + far[2] * far[2]);
    return sums;
}

/* Within the rounding of single precision after a rotation. */
static bool near(double found, double wanted) { return fabs(found - wanted) <= 1e-5 * fabs(wanted); }

static enum status compare(const char *name, const struct mesh *found_mesh, const struct mesh *mesh,
                           struct error *err) {
    struct sums found = sums_of(found_mesh), wanted = sums_of(mesh);
    if (found.triangle_count != wanted.triangle_count)
        return error_set(err, STATUS_CORRUPT, "%s: read back, it has %zu triangles, not %zu", name,
                         found.triangle_count, wanted.triangle_count);
    double apart = fabs(found.distance_m - wanted.distance_m);
    bool is_moved = !(apart <= 1e-5 * sqrt(wanted.squares) + 1e-6 * fmin(wanted.distance_m, 1e3));
    if (!near(found.area, wanted.area) || !near(found.squares, wanted.squares) || is_moved)
        return error_set(err, STATUS_CORRUPT, "%s: read back, its %zu triangles lie elsewhere: %g m2 in place of %g",
                         name, found.triangle_count, found.area, wanted.area);
    return STATUS_OK;
}

static enum status read_mesh(const char *path, const char *name, const struct mesh *mesh, struct error *err) {
    struct mesh found = {0};
    enum status status = mesh_file_read(path, name, MESH_MAX_TRIANGLES, &found, NULL, err);
    if (status == STATUS_OK)
        status = compare(name, &found, mesh, err);
    mesh_release(&found);
    return status;
}

static enum status read_json(const char *path, struct error *err) {
    cJSON *value = NULL;
    enum status status = json_read(path, JSON_LIMIT, &value, err);
    cJSON_Delete(value);
    return status;
}

enum status read_back(const char *path, const char *name, const struct mesh *mesh, struct error *err) {
    struct error own = {0};
    enum status status = STATUS_OK;
    const char *dot = strrchr(name, '.');
    if (mesh_file_is_known(name))
        status = read_mesh(path, name, mesh, &own);
    else if (dot && strcmp(dot, ".json") == 0)
        status = read_json(path, &own);
    if (status == STATUS_OK)
        return STATUS_OK;
    /* A reader's refusal of our own file is our fault, not the input's. */
    if (status == STATUS_INPUT || status == STATUS_LIMIT)
        return error_set(err, STATUS_CORRUPT, "read back: %s", own.message);
    if (err)
        *err = own;
    return status;
}
