/* read_back.h -- whether an output can be read, before anybody is told of it. */
#ifndef UNBAKE_WORKER_READ_BACK_H
#define UNBAKE_WORKER_READ_BACK_H

#include "common/error.h"
#include "server/scene/mesh.h"

/* Reads the file as its users will: PLY, OBJ and GLB by our own readers, which must find `mesh` in it, in any order and
 * turned by quarters; JSON by the parser. Pictures are compared where they are written (image.h), and of every file the
 * bytes (sink.h): those are not read again. STATUS_CORRUPT says what is wrong. Takes the memory of the mesh once more. */
enum status read_back(const char *path, const char *name, const struct mesh *mesh, struct error *err);

#endif
