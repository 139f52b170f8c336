/* picture.c -- see picture.h. Rounds of paths are independent renders; the picture is their mean by number of paths. */
#include "server/relight/picture.h"

#include <math.h>

#include "common/clock.h"
#include "common/vec.h"
#include "server/render/film.h"

/* A round: so many paths that stopping and looking cost little, and so few that they are soon done. */
#define ROUND_PATHS 4e6
#define FIRST_PATHS 1e6 /* of the first round, which is the first preview */
#define ROUND_MIN_SPP 4 /* FILM_GROUPS: there are standard errors */
#define ROUND_MAX_SPP 64

static uint32_t round_spp(const struct camera *camera, uint32_t done, uint32_t most) {
    double spp = (done > 0 ? ROUND_PATHS : FIRST_PATHS) / ((double)camera->width * camera->height);
    uint32_t wanted = spp < ROUND_MAX_SPP ? (uint32_t)spp : ROUND_MAX_SPP;
    wanted = wanted / FILM_GROUPS * FILM_GROUPS;
    wanted = wanted > ROUND_MIN_SPP ? wanted : ROUND_MIN_SPP;
    return wanted < most - done ? wanted : most - done;
}

/* Adds a round to the weighted sum of radiance and direct, and to the mean square of its standard error. */
static void add_round(struct image *sum, double *variance, const struct image *film, double weight) {
    size_t count = (size_t)film->width * film->height;
    for (size_t i = 0; i < count; i++) {
        const float *from = film->pixel + i * film->channel_count;
        float *to = sum->pixel + i * sum->channel_count;
        for (uint32_t c = 0; c < sum->channel_count; c++)
            to[c] += (float)weight * from[c < 3 ? c : c + 3];
        double error = (double)rgb_luminance(rgb_make(from[3], from[4], from[5]));
        *variance += weight * weight * error * error / (double)count;
    }
}

static double noise_of(const struct image *sum, double variance) {
    double mean = 0.0;
    size_t count = (size_t)sum->width * sum->height;
    for (size_t i = 0; i < count; i++) {
        const float *p = sum->pixel + i * sum->channel_count;
        mean += (double)rgb_luminance(rgb_make(p[0], p[1], p[2])) / (double)count;
    }
    return mean > 0.0 ? sqrt(variance) / mean : 0.0;
}

static void divide(struct image *image, double by) {
    for (size_t i = 0; i < (size_t)image->width * image->height * image->channel_count; i++)
        image->pixel[i] = (float)((double)image->pixel[i] / by);
}

/* What has been rendered so far, for whoever looks on. */
static bool show(picture_round *round, void *user, const struct image *sum, struct picture_quality quality) {
    struct image mean;
    if (!round)
        return true;
    image_init(&mean, sum->width, sum->height, sum->channel_count,
               (const char *const[]){"R", "G", "B", "direct.R", "direct.G", "direct.B"});
    for (size_t i = 0; i < (size_t)sum->width * sum->height * sum->channel_count; i++)
        mean.pixel[i] = sum->pixel[i] / (float)quality.spp;
    bool goes_on = round(user, &mean, quality);
    image_release(&mean);
    return goes_on;
}

enum status picture_render(const struct world *world, const struct camera *camera, const struct path_settings *settings,
                           const struct picture_goal *goal, bool has_direct, picture_round *round, void *user,
                           struct parallel *pool, struct image *image, struct picture_quality *quality,
                           struct error *err) {
    static const char *const names[] = {"R", "G", "B", "direct.R", "direct.G", "direct.B"};
    uint32_t most = (goal->max_spp + FILM_GROUPS - 1) / FILM_GROUPS * FILM_GROUPS;
    double start = clock_sec(), variance = 0.0;
    *quality = (struct picture_quality){0};
    image_init(image, camera->width, camera->height, has_direct ? 6 : 3, names);
    for (uint32_t r = 0; quality->spp < most; r++) {
        struct image film;
        uint32_t spp = round_spp(camera, quality->spp, most);
        (has_direct ? film_render_direct : film_render)(world, camera, spp, settings, r, pool, &film);
        add_round(image, &variance, &film, spp);
        image_release(&film);
        quality->spp += spp;
        quality->noise = noise_of(image, variance);
        if (!show(round, user, image, *quality)) {
            image_release(image);
            return error_set(err, STATUS_CANCELLED, "the render was stopped");
        }
        if ((goal->noise > 0.0 && quality->noise <= goal->noise) ||
            (goal->seconds > 0.0 && clock_sec() - start >= goal->seconds))
            break;
    }
    divide(image, quality->spp);
    return STATUS_OK;
}
