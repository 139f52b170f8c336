/* mesh_file.c -- see mesh_file.h. */
#include "server/ingest/mesh/mesh_file.h"

#include <strings.h>

#include "common/mem.h"
#include "server/ingest/mesh/gltf.h"
#include "server/ingest/mesh/obj.h"
#include "server/ingest/path.h"
#include "server/ingest/mesh/ply.h"
#include "server/ingest/mesh/positions.h"

typedef enum status mesh_reader(const char *path, const char *name, size_t triangle_limit, struct mesh *mesh,
                                struct faces_report *report, struct error *err);

static const struct {
    const char *extension;
    mesh_reader *read;
} formats[] = {
    {"ply", ply_read},
    {"obj", obj_read},
    {"glb", gltf_read},
    {"gltf", gltf_read},
};

/* NULL: none. */
static mesh_reader *reader_of(const char *name) {
    const char *extension = path_extension(name);
    for (size_t i = 0; i < sizeof formats / sizeof *formats; i++)
        if (strcasecmp(extension, formats[i].extension) == 0)
            return formats[i].read;
    return NULL;
}

bool mesh_file_is_known(const char *name) { return reader_of(name) != NULL; }

enum status mesh_file_read(const char *path, const char *name, size_t triangle_limit, struct mesh *mesh,
                           struct faces_report *report, struct error *err) {
    mesh_reader *read = reader_of(name);
    return (read ? read : ply_read)(path, name, triangle_limit, mesh, report, err);
}

enum status mesh_file_read_look(const char *path, const char *name, size_t triangle_limit, struct mesh *mesh,
                                struct mesh_look *look, struct faces_report *report, struct error *err) {
    mesh_reader *read = reader_of(name);
    *look = (struct mesh_look){0};
    if (read == gltf_read)
        return gltf_read_look(path, name, triangle_limit, mesh, look, report, err);
    if (read == obj_read)
        return obj_read_look(path, name, triangle_limit, mesh, look, report, err);
    enum status status = ply_read(path, name, triangle_limit, mesh, report, err);
    mem_free(mesh->object_id);
    mesh->object_id = NULL;
    return status;
}

static void warn_of_place(const char *name, const struct mesh *mesh, const struct faces_report *report,
                          struct findings *f) {
    const double *at = mesh->offset;
    if (at[0] != 0.0 || at[1] != 0.0 || at[2] != 0.0)
        findings_warning(f,
                         "%s lies far from its origin: mesh and cameras are moved by (%.0f, %.0f, %.0f) m, the offset "
                         "of the outputs' coordinates",
                         name, 0.0 - at[0], 0.0 - at[1], 0.0 - at[2]);
    if (report->step_m > POSITIONS_STEP_M)
        findings_warning(f,
                         "%s has coordinates in single precision whose steps are up to %.2g m: export it in double "
                         "precision or with an origin near the room",
                         name, report->step_m);
}

void mesh_file_warn(const char *name, const struct mesh *mesh, const struct faces_report *report,
                    const struct mesh_report *check, struct findings *f) {
    warn_of_place(name, mesh, report, f);
    for (size_t i = 0; i < report->note_count; i++)
        findings_warning(f, "%s: %s", name, report->note[i]);
    if (report->small_count > 0)
        findings_warning(f, "%s: %zu faces have fewer than three corners and were left out", name, report->small_count);
    if (check->unused_count > 0)
        findings_warning(f, "%s: %zu vertices that no face uses have impossible coordinates and were left out", name,
                         check->unused_count);
    if (check->degenerate_count > 0)
        findings_warning(f, "%s: %zu triangles have no area and were left out", name, check->degenerate_count);
    if (check->duplicate_count > 0)
        findings_warning(f, "%s: %zu triangles repeat an earlier one and were left out", name, check->duplicate_count);
}

enum status mesh_file_count_faces(const char *path, const char *name, uint64_t *count, struct error *err) {
    enum status status = ply_count_faces(path, name, count, err);
    *count = status == STATUS_INPUT ? 1 : *count;
    return status == STATUS_INPUT ? STATUS_OK : status;
}

enum status mesh_file_has_faces(const char *path, const char *name, bool *has, struct error *err) {
    uint64_t count = 0;
    mesh_reader *read = reader_of(name);
    *has = true;
    if (read && read != ply_read)
        return STATUS_OK;
    enum status status = ply_count_faces(path, name, &count, err);
    *has = status != STATUS_OK || count > 0;
    return status == STATUS_INPUT ? STATUS_OK : status;
}
