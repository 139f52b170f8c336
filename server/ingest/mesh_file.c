/* mesh_file.c -- see mesh_file.h. */
#include "server/ingest/mesh_file.h"

#include <strings.h>

#include "server/ingest/gltf.h"
#include "server/ingest/obj.h"
#include "server/ingest/path.h"
#include "server/ingest/ply.h"

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
