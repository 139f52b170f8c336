/* sources.c -- see sources.h. To add a source, write its file and its line here. */
#include "server/ingest/source/sources.h"

#include <string.h>

#include "common/mem.h"

/* In order of precedence: what somebody made for radiance fields comes before what the capture was made from. */
#define SOURCES(ADD)                                                                                                   \
    ADD(source_nerfstudio)                                                                                             \
    ADD(source_colmap)                                                                                                 \
    ADD(source_niceslam)                                                                                               \
    ADD(source_scannet)

#define DECLARE(name) extern const struct source name;
SOURCES(DECLARE)
#define ADDRESS(name) &name,
static const struct source *const table[] = {SOURCES(ADDRESS)};

const struct source *sources_get(size_t index) { return index < sizeof table / sizeof *table ? table[index] : NULL; }

struct source_match sources_find(const struct listing *l, const char *wanted) {
    for (size_t i = 0; i < l->folder_count; i++) {
        const char *base = l->folder[i];
        for (size_t k = 0; k < sizeof table / sizeof *table; k++) {
            char *found = table[k]->recognise(l, base);
            if (found && (!wanted || strcmp(found, wanted) == 0))
                return (struct source_match){table[k], mem_strdup(base), found};
            mem_free(found);
        }
    }
    return (struct source_match){0};
}

void source_match_release(struct source_match *match) {
    mem_free(match->base);
    mem_free(match->found);
    *match = (struct source_match){0};
}
