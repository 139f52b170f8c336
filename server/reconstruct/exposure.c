/* exposure.c -- see exposure.h. */
#include "server/reconstruct/exposure.h"

#include <math.h>

#include "common/mem.h"

#define POINT_COUNT 20000
#define VIEWS_PER_POINT 16
#define SWEEP_COUNT 1000
/* Log-radiance difference at which a measurement has half its weight. */
#define OUTLIER_SCALE 0.15

struct overlap {
    uint32_t point, train;
    double value; /* log of the pixel value before the gain */
};

/* Looks at evenly spaced valid texels; fills overlap[] with the points that two or more frames see. */
static size_t gather(const struct views *views, const struct atlas *atlas,
                     const struct inverse_uv *inverse, struct overlap *overlap, size_t *point_count) {
    const struct scene *scene = views->scene;
    size_t count = 0, step = inverse->valid_count / POINT_COUNT + 1;
    *point_count = 0;
    for (size_t i = 0; i < inverse->valid_count && *point_count < POINT_COUNT; i += step) {
        uint32_t texel = inverse->valid[i], triangle;
        float b1, b2;
        if (!inverse_uv_lookup(inverse, atlas, (float)(texel % inverse->width) + 0.5f,
                               (float)(texel / inverse->width) + 0.5f, &triangle, &b1, &b2))
            continue;
        vec3 point = mesh_point(&scene->mesh, triangle, b1, b2);
        vec3 normal = vec3_normalize(mesh_cross(&scene->mesh, triangle));
        struct view view[VIEWS_PER_POINT];
        size_t seen = views_pick(views, point, normal, (uint32_t)i, VIEWS_PER_POINT, view);
        size_t first = count;
        for (size_t k = 0; k < seen; k++) {
            struct photograph_sample sample;
            const struct photograph *photo = &scene->photograph[views->train[view[k].train]];
            if (!photograph_sample(photo, view[k].x, view[k].y, &sample) || sample.saturated[0] ||
                sample.saturated[1] || sample.saturated[2])
                continue;
            /* Values near black are mostly noise and quantisation. */
            double value = (double)rgb_mean(sample.radiance);
            if (!(value > 0.0) || (!photo->is_hdr && value * (double)photo->exposure < 0.01))
                continue;
            overlap[count++] = (struct overlap){(uint32_t)*point_count, view[k].train, log(value)};
        }
        if (count - first >= 2)
            (*point_count)++;
        else
            count = first;
    }
    return count;
}

size_t exposure_solve(struct scene *scene, struct views *views, const struct atlas *atlas,
                      const struct inverse_uv *inverse) {
    size_t unknown = 0, frames = views->train_count;
    for (size_t t = 0; t < frames; t++)
        unknown += !scene->photograph[views->train[t]].exposure_known;
    if (unknown == 0)
        return 0;
    struct overlap *overlap = mem_array((size_t)POINT_COUNT * VIEWS_PER_POINT, sizeof *overlap);
    size_t point_count, count = gather(views, atlas, inverse, overlap, &point_count);
    double *radiance = mem_calloc(point_count + 1, sizeof *radiance);
    double *gain = mem_calloc(frames, sizeof *gain);
    double *sum = mem_array(point_count + frames, sizeof *sum);
    double *weight = mem_array(point_count + frames, sizeof *weight);
    for (int sweep = 0; sweep < SWEEP_COUNT; sweep++) {
        bool points = sweep % 2 == 0;
        size_t slots = points ? point_count : frames;
        for (size_t i = 0; i < slots; i++)
            sum[i] = weight[i] = 0.0;
        for (size_t i = 0; i < count; i++) {
            const struct overlap *o = &overlap[i];
            double error = (o->value - gain[o->train] - radiance[o->point]) / OUTLIER_SCALE;
            double w = sweep < 4 ? 1.0 : 1.0 / (1.0 + error * error);
            size_t slot = points ? o->point : o->train;
            sum[slot] += w * (o->value - (points ? gain[o->train] : radiance[o->point]));
            weight[slot] += w;
        }
        for (size_t i = 0; i < slots; i++) {
            if (weight[i] <= 0.0)
                continue;
            if (points)
                radiance[i] = sum[i] / weight[i];
            else if (!scene->photograph[views->train[i]].exposure_known)
                gain[i] = sum[i] / weight[i];
        }
    }
    double mean = 0.0;
    for (size_t t = 0; t < frames; t++)
        mean += gain[t] / (double)frames;
    for (size_t t = 0; t < frames; t++) {
        struct photograph *photo = &scene->photograph[views->train[t]];
        if (!photo->exposure_known)
            photo->exposure *= (float)exp(gain[t] - (unknown == frames ? mean : 0.0));
    }
    mem_free(weight);
    mem_free(sum);
    mem_free(gain);
    mem_free(radiance);
    mem_free(overlap);
    return unknown;
}
