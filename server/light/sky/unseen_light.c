/* unseen_light.c -- see unseen_light.h. */
#include "server/light/sky/unseen_light.h"

#include <math.h>

#include "common/mem.h"
#include "server/light/sky/light_sky.h"
#include "server/light/survey.h"
#include "server/light/sky/unseen_fit.h"

#define POINTS 2048
/* Least part of the light at a grey card that is unseen, as fitted: errors of the rest are taken for its scale. Between
 * a room whose light is all unseen and one where it is all seen (test_grey_card.c) it may be anything: .15 and .25 give
 * the same there. */
#define MIN_CARD_SHARE 0.2
/* Light is missing, and not only known badly, if the base colours of more than a fifth of the points exceed this. */
#define IMPOSSIBLE_BASE_COLOR 1.5
#define NOT_IMPOSSIBLE 0.8 /* quantile */

struct unseen {
    struct reconstruction *r;
    const struct survey *survey; /* while points are gathered */
    size_t count;
    struct unseen_point *point; /* [count] */
    struct unseen_point card;   /* the grey card's, where there is one */
    double log_radiance[SKY_CELLS];
    struct light_sky sky; /* what of the fill is kept */
};

/* --- gathering ------------------------------------------------------------------------------------ */

static void gather_point(const struct unseen *u, uint32_t texel, int thread, struct unseen_point *p) {
    const struct reconstruction *r = u->r;
    const struct incident *in = &u->survey->scratch[thread];
    struct surface_point at;
    struct irradiance light;
    *p = (struct unseen_point){.segment = reconstruction_segment(r, texel)};
    if (!survey_gather(u->survey, texel, SURVEY_RAYS, thread, &at, &light))
        return;
    for (size_t i = 0; i < SURVEY_RAYS; i++) {
        if (!in->escapes[i])
            continue;
        float share = 1.0f / SURVEY_RAYS; /* of the ray, that is unseen */
        if (r->environment.map.pixel)
            share *= 1.0f - light_sky_kept(&u->sky, environment_cell(&r->environment, in->direction[i]));
        unseen_add_ray(p, in->direction[i], share, rgb_mean(in->radiance[i]));
    }
    p->known = fmaxf(rgb_mean(survey_lambert(&at, &light)) - p->filled, 0.0f);
    p->observed = rgb_mean(fused_radiance(&r->fused, texel));
}

static void gather_surveyed(void *user, size_t index, int thread) {
    struct unseen *u = user;
    gather_point(u, u->survey->texel[index], thread, &u->point[index]);
}

/* --- the whole ------------------------------------------------------------------------------------ */

static void fill_in(const struct unseen *u) {
    struct environment *e = &u->r->environment;
    for (size_t i = 0; i < environment_pixel_count(e); i++) {
        if (environment_pixel_is_seen(e, i))
            continue;
        float radiance = (float)sky_cells_radiance(u->log_radiance, environment_pixel_direction(e, i));
        float kept = light_sky_kept(&u->sky, i), *pixel = e->map.pixel + 3 * i;
        for (size_t channel = 0; channel < 3; channel++)
            pixel[channel] = kept * pixel[channel] + (1.0f - kept) * radiance;
    }
}

/* Fills the points: what they show, and what is around them. */
static void gather_points(struct unseen *u, const struct views *views) {
    struct survey survey;
    survey_init(&survey, u->r, views, NULL, NULL, false, POINTS);
    u->survey = &survey;
    u->count = survey.count;
    u->point = mem_array(u->count + 1, sizeof *u->point);
    parallel_for(u->r->pool, u->count, gather_surveyed, u);
    if (u->r->grey_card.is_given)
        gather_point(u, u->r->grey_card.texel, 0, &u->card);
    survey_release(&survey);
}

/* Scales the map, whose level is a guess (nine tenths of base colours below that of white paint), so that base colour
 * at the grey card is its reflectance. Not where too little of the light there is unseen, or the known light alone is
 * too much for what the card shows. */
static void scale_by_card(struct unseen *u) {
    struct grey_card *card = &u->r->grey_card;
    const struct unseen_point *p = &u->card;
    double unseen = 0.0;
    for (size_t k = 0; k < SKY_CELLS; k++)
        unseen += (double)p->share[k] * exp(u->log_radiance[k]);
    double wanted = (double)p->observed / card->pixel.value - (double)p->known;
    if (!card->is_given || !(unseen > 0.0) || unseen < MIN_CARD_SHARE * (unseen + (double)p->known) || !(wanted > 0.0))
        return;
    card->light_factor = wanted / unseen;
    for (size_t k = 0; k < SKY_CELLS; k++)
        u->log_radiance[k] += log(card->light_factor);
}

static void relight(struct unseen *u) {
    struct reconstruction *r = u->r;
    unseen_fit(u->point, u->count, r->pool, u->log_radiance);
    scale_by_card(u);
    if (!r->environment.map.pixel)
        environment_make_unseen(&r->environment);
    fill_in(u);
    environment_update_figures(&r->environment);
    world_set_environment(&r->world, &r->environment.map, r->pool);
}

void unseen_light_estimate(struct reconstruction *r, const struct views *views) {
    struct unseen u = {.r = r};
    cJSON *figures = cJSON_AddObjectToObject(r->report, "unseen_light");
    light_sky_init(&u.sky, &r->environment);
    gather_points(&u, views);
    r->unseen_share = unseen_share(u.point, u.count);
    u.count = unseen_keep_informative(u.point, u.count);
    double base_color = unseen_base_color(u.point, u.count, NOT_IMPOSSIBLE, NULL);
    bool matters = !r->is_surrounded && u.count >= UNSEEN_MIN_POINTS &&
                   (base_color > IMPOSSIBLE_BASE_COLOR || r->unseen_share > UNSEEN_LIGHT_MOSTLY);
    if (matters)
        relight(&u);
    r->sky_is_fitted = matters;
    json_add_number(figures, "share_of_rays", r->unseen_share);
    json_add_number(figures, "base_color_without", base_color);
    json_add_bool(figures, "estimated", matters);
    light_sky_release(&u.sky);
    mem_free(u.point);
}
