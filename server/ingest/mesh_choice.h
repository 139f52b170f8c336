/* mesh_choice.h -- which of the meshes in a bundle is taken.
 *
 * The key `mesh` of transforms.json or the reading's decide; then ply_file_path if it has faces. Otherwise every PLY,
 * OBJ and glTF file in any folder is a candidate, and these go in order:
 *
 *   1. surfaces before point clouds, which are none
 *   2. names that tools give to their final mesh before others, and these before simplified or labelled ones
 *   3. a mesh that is named as the folder of the cameras ("room0_mesh.ply" for room0/)
 *   4. fewer folders away from the cameras
 *   5. more triangles, among those that fit the limit
 *
 * What is chosen from several is said, with the others. Two that are as good, and not the same file twice, are a
 * problem: the user must say. */
#ifndef UNBAKE_INGEST_MESH_CHOICE_H
#define UNBAKE_INGEST_MESH_CHOICE_H

#include "server/ingest/source/sources.h"

struct mesh_choice {
    const struct listing *listing;
    const struct source_match *match;
    const struct frames *transforms;
    const char *wanted;      /* of the reading; NULL: none */
    uint64_t triangle_limit; /* meshes of more are passed over where there is another */
};

/* Path of the mesh, the caller's; NULL with a problem. Other statuses than STATUS_OK are failures of the machine. */
enum status mesh_choose(const struct mesh_choice *choice, char **found, struct findings *f, struct error *err);

#endif
