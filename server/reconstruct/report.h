/* report.h -- the last stage: what was decided about emitters, and what the held-out photographs say
 * about the result. */
#ifndef UNBAKE_RECONSTRUCT_REPORT_H
#define UNBAKE_RECONSTRUCT_REPORT_H

#include "server/capture/views.h"
#include "server/state/reconstruction.h"

/* Renders every held-out view into r->held_out and adds "views" and "metrics" to r->report. A held-out frame
 * of unknown exposure is compared at the exposure that fits it best, and where exposures or white balance were found to
 * drift at its own. STATUS_CANCELLED when stopped. */
enum status report_held_out(struct reconstruction *r, const struct views *views,
                            const struct reconstruct_hooks *hooks, struct error *err);

/* Adds "emitters" to r->report: the segments that emit or came near it, with the evidence. */
void report_emitters(struct reconstruction *r);

#endif
