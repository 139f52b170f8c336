/* relit.h -- the room of a reconstruction as a render sees it: with other light, objects taken away, changed and
 * added. */
#ifndef UNBAKE_RELIGHT_RELIT_H
#define UNBAKE_RELIGHT_RELIT_H

#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "common/parallel.h"
#include "server/relight/cameras.h"
#include "server/relight/relight_job.h"
#include "server/relight/sky.h"
#include "server/render/world.h"

/* What shines: a segment of the room, an object that was added, or distant light. */
struct relit_source {
    char *name;       /* "light_27", "lamp_1", "insert_2", "insert_2_0" (its first material), "sky", "sun"; owned */
    uint32_t segment; /* or LIGHT_ENVIRONMENT */
    enum distant_part part; /* of distant light */
};

struct relit {
    struct mesh mesh;
    struct segments segments; /* those of the outputs, then one for each material of an object; no names */
    struct atlas atlas;       /* no charts: corners only */
    struct materials materials;
    struct world world;
    rgb *emission;                         /* [segments.count] with all sources; owned */
    struct image distant[DISTANT_SUN + 1]; /* distant light, where there is any; its parts only with per_light */
    size_t source_count;
    size_t note_count;
    char **note;                 /* [note_count] what of inserted files is not rendered, as sentences; owned */
    struct relit_source *source; /* [source_count]; sky and sun are the last; owned */
};

/* `mesh`, the outputs' own, is taken over. The environment is that of sun 0. */
enum status relit_make(const struct relight_job *job, struct mesh *mesh, const struct compass *compass,
                       struct parallel *pool, struct relit *relit, struct error *err);
void relit_release(struct relit *relit);

/* Changes distant light to that of another sun. */
enum status relit_set_sun(struct relit *relit, const struct relight_job *job, const struct compass *compass,
                          uint32_t sun, struct parallel *pool, struct error *err);

/* Leaves one source shining; RELIT_ALL: all of them. */
#define RELIT_ALL SIZE_MAX
void relit_light(struct relit *relit, size_t source, struct parallel *pool);

#endif
