/* results.h -- a reconstruction as input of the export. */
#ifndef UNBAKE_WORKER_RESULTS_H
#define UNBAKE_WORKER_RESULTS_H

#include "server/export/outputs.h"
#include "server/reconstruct/reconstruct.h"

/* The current state, from the first iteration on; without comparisons. Borrows all of `r`, and the title. */
struct export_input results_so_far(const struct reconstruction *r, const char *title);

/* Everything, once the reconstruction has ended. input->comparison and input->camera are the caller's (mem_free). */
void results_make(struct export_input *input, const struct reconstruction *r, const char *title);

#endif
