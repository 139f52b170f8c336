/* read_back.h -- checks that an output can be read, before it is announced. */
#ifndef UNBAKE_WORKER_READ_BACK_H
#define UNBAKE_WORKER_READ_BACK_H

#include "common/error.h"
#include "server/scene/mesh.h"

/* Reads the file as its users will: PLY, OBJ and GLB with our own readers, which must find `mesh` in it, in any
 * order and rotated by quarter turns; JSON with the parser. Pictures are compared when written (image.h), and the
 * bytes of every file too (sink.h): those are not read again. STATUS_CORRUPT says what is wrong. Needs the memory of
 * the mesh once more. */
enum status read_back(const char *path, const char *name, const struct mesh *mesh, struct error *err);

#endif
