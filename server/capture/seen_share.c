/* seen_share.c -- see seen_share.h. */
#include "server/capture/seen_share.h"

#include <stdio.h>

#include "common/mem.h"
#include "server/scene/area_sample.h"

/* Share of the pixels that meet no surface beyond which the message names the poses rather than the mesh: of a scanned
 * room, even with its windows, less than half lies outside. Chooses words only. */
#define OPEN_MAX 0.5 /* +25 %: no change */

struct seen_job {
    const struct views *views;
    struct area_sampler sampler;
    bool *is_seen; /* [SEEN_SHARE_POINTS] */
};

static void look(void *user, size_t number, int thread) {
    const struct seen_job *job = user;
    vec3 point, normal;
    area_sampler_point(&job->sampler, 0x5ee5, number, SEEN_SHARE_POINTS, &point, &normal);
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
        views_use(views, (uint32_t)i, 0, count);
        for (size_t k = 0; k < count; k++)
            open += views->shows[i][k] == VIEWS_OPEN;
        all += (double)count;
    }
    return all > 0.0 ? open / all : 0.0;
}

struct seen_share seen_share_measure(const struct views *views, struct parallel *pool) {
    struct seen_job job = {.views = views, .is_seen = mem_calloc(SEEN_SHARE_POINTS, sizeof *job.is_seen)};
    size_t seen = 0;
    area_sampler_init(&job.sampler, &views->scene->mesh);
    parallel_for(pool, SEEN_SHARE_POINTS, look, &job);
    for (size_t i = 0; i < SEEN_SHARE_POINTS; i++)
        seen += job.is_seen[i];
    area_sampler_release(&job.sampler);
    mem_free(job.is_seen);
    return (struct seen_share){(double)seen / SEEN_SHARE_POINTS, open_share(views)};
}

enum status seen_share_require(const struct seen_share *share, bool ignored, struct error *err) {
    if (share->surface >= SEEN_SHARE_MIN || (ignored && share->surface > 0.0))
        return STATUS_OK;
    char part[32] = "nothing";
    if (share->surface > 0.0)
        snprintf(part, sizeof part, "only %.2g %%", 100.0 * share->surface);
    error_set(err, STATUS_INPUT,
              "the photographs see %s of the mesh's surface, and nothing else can be measured; %.0f %% of their pixels "
              "meet no surface",
              part, 100.0 * share->open);
    const char *anyway = share->surface > 0.0 ? "; fit=ignore reconstructs all the same" : "";
    if (share->open > OPEN_MAX)
        return error_hint(err, "poses and mesh are likely of two places, axes or units: `unbake check` compares them%s",
                          anyway);
    return error_hint(err,
                      "the mesh is much larger than what was photographed (crop keeps a part of it), or poses and "
                      "mesh do not fit (`unbake check`)%s",
                      anyway);
}
