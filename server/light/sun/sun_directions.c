/* sun_directions.c -- see sun_directions.h. */
#include "server/light/sun/sun_directions.h"

#include <math.h>
#include <stdlib.h>

#include "common/mem.h"
#include "server/render/bsdf.h"
#include "server/scene/latlong.h"

#define APART_DEGREES 3.0
#define STEPS 24 /* to better directions, or to smaller steps */

size_t sun_directions_spread(const struct environment *environment,
                             bool (*is_known)(const struct environment *environment, vec3 direction),
                             struct sun_candidate **candidate) {
    size_t rows = (size_t)(180.0 / APART_DEGREES), count = 0;
    *candidate = mem_array(2 * rows * rows, sizeof **candidate);
    for (size_t row = 0; row < rows; row++) {
        double down = ((double)row + 0.5) / (double)rows;
        size_t columns = (size_t)ceil(2.0 * (double)rows * sin(PI * down));
        for (size_t column = 0; column < columns; column++) {
            vec3 d = latlong_direction(((double)column + 0.5) / (double)columns, down);
            if (!is_known || !environment->map.pixel || !is_known(environment, d))
                (*candidate)[count++] = (struct sun_candidate){d, 0.0};
        }
    }
    return count;
}

static int by_score(const void *a, const void *b) {
    const struct sun_candidate *first = a, *second = b;
    return (first->score < second->score) - (first->score > second->score);
}

void sun_directions_sort(struct sun_candidate *candidate, size_t count) {
    qsort(candidate, count, sizeof *candidate, by_score);
}

void sun_directions_walk(struct sun_candidate *candidate, double degrees, double least_degrees,
                         double (*score_of)(void *user, vec3 direction), void *user) {
    for (int i = 0; i < STEPS && degrees >= least_degrees; i++) {
        bool moved = false;
        vec3 middle = candidate->direction, across, up;
        float step = (float)tan(degrees * PI / 180.0);
        vec3_frame(middle, &across, &up);
        for (int k = 0; k < 8; k++) {
            float angle = (float)k * 0.25f * BSDF_PI;
            vec3 d = vec3_mad(vec3_mad(middle, step * cosf(angle), across), step * sinf(angle), up);
            struct sun_candidate other = {vec3_normalize(d), 0.0};
            other.score = score_of(user, other.direction);
            if (other.score > candidate->score)
                *candidate = other, moved = true;
        }
        if (!moved)
            degrees *= 0.5;
    }
}
