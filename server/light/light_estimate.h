/* light_estimate.h -- the light that photographs do not measure, estimated from what it lights, all of it together.
 *
 * Its sources are lamps that no photograph shows, lamps and sky at which every photograph saturates, and a sun in whose
 * light every photograph does (light_model.h). They get the radiances under which base colours are most plausible
 * (joint_fit.h); light of unseen sky, of unseen surfaces and of lamps that are seen is fitted with them, within its
 * uncertainty, but left as it is. */
#ifndef UNBAKE_LIGHT_LIGHT_ESTIMATE_H
#define UNBAKE_LIGHT_LIGHT_ESTIMATE_H

#include "server/capture/views.h"
#include "server/gather/incident.h"
#include "server/state/reconstruction.h"

/* Needs fused radiance, and a world lit by r->environment if that has a map. Fills r->evidence of hidden and saturated
 * lamps, r->light, r->sun where it saturates what it lights, and brightens saturated directions of the environment. The
 * same for any number of threads. */
void light_estimate(struct reconstruction *r, const struct views *views);

/* The same for the sources that were found, with the outgoing radiance of `field`, which unobserved texels have too.
 * Observed radiance is that of `diffuse` where it has any; NULL: fused radiance. Leaves the world without emitters. */
void light_estimate_again(struct reconstruction *r, const struct views *views, const struct light_field *field,
                          const struct fused *diffuse);

/* Whether there is light that was estimated. */
bool light_is_estimated(const struct reconstruction *r);

/* After a resume: makes the environment what it was at the checkpoint. */
void light_restore(struct reconstruction *r);

/* Adds the sources and their deviations to the report ("lights"); of segments those that are emitters: of white
 * surfaces that saturate, solve finds that they are none. */
void light_report(const struct reconstruction *r);

#endif
