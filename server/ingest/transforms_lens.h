/* transforms_lens.h -- the lens of a frame of transforms.json (transforms.h). */
#ifndef UNBAKE_INGEST_TRANSFORMS_LENS_H
#define UNBAKE_INGEST_TRANSFORMS_LENS_H

#include "server/ingest/frame_context.h"
#include "server/ingest/frames.h"

void transforms_lens_read(struct frame_context *c, struct lens *lens);

#endif
