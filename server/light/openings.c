/* openings.c -- see openings.h. */
#include "server/light/openings.h"

#include <math.h>
#include <stdlib.h>

#include "common/mem.h"
#include "server/light/emitters.h"
#include "server/light/light_model.h"
#include "server/light/sky/unseen_light.h"

/* Standard deviations by which an opening is brighter than the mean of its prior. */
#define SURE 2.0
#define MAX_NAMED (1 << 20) /* ids from there on get no name: there is an array of them */

struct opening_candidate {
    size_t cell;
    double radiance, error; /* and the standard deviation of its logarithm */
};

static int by_error(const void *a, const void *b) {
    const struct opening_candidate *first = a, *second = b;
    if (first->error != second->error)
        return first->error < second->error ? -1 : 1;
    return (first->cell > second->cell) - (first->cell < second->cell);
}

/* The cells that are surely brighter than the mean of their prior; the surest ones first. */
static size_t choose(struct light_model *m, struct opening_candidate chosen[SURROUND_CELLS]) {
    size_t count = 0;
    light_model_find_errors(m);
    for (size_t k = 0; k < SURROUND_CELLS && m->has_sky; k++) {
        const struct joint_source *source = &m->fit.source[m->first_cell + k];
        if (!m->sky.surround->is_seen[k] && source->value - source->mean > SURE * source->error)
            chosen[count++] = (struct opening_candidate){k, exp(source->value), source->error};
    }
    qsort(chosen, count, sizeof *chosen, by_error);
    return count < LIGHT_OPENINGS_MAX ? count : LIGHT_OPENINGS_MAX;
}

/* --- surface ----------------------------------------------------------------------------------------------- */

static void reserve(struct mesh *mesh, struct segments *segments, size_t cells) {
    size_t triangles = mesh->triangle_count + 2 * cells;
    mesh_reserve(mesh, 4 * cells, 2 * cells);
    segments->of_triangle = mem_realloc_array(segments->of_triangle, triangles, sizeof *segments->of_triangle);
    segments->id = mem_realloc_array(segments->id, segments->count + cells, sizeof *segments->id);
}

static void add_vertices(struct mesh *mesh, const vec3 corner[4]) {
    vec3 normal = vec3_normalize(vec3_cross(vec3_sub(corner[1], corner[0]), vec3_sub(corner[2], corner[0])));
    for (size_t k = 0; k < 4; k++) {
        mesh->position[mesh->vertex_count] = corner[k];
        if (mesh->normal)
            mesh->normal[mesh->vertex_count] = normal;
        mesh->vertex_count++;
    }
}

/* Adds a cell as a segment of that id. */
static void add_cell(struct mesh *mesh, struct segments *segments, const vec3 corner[4], int64_t id) {
    uint32_t first = (uint32_t)mesh->vertex_count;
    add_vertices(mesh, corner);
    for (uint32_t k = 0; k < 2; k++) {
        size_t t = mesh->triangle_count++;
        mesh->index[t][0] = first;
        mesh->index[t][1] = first + 1 + k;
        mesh->index[t][2] = first + 2 + k;
        mesh->face[t] = MESH_NO_FACE;
        if (mesh->object_id)
            mesh->object_id[t] = id;
        for (int c = 0; c < 3 && mesh->uv; c++)
            mesh->uv[t][c] = (vec2){NAN, NAN};
        segments->of_triangle[t] = (uint32_t)segments->count;
    }
    segments->id[segments->count++] = id;
}

/* Calls an id an opening, all of which have one name, by which they can be taken away; where names are kept by id: of
 * the segments, or of the input's objects. */
static void name_opening(struct mesh *mesh, struct segments *segments, int64_t id) {
    char ***name = segments->is_given ? &mesh->name : &segments->name;
    size_t *count = segments->is_given ? &mesh->name_count : &segments->name_count;
    if (id >= MAX_NAMED)
        return;
    if ((size_t)id >= *count)
        *name = mem_realloc_array(*name, (size_t)id + 1, sizeof **name);
    for (; *count <= (size_t)id; ++*count)
        (*name)[*count] = segments->is_given ? mem_strdup("") : NULL; /* what those without a name have */
    mem_free((*name)[id]);
    (*name)[id] = mem_strdup("opening");
}

/* Adds a cell as a segment, the last one; returns its number. */
static uint32_t add_segment(struct reconstruction *r, const struct surround *s, size_t cell) {
    struct segments *segments = &r->segments;
    int64_t id = -1;
    vec3 corner[4];
    for (size_t i = 0; i < segments->count; i++)
        id = segments->id[i] > id ? segments->id[i] : id;
    reserve(&r->scene->mesh, segments, 1);
    surround_corners(s, cell, corner);
    add_cell(&r->scene->mesh, segments, corner, id + 1);
    name_opening(&r->scene->mesh, segments, id + 1);
    return (uint32_t)segments->count - 1;
}

/* Adds what photographs look at, and then the openings; returns the number of cells. */
static size_t add_surface(struct reconstruction *r, const struct surround *s, const struct opening_candidate *chosen,
                          size_t count) {
    size_t seen = 0;
    for (size_t k = 0; k < SURROUND_CELLS; k++) {
        if (s->is_seen[k])
            add_segment(r, s, k), seen++;
    }
    for (size_t i = 0; i < count; i++) {
        rgb radiance = rgb_gray((float)chosen[i].radiance);
        uint32_t segment = add_segment(r, s, chosen[i].cell);
        r->light.source[r->light.source_count++] =
            (struct estimated_source){ESTIMATED_OPENING, segment, radiance, (float)chosen[i].error};
    }
    r->opening_count = count;
    return seen + count;
}

/* --- the whole --------------------------------------------------------------------------------------------- */

/* Part of the points' rays that leave the room where nothing is known. */
static double escaping_share(const struct light_points *points) {
    double sum = 0.0;
    for (size_t i = 0; i < points->count; i++)
        sum += (double)points->point[i].escaping;
    return sum / fmax((double)points->count, 1.0);
}

size_t openings_find(struct reconstruction *r, const struct views *views) {
    struct light_model m;
    struct surround surround;
    struct opening_candidate chosen[SURROUND_CELLS];
    if (!r->is_surrounded)
        return 0;
    surround_init(&surround, views);
    emitters_observe(r, views, r->evidence);
    light_model_init(&m, r, views, false);
    m.sky.surround = &surround;
    light_model_survey(&m, views, NULL, NULL);
    r->is_surrounded = escaping_share(&m.points) <= UNSEEN_LIGHT_MOSTLY;
    if (!r->is_surrounded) {
        light_model_release(&m);
        return 0;
    }
    joint_fit_solve(&m.fit);
    size_t count = choose(&m, chosen);
    light_model_release(&m);
    environment_release(&r->environment);
    world_set_environment(&r->world, NULL, r->pool);
    return add_surface(r, &surround, chosen, count);
}
