/* unsupported.h -- bundles that are no capture (a video, photographs without poses, splats): says by their files' names
 * what they are, and what makes them usable. */
#ifndef UNBAKE_INGEST_SOURCE_UNSUPPORTED_H
#define UNBAKE_INGEST_SOURCE_UNSUPPORTED_H

#include "server/ingest/source/source.h"

/* A problem: no source recognises the files. `chosen`: the file of cameras that was asked for, or NULL. */
void unsupported_tell_cameras(const struct listing *l, const char *chosen, struct findings *f);

/* A problem: there is no mesh beside the cameras of that source (NULL: nor these). `unread`: a mesh of a format that is
 * not read, or NULL. */
void unsupported_tell_mesh(const struct listing *l, const struct source *source, const char *unread, bool has_clouds,
                           struct findings *f);

#endif
