/* strength_search.c -- see strength_search.h. */
#include "server/light/strength_search.h"

#include <math.h>

/* The faintest strength adds this part to the light of what it reaches. */
#define FAINTEST 0.01
#define NEARER 5 /* times the step to the best strength's neighbours is halved: to 2 % */

double strength_search(double known, double response, strength_losses *losses, void *user, double *best) {
    double strength[STRENGTHS], loss[STRENGTHS], without, least, step = 2.0;
    *best = 0.0;
    if (!(response > 0.0))
        return 0.0;
    for (int i = 0; i < STRENGTHS; i++)
        strength[i] = ldexp(FAINTEST * known / response, i);
    losses(user, best, 1, &without);
    losses(user, strength, STRENGTHS, loss);
    least = without;
    for (int i = 0; i < STRENGTHS; i++) {
        if (loss[i] < least)
            least = loss[i], *best = strength[i];
    }
    if (!(*best > 0.0))
        return 0.0;
    for (int i = 0; i < NEARER; i++) {
        step = sqrt(step);
        const double beside[2] = {*best / step, *best * step};
        losses(user, beside, 2, loss);
        for (int side = 0; side < 2; side++) {
            if (loss[side] < least)
                least = loss[side], *best = beside[side];
        }
    }
    return without - least;
}
