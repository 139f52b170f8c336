/* unseen_lamps.c -- see unseen_lamps.h. */
#include "server/light/unseen_lamps.h"

#include "common/mem.h"
#include "server/light/added_surface.h"
#include "server/light/emitters.h"
#include "server/light/hidden_lamps.h"
#include "server/scene/adjacency.h"

/* Parts of the border that are lamps; their number is the result. */
static size_t choose(struct reconstruction *r, const struct views *views, const struct unseen_space *space,
                     uint32_t part[LIGHT_MAX]) {
    struct light_model m;
    emitters_observe(r, views, r->evidence);
    light_model_init(&m, r, views, false);
    light_model_survey(&m, views, NULL, NULL);
    joint_fit_solve(&m.fit);
    size_t count = hidden_lamps_find_parts(&m, space, part);
    light_model_release(&m);
    return count;
}

static bool is_closed(const struct mesh *mesh) {
    struct adjacency adjacency;
    adjacency_make(&adjacency, mesh);
    bool closed = adjacency_is_closed(&adjacency, mesh);
    adjacency_release(&adjacency);
    return closed;
}

/* Returns the number of quads. */
static size_t add_part(struct reconstruction *r, const struct unseen_space *space, const struct unseen_part *part) {
    size_t faces = part->end - part->first;
    vec3(*corner)[4] = mem_array(faces, sizeof *corner);
    for (size_t i = 0; i < faces; i++)
        unseen_space_corners(space, &space->face[part->first + i], corner[i]);
    added_surface_segment(r, "hidden lamp", (const vec3(*)[4])corner, faces);
    mem_free(corner);
    return faces;
}

size_t unseen_lamps_find(struct reconstruction *r, const struct views *views) {
    struct unseen_space space;
    uint32_t part[LIGHT_MAX];
    size_t quads = 0;
    if (r->scene->mesh.object_id || settings_is(r->settings, "holes", "keep") || is_closed(&r->scene->mesh))
        return 0;
    unseen_space_find(&space, views, r->pool);
    size_t count = space.part_count > 0 ? choose(r, views, &space, part) : 0;
    r->unseen_lamps = (struct segment_range){r->segments.count, count};
    for (size_t i = 0; i < count; i++)
        quads += add_part(r, &space, &space.part[part[i]]);
    unseen_space_release(&space);
    return quads;
}
