/* report.h -- the last stage: list of emitters, and metrics on the held-out photographs. */
#ifndef UNBAKE_RECONSTRUCT_REPORT_H
#define UNBAKE_RECONSTRUCT_REPORT_H

#include "server/capture/views.h"
#include "server/state/pace.h"
#include "server/state/reconstruction.h"

/* Renders every held-out view into r->held_out and adds "views" and "metrics" to r->report. A photograph of unknown
 * exposure is compared at the exposure that fits it best; so it is in all, and in white balance, where these drift. By
 * how much whole views are too bright or dark tells how well the light is known: it is added to r->materials.spread.
 * STATUS_CANCELLED when stopped. */
enum status report_held_out(struct reconstruction *r, const struct views *views, const struct pace *pace,
                            struct error *err);

/* Releases r->held_out, which is empty then. */
void report_release_held_out(struct reconstruction *r);

/* Adds "grey_card" to r->report, where one is given: what base colour came out there; warns where it is not the
 * card's. */
void report_grey_card(struct reconstruction *r, const struct reconstruct_hooks *hooks);

/* Adds "luminance_per_unit" to r->report where it is told, or known by the photographs; in cd/m2. */
void report_luminance(struct reconstruction *r, const struct reconstruct_hooks *hooks);

/* Adds "emitters" to r->report: the segments that emit or nearly do, with their evidence. */
void report_emitters(struct reconstruction *r);

#endif
