/* sun_seen.c -- see sun_seen.h. */
#include "server/light/sun/sun_seen.h"

#include <math.h>

#include "common/mem.h"
#include "common/quantile.h"
#include "server/scene/latlong.h"

/* Half the angle of the widest disc: the sun's aureole in haze; what is wider is a sky. */
#define WIDEST_DEGREES 3.0
/* Least part of the map's light; what brings less has no visible shadows. Of a uniform sky the widest disc brings
 * that if it is 30 times as bright; the sun is 100,000 times as bright as a clear sky, 100 times through thin
 * clouds. */
#define MIN_SHARE 0.02
/* Median standard deviation of log radiance among photographs of a direction, beyond which the map shows what is near:
 * exposures and vignettes leave .05, radiances in a room have 1; as likely by either. */
#define MOST_SPREAD 0.12
/* Photographs and map spread the disc over so many pixels of the map beyond its edge: the width of a bilinear pixel,
 * twice. What is around it lies as far away again. */
#define BLUR_PIXELS 2.0

struct seen_sun {
    const struct environment *e;
    vec3 middle;
    double radius_rad, reach_rad, ring_rad; /* of the disc, of what it is spread over, of what is around it */
    rgb around;
};

static bool is_measured(const struct environment *e, size_t pixel) {
    return environment_pixel_is_seen(e, pixel) && !e->is_bound[pixel];
}

static double angle_between(vec3 a, vec3 b) { return 2.0 * asin(fmin(0.5 * (double)vec3_length(vec3_sub(a, b)), 1.0)); }

static size_t brightest_pixel(const struct environment *e) {
    size_t best = 0;
    for (size_t i = 1; i < environment_pixel_count(e); i++) {
        if (environment_pixel_is_seen(e, i) &&
            rgb_mean(environment_pixel_radiance(e, i)) > rgb_mean(environment_pixel_radiance(e, best)))
            best = i;
    }
    return best;
}

/* The disc: pixels of half the greatest radiance about the brightest one. */
static void find_disc(struct seen_sun *s, size_t brightest) {
    const struct environment *e = s->e;
    float half = 0.5f * rgb_mean(environment_pixel_radiance(e, brightest));
    vec3 from = environment_pixel_direction(e, brightest), sum = {0.0f, 0.0f, 0.0f};
    double angle = 0.0, pixel_rad = PI / (double)(e->map.height - 1);
    for (size_t i = 0; i < environment_pixel_count(e); i++) {
        vec3 d = environment_pixel_direction(e, i);
        if (!(rgb_mean(environment_pixel_radiance(e, i)) > half) ||
            angle_between(d, from) > 2.0 * WIDEST_DEGREES * PI / 180.0)
            continue;
        double part = environment_cell_angle(e, i / e->map.width);
        angle += part;
        sum = vec3_mad(sum, (float)part, d);
    }
    s->middle = vec3_normalize(sum);
    s->radius_rad = sqrt(angle / PI);
    s->reach_rad = s->radius_rad + BLUR_PIXELS * pixel_rad;
    s->ring_rad = s->reach_rad + BLUR_PIXELS * pixel_rad;
}

/* Whether all of the disc, and what it is spread over, is seen; *is_clipped: not all of it is measured. */
static bool is_whole(const struct seen_sun *s, bool *is_clipped) {
    *is_clipped = false;
    for (size_t i = 0; i < environment_pixel_count(s->e); i++) {
        if (angle_between(environment_pixel_direction(s->e, i), s->middle) >= s->reach_rad)
            continue;
        if (!environment_pixel_is_seen(s->e, i))
            return false;
        *is_clipped = *is_clipped || !is_measured(s->e, i);
    }
    return true;
}

/* Medians of the measured pixels around it; false: there are none. */
static bool find_around(struct seen_sun *s) {
    float *value = mem_array(environment_pixel_count(s->e), sizeof *value);
    size_t count = 0;
    for (int c = 0; c < 3; c++) {
        count = 0;
        for (size_t i = 0; i < environment_pixel_count(s->e); i++) {
            double off = angle_between(environment_pixel_direction(s->e, i), s->middle);
            if (is_measured(s->e, i) && off >= s->reach_rad && off < s->ring_rad)
                value[count++] = s->e->map.pixel[3 * i + (size_t)c];
        }
        (&s->around.r)[c] = count > 0 ? quantile(value, count, 0.5) : 0.0f;
    }
    mem_free(value);
    return count > 0;
}

/* Irradiance, on a surface that faces it, beyond what is around it; with `e`, the map that it is in, also gives its
 * pixels that. */
static rgb take_excess(const struct seen_sun *s, struct environment *e) {
    rgb sum = rgb_gray(0.0f);
    for (size_t i = 0; i < environment_pixel_count(s->e); i++) {
        rgb excess = rgb_clamp(rgb_sub(environment_pixel_radiance(s->e, i), s->around), 0.0f, INFINITY);
        if (!(angle_between(environment_pixel_direction(s->e, i), s->middle) < s->reach_rad))
            continue;
        sum = rgb_add(sum, rgb_scale(excess, (float)environment_cell_angle(s->e, i / s->e->map.width)));
        for (size_t c = 0; c < 3 && e; c++)
            e->map.pixel[3 * i + c] -= (&excess.r)[c];
        if (e)
            e->is_bound[i] = false;
    }
    return sum;
}

bool sun_seen_take(struct environment *e, struct sun *sun) {
    struct seen_sun s = {.e = e};
    bool is_clipped;
    if (!e->map.pixel || e->median_spread > MOST_SPREAD)
        return false;
    size_t brightest = brightest_pixel(e);
    find_disc(&s, brightest);
    if (!(rgb_mean(environment_pixel_radiance(e, brightest)) > 0.0f) || s.radius_rad > WIDEST_DEGREES * PI / 180.0 ||
        !is_whole(&s, &is_clipped) || !find_around(&s) || (is_clipped && s.middle.y < 0.0f))
        return false;
    rgb irradiance = take_excess(&s, NULL);
    if (!is_clipped && (double)rgb_luminance(irradiance) < MIN_SHARE * 4.0 * PI * e->luminance)
        return false;
    take_excess(&s, e);
    environment_update_figures(e);
    *sun = (struct sun){.is_there = true,
                        .is_measured = !is_clipped,
                        .is_clipped = is_clipped,
                        .direction = s.middle,
                        .radius_rad = is_clipped ? fminf((float)s.radius_rad, SUN_RADIUS_RAD) : (float)s.radius_rad,
                        .irradiance = irradiance,
                        .least = irradiance};
    return true;
}
