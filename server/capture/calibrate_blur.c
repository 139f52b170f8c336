/* calibrate_blur.c -- see calibrate_blur.h. */
#include "server/capture/calibrate_blur.h"

#include <math.h>
#include <stdlib.h>

#include "common/mem.h"

/* That show a track: the least number of which the median of the others is no single photograph. */
#define MIN_PHOTOGRAPHS 4 /* +25 %: no change */
/* Of tracks, for a photograph to be judged: a mean of 60 squares of about normal slopes is off by .18 (sqrt(2 /
 * 60)), the ratio of two by a quarter. */
#define MIN_OBSERVATIONS 60 /* +25 %: no change */
/* Standard deviation of a sharp photograph's blur at level 0, pixels of that level: pixel area, lens and the pyramid's
 * binomial. */
#define SHARP_PX 0.9 /* +25 %: no change */
/* Blurred: the squared slopes are below this share of the neighbours'. Sharp photographs have 0.6 and more, single ones
 * of glossy places seen from afar 0.39 (room bathroom). */
#define BLURRED_RATIO 0.38 /* +25 %: no change */
/* Bound of one observation's squared slope over the median: twice the slope. */
#define RATIO_MAX 4.0f /* +25 %: no change */

/* Sums over one photograph's observations, for each direction: its own squared slopes and the medians of the others. */
struct sharpness {
    double sum[2], median[2];
    size_t count;
};

/* Squared slopes along the track's two directions, at the pixel scale of the track's own photograph; false where
 * unknown. A photograph from farther away shows an edge wider on the surface but smooth texture unchanged: half of that
 * difference is compensated. */
static bool slopes_of(const struct tracks *tracks, size_t frame, const struct track *track, float step,
                      float slope[2]) {
    const struct views *views = tracks->views;
    const struct camera *camera = &views->scene->photograph[views->train[frame]].camera;
    const vec3 direction[2] = {track->right, track->down};
    float distance = vec3_length(vec3_sub(camera_origin(camera), track->point));
    for (int k = 0; k < 2; k++) {
        float value[2];
        for (int side = 0; side < 2; side++) {
            float x, y, depth_m;
            vec3 point = vec3_mad(track->point, side ? step : -step, direction[k]);
            if (!camera_project(camera, point, &x, &y, &depth_m))
                return false;
            value[side] = pyramid_value(&tracks->pyramid[frame], 0, x, y);
        }
        slope[k] = (value[1] - value[0]) * (value[1] - value[0]) *
                   sqrtf(distance / (camera->fx * tracks->pyramid[frame].scale));
    }
    return isfinite(slope[0]) && isfinite(slope[1]);
}

static int compare_floats(const void *a, const void *b) {
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

static float median_of(float *value, size_t count) {
    qsort(value, count, sizeof *value, compare_floats);
    return count % 2 ? value[count / 2] : 0.5f * (value[count / 2 - 1] + value[count / 2]);
}

/* Compares the other photographs of a track with each other. */
static void compare_others(const struct tracks *tracks, const struct track *track, float step,
                           struct sharpness *sharpness) {
    float slope[TRACK_OTHERS][2];
    uint32_t frame[TRACK_OTHERS];
    size_t known = 0;
    for (size_t k = 0; k < track->other_count; k++) {
        frame[known] = track->other[k];
        known += slopes_of(tracks, track->other[k], track, step, slope[known]);
    }
    for (size_t k = 0; k < known && known >= MIN_PHOTOGRAPHS; k++) {
        struct sharpness *s = &sharpness[frame[k]];
        s->count++;
        for (int d = 0; d < 2; d++) {
            float other[TRACK_OTHERS];
            size_t count = 0;
            for (size_t i = 0; i < known; i++) {
                if (i != k)
                    other[count++] = slope[i][d];
            }
            float median = median_of(other, count);
            s->median[d] += (double)median;
            s->sum[d] += (double)fminf(slope[k][d], RATIO_MAX * median);
        }
    }
}

void calibrate_blur(struct scene *scene, const struct tracks *tracks, struct blur_found *found) {
    const struct views *views = tracks->views;
    size_t frames = views->train_count;
    struct sharpness *sharpness = mem_calloc(frames + 1, sizeof *sharpness);
    float *blur = mem_array(frames + 1, sizeof *blur);
    for (size_t f = 0; f < frames; f++) {
        for (size_t i = 0; i < tracks->count[f]; i++)
            compare_others(tracks, &tracks->track[f * tracks->capacity + i], 0.5f / tracks->pyramid[f].scale,
                           sharpness);
    }
    *found = (struct blur_found){0};
    for (size_t f = 0; f < frames; f++) {
        const struct sharpness *s = &sharpness[f];
        double ratio = 1.0;
        for (int d = 0; d < 2 && s->count >= MIN_OBSERVATIONS; d++)
            ratio = fmin(ratio, s->median[d] > 0.0 ? s->sum[d] / s->median[d] : 1.0);
        if (ratio >= BLURRED_RATIO)
            continue;
        double width = SHARP_PX * sqrt(1.0 / (ratio * ratio) - 1.0) / (double)tracks->pyramid[f].scale;
        scene->photograph[views->train[f]].blur_px = (float)width;
        blur[found->blurred_count++] = (float)width;
    }
    found->blur_px = found->blurred_count ? (double)median_of(blur, found->blurred_count) : 0.0;
    mem_free(blur);
    mem_free(sharpness);
}
