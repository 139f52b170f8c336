/* duplicate_frames.h -- frames that name a photograph which another frame has named. */
#ifndef UNBAKE_INGEST_DUPLICATE_FRAMES_H
#define UNBAKE_INGEST_DUPLICATE_FRAMES_H

#include "server/ingest/findings.h"
#include "server/ingest/frames.h"

/* Leaves out the frames that name a photograph again with the same pose, with a warning: test views that are copies of
 * the others, lists that were joined. The one that stays is held out only if all were. Two poses of one photograph are
 * a problem, since one of them must be wrong. `name` is that of the file of cameras; paths are those of files already,
 * so that "a" and "a.png" are the same. */
void duplicate_frames_remove(struct frames *t, const char *name, struct findings *f);

#endif
