/* sources.h -- the table of sources, and which of them a bundle is. */
#ifndef UNBAKE_INGEST_SOURCE_SOURCES_H
#define UNBAKE_INGEST_SOURCE_SOURCES_H

#include "server/ingest/source/source.h"

struct source_match {
    const struct source *source; /* NULL: none */
    char *base, *found;          /* owned */
    char *other; /* what another folder, that is not below base, has of the same source; NULL: none; owned */
};

/* Tries each folder of the bundle, the shallowest first, and there each source in the order of the table. `wanted`:
 * only the match whose file has this path; NULL: the first. The result is the caller's (source_match_release). */
struct source_match sources_find(const struct listing *l, const char *wanted);
void source_match_release(struct source_match *match);

/* Reads JSON of the form of transforms.json under any name. */
extern const struct source source_nerfstudio;

/* By position in the table, for tests; NULL behind the last. */
const struct source *sources_get(size_t index);

#endif
