/* positions.h -- vertices of a mesh as its file has them, in double, and their way to single precision.
 *
 * Everything behind ingest computes in single precision, whose step at a coordinate x is up to 2^-23 x: 0.07 m in a
 * map's grid at 600 km, 0.5 m at 5000 km. So a mesh that lies far from the origin of its file is moved: its
 * positions, and the cameras' (frame_camera), are relative to an offset, which struct mesh keeps and outputs
 * carry. Axis by axis, the offset is
 *
 *   0        where the step at the farthest coordinate of a surface is at most POSITIONS_STEP_M (up to 839 m), or the
 *            mesh is itself so large that moving it gains less than two bits
 *   centre   of the surfaces' bounds otherwise, rounded to whole metres: exact in double and in text
 *
 * Where it is 0, a position is what the file has, rounded once. Only vertices of triangles count. */
#ifndef UNBAKE_INGEST_MESH_POSITIONS_H
#define UNBAKE_INGEST_MESH_POSITIONS_H

#include <stdbool.h>
#include <stddef.h>

#include "server/scene/mesh.h"

/* Metres; a tenth of what the best scanners of rooms resolve. The arithmetic of rays loses a few steps more. */
#define POSITIONS_STEP_M 1e-4

struct positions {
    double offset[3]; /* that the file states (a mesh of ours): to be added to its coordinates; else 0 */
    double single;    /* metres; farthest coordinate that the file itself has in single precision; 0: none */
    size_t count, capacity;
    double (*at)[3]; /* [count] metres; owned */
};

void positions_append(struct positions *p, const double at[3]);
void positions_release(struct positions *p);

/* The step of single precision at a coordinate, as a bound. */
double positions_step(double coordinate);

/* Moves all of them to mesh->position and sets mesh->vertex_count and mesh->offset; mesh->index must be complete and in
 * range. The positions are empty then. */
void positions_move_to_mesh(struct positions *p, struct mesh *mesh);

/* "unbake offset X Y Z" as our PLY and OBJ files have it in a comment, NUL-terminated; false, and *offset unchanged,
 * when the text is anything else. */
bool positions_read_offset(const char *comment, double offset[3]);

#endif
