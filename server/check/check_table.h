/* check_table.h -- what a bundle holds, as rows of a table for people. */
#ifndef UNBAKE_CHECK_CHECK_TABLE_H
#define UNBAKE_CHECK_CHECK_TABLE_H

#include "common/settings.h"
#include "server/check/scene_check.h"

/* Adds to the facts: "table" [{"label", "value"}], "memory_bytes" and "time_sec" of a job with these settings,
 * "memory_texture_size", "memory_texel_bytes", "memory_kept_pixels" of a photograph and "memory_whole_bytes", where all
 * are kept, for job/admission.h, which knows the job's own settings; and a warning where it would take more than
 * memory_limit bytes (0: none). */
void check_table_add(cJSON *facts, const struct scene_check *room, const struct settings *settings, double memory_limit,
                     struct parallel *pool);

#endif
