/* seen_share.c -- see seen_share.h. */
#include "server/capture/seen_share.h"

#include <math.h>
#include <stdio.h>

#include "common/mem.h"
#include "common/rng.h"

#define OPEN_MOST 0.5 /* share of the pixels beyond which the poses are suspected rather than the mesh; by hand */

struct seen_job {
    const struct views *views;
    const double *area_until; /* [triangle_count] sum of the triangles' areas up to this one */
    bool *is_seen;            /* [SEEN_SHARE_POINTS] */
};

/* The triangle that holds this much of the area. */
static size_t triangle_at(const double *area_until, size_t count, double area) {
    size_t low = 0, high = count - 1;
    while (low < high) {
        size_t middle = (low + high) / 2;
        if (area_until[middle] > area)
            high = middle;
        else
            low = middle + 1;
    }
    return low;
}

static void look(void *user, size_t number, int thread) {
    const struct seen_job *job = user;
    const struct mesh *mesh = &job->views->scene->mesh;
    uint64_t bits = rng_key(0x5ee5, number, 0);
    double total = job->area_until[mesh->triangle_count - 1];
    size_t t = triangle_at(job->area_until, mesh->triangle_count,
                           total * ((double)number + (double)rng_to_float((uint32_t)bits)) / SEEN_SHARE_POINTS);
    float root = sqrtf(rng_to_float((uint32_t)(bits >> 32))), v = rng_to_float(rng_mix32((uint32_t)(bits >> 16)));
    vec3 point = mesh_point(mesh, t, root * (1.0f - v), root * v);
    vec3 normal = vec3_normalize(mesh_cross(mesh, t));
    (void)thread;
    for (uint32_t i = 0; i < job->views->train_count && !job->is_seen[number]; i++) {
        struct view view;
        job->is_seen[number] = views_sees(job->views, i, point, normal, &view);
    }
}

static double open_share(const struct views *views) {
    double open = 0.0, all = 0.0;
    for (size_t i = 0; i < views->train_count; i++) {
        const struct camera *camera = &views->scene->photograph[views->train[i]].camera;
        size_t count = (size_t)camera->width * camera->height;
        for (size_t k = 0; k < count; k++)
            open += views->shows[i][k] == VIEWS_OPEN;
        all += (double)count;
    }
    return all > 0.0 ? open / all : 0.0;
}

struct seen_share seen_share_measure(const struct views *views, struct parallel *pool) {
    const struct mesh *mesh = &views->scene->mesh;
    struct seen_job job = {.views = views, .is_seen = mem_calloc(SEEN_SHARE_POINTS, sizeof *job.is_seen)};
    double *area_until = mem_array(mesh->triangle_count, sizeof *area_until), sum = 0.0;
    size_t seen = 0;
    for (size_t t = 0; t < mesh->triangle_count; t++)
        area_until[t] = sum += 0.5 * (double)vec3_length(mesh_cross(mesh, t));
    job.area_until = area_until;
    parallel_for(pool, SEEN_SHARE_POINTS, look, &job);
    for (size_t i = 0; i < SEEN_SHARE_POINTS; i++)
        seen += job.is_seen[i];
    mem_free(area_until);
    mem_free(job.is_seen);
    return (struct seen_share){(double)seen / SEEN_SHARE_POINTS, open_share(views)};
}

enum status seen_share_require(const struct seen_share *share, bool ignored, struct error *err) {
    if (share->surface >= SEEN_SHARE_LEAST || (ignored && share->surface > 0.0))
        return STATUS_OK;
    char part[32] = "nothing";
    if (share->surface > 0.0)
        snprintf(part, sizeof part, "only %.2g %%", 100.0 * share->surface);
    error_set(err, STATUS_INPUT,
              "the photographs see %s of the mesh's surface, and nothing else can be measured; %.0f %% of their pixels "
              "meet no surface",
              part, 100.0 * share->open);
    const char *anyway = share->surface > 0.0 ? "; fit=ignore reconstructs all the same" : "";
    if (share->open > OPEN_MOST)
        return error_hint(err, "poses and mesh are likely of two places, axes or units: `unbake check` compares them%s",
                          anyway);
    return error_hint(err,
                      "the mesh is much larger than what was photographed (crop keeps a part of it), or poses and "
                      "mesh do not fit (`unbake check`)%s",
                      anyway);
}
