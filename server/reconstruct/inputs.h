/* inputs.h -- which parts of the state the functions of the folders below get: nothing there sees all of it. */
#ifndef UNBAKE_RECONSTRUCT_INPUTS_H
#define UNBAKE_RECONSTRUCT_INPUTS_H

#include "server/capture/views.h"
#include "server/material/divide.h"
#include "server/material/emission_pattern.h"
#include "server/refine/optimiser.h"
#include "server/state/pace.h"
#include "server/state/reconstruction.h"

/* All are valid as long as their arguments. */
static inline struct emission_pattern_input inputs_of_pattern(const struct reconstruction *r,
                                                              const struct views *views) {
    return (struct emission_pattern_input){
        reconstruction_surface(r), views, &r->noise, &r->fused, r->is_emitter, r->pool};
}

static inline struct divide inputs_of_divide(struct reconstruction *r, const struct views *views,
                                             const struct probes *probes, const struct light_field *field,
                                             const struct sun_shadows *shadows) {
    return (struct divide){.surface = reconstruction_surface(r),
                           .views = views,
                           .fused = &r->fused,
                           .noise = &r->noise,
                           .probes = probes,
                           .field = field,
                           .sun = &r->sun,
                           .shadows = shadows,
                           .accel = r->world.accel,
                           .is_emitter = r->is_emitter,
                           .materials = &r->materials,
                           .pool = r->pool};
}

static inline struct optimiser_input inputs_of_optimiser(struct reconstruction *r, const struct views *views,
                                                         const struct pace *pace) {
    return (struct optimiser_input){.surface = reconstruction_surface(r),
                                    .views = views,
                                    .pace = pace,
                                    .pool = r->pool,
                                    .materials = &r->materials,
                                    .is_emitter = r->is_emitter,
                                    .evidence = r->evidence,
                                    .sky_factor = &r->sky_factor,
                                    .light = &r->light,
                                    .sun_irradiance = &r->sun.irradiance,
                                    .world = &r->world,
                                    .report = r->report,
                                    .previewed = r};
}

#endif
