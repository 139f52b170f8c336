/* held_render.c -- see held_render.h. */
#include "server/reconstruct/held_render.h"

#include <math.h>

#include "server/render/film.h"

void held_render_add(struct held_render *h, const struct world *world, const struct camera *camera, uint32_t spp,
                     const struct path_settings *path, uint32_t iteration, struct parallel *pool) {
    struct image film;
    film_render_halves(world, camera, spp, path, iteration, pool, &film);
    if (h->rounds > 0) {
        float share = (float)spp / (float)(h->spp + spp);
        for (size_t i = 0; i < 6 * (size_t)film.width * film.height; i++)
            film.pixel[i] = h->halves.pixel[i] + share * (film.pixel[i] - h->halves.pixel[i]);
    }
    image_release(&h->halves);
    h->halves = film;
    h->spp += spp;
    h->rounds++;
}

void held_render_release(struct held_render *h) { image_release(&h->halves); }

bool held_render_is_done(const struct held_render *h, struct metric msre, size_t views) {
    double goal = HELD_RENDER_GOAL * sqrt((double)views) * msre.value;
    return isnan(msre.value) || msre.noise <= goal || h->rounds >= HELD_RENDER_ROUNDS;
}

void held_render_mean(const struct image *halves, struct image *mean) {
    image_init_rgb(mean, halves->width, halves->height);
    for (size_t i = 0; i < 3 * (size_t)mean->width * mean->height; i++) {
        const float *a = halves->pixel + 6 * (i / 3) + i % 3;
        mean->pixel[i] = 0.5f * (a[0] + a[3]);
    }
}
