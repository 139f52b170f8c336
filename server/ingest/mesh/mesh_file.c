/* mesh_file.c -- see mesh_file.h. */
#include "server/ingest/mesh/mesh_file.h"

#include <string.h>
#include <strings.h>

#include "common/mem.h"
#include "server/ingest/mapping.h"
#include "server/ingest/mesh/gltf.h"
#include "server/ingest/mesh/obj.h"
#include "server/ingest/mesh/ply.h"
#include "server/ingest/mesh/positions.h"
#include "server/ingest/path.h"

typedef enum status mesh_parser(const void *data, size_t size, const char *name, const char *folder,
                                size_t triangle_limit, struct mesh *mesh, struct mesh_materials *materials,
                                struct faces_report *report, struct error *err);

/* A PLY says nothing of its surfaces. */
static enum status parse_ply(const void *data, size_t size, const char *name, const char *folder, size_t triangle_limit,
                             struct mesh *mesh, struct mesh_materials *materials, struct faces_report *report,
                             struct error *err) {
    (void)folder;
    enum status status = ply_parse(data, size, name, triangle_limit, mesh, report, err);
    if (materials) {
        mem_free(mesh->object_id);
        mesh->object_id = NULL;
    }
    return status;
}

static const struct mesh_format {
    const char *extension, *kind; /* kind: as for mapping_open */
    mesh_parser *parse;
} formats[] = {
    {"ply", "a PLY file", parse_ply},
    {"obj", "an OBJ file", obj_parse},
    {"glb", "a glTF file", gltf_parse},
    {"gltf", "a glTF file", gltf_parse},
};

/* NULL: none. */
static const struct mesh_format *format_of(const char *name) {
    const char *extension = path_extension(name);
    for (size_t i = 0; i < sizeof formats / sizeof *formats; i++)
        if (strcasecmp(extension, formats[i].extension) == 0)
            return &formats[i];
    return NULL;
}

bool mesh_file_is_known(const char *name) { return format_of(name) != NULL; }

static enum status read_mesh(const char *path, const char *name, size_t triangle_limit, struct mesh *mesh,
                             struct mesh_materials *materials, struct faces_report *report, struct error *err) {
    const struct mesh_format *format = format_of(name);
    const char *slash = strrchr(path, '/');
    char *folder = slash ? mem_strndup(path, (size_t)(slash - path)) : mem_strdup(".");
    struct mapping file;
    format = format ? format : &formats[0];
    *mesh = (struct mesh){0};
    enum status status = mapping_open(&file, path, name, format->kind, err);
    if (status == STATUS_OK)
        status = format->parse(file.data, file.size, name, folder, triangle_limit, mesh, materials, report, err);
    mapping_close(&file);
    mem_free(folder);
    return status;
}

enum status mesh_file_read(const char *path, const char *name, size_t triangle_limit, struct mesh *mesh,
                           struct faces_report *report, struct error *err) {
    return read_mesh(path, name, triangle_limit, mesh, NULL, report, err);
}

enum status mesh_file_read_materials(const char *path, const char *name, size_t triangle_limit, struct mesh *mesh,
                                     struct mesh_materials *materials, struct faces_report *report, struct error *err) {
    *materials = (struct mesh_materials){0};
    return read_mesh(path, name, triangle_limit, mesh, materials, report, err);
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
    const struct mesh_format *format = format_of(name);
    *has = true;
    if (format && format->parse != parse_ply)
        return STATUS_OK;
    enum status status = ply_count_faces(path, name, &count, err);
    *has = status != STATUS_OK || count > 0;
    return status == STATUS_INPUT ? STATUS_OK : status;
}
