/* sources.c -- see sources.h. To add a source, write its file and its line here. */
#include "server/ingest/source/sources.h"

#include <string.h>

#include "common/mem.h"

/* In order of precedence: what somebody made for radiance fields comes before what the capture was made from. */
#define SOURCES(ADD)                                                                                                   \
    ADD(source_scannetpp)                                                                                              \
    ADD(source_nerfstudio)                                                                                             \
    ADD(source_nerf_synthetic)                                                                                         \
    ADD(source_colmap)                                                                                                 \
    ADD(source_polycam)                                                                                                \
    ADD(source_record3d)                                                                                               \
    ADD(source_scanner3d)                                                                                              \
    ADD(source_metashape)                                                                                              \
    ADD(source_realitycapture)                                                                                         \
    ADD(source_bundler)                                                                                                \
    ADD(source_openmvg)                                                                                                \
    ADD(source_alicevision)                                                                                            \
    ADD(source_opensfm)                                                                                                \
    ADD(source_niceslam)                                                                                               \
    ADD(source_scannet)                                                                                                \
    ADD(source_arkitscenes)                                                                                            \
    ADD(source_tum)                                                                                                    \
    ADD(source_sevenscenes)                                                                                            \
    ADD(source_matterport)                                                                                             \
    ADD(source_realitycapture_xmp)

#define DECLARE(name) extern const struct source name;
SOURCES(DECLARE)
#define ADDRESS(name) &name,
static const struct source *const table[] = {SOURCES(ADDRESS)};

const struct source *sources_get(size_t index) { return index < sizeof table / sizeof *table ? table[index] : NULL; }

/* Another folder that the source recognises. */
static char *find_other(const struct listing *l, const struct source_match *match) {
    for (size_t i = 0; i < l->folder_count; i++) {
        const char *base = l->folder[i];
        if (strncmp(base, match->base, strlen(match->base)) == 0)
            continue;
        char *found = match->source->recognise(l, base);
        if (found && strcmp(found, match->found) != 0)
            return found;
        mem_free(found);
    }
    return NULL;
}

struct source_match sources_find(const struct listing *l, const char *wanted) {
    for (size_t i = 0; i < l->folder_count; i++) {
        const char *base = l->folder[i];
        for (size_t k = 0; k < sizeof table / sizeof *table; k++) {
            char *found = table[k]->recognise(l, base);
            if (found && (!wanted || strcmp(found, wanted) == 0)) {
                struct source_match match = {table[k], mem_strdup(base), found, NULL};
                match.other = wanted ? NULL : find_other(l, &match);
                return match;
            }
            mem_free(found);
        }
    }
    return (struct source_match){0};
}

void source_match_release(struct source_match *match) {
    mem_free(match->base);
    mem_free(match->found);
    mem_free(match->other);
    *match = (struct source_match){0};
}
