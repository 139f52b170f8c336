/* relight_plan.h -- what a render is, before it begins: by its settings, without reading the room. */
#ifndef UNBAKE_RELIGHT_RELIGHT_PLAN_H
#define UNBAKE_RELIGHT_RELIGHT_PLAN_H

#include <stdbool.h>
#include <stdint.h>

#include "common/error.h"
#include "common/sha256.h"
#include "server/relight/relight_job.h"

#define RELIGHT_FIRST_HIT_SPP 16 /* jittered rays for each pixel of the passes that are not light */

/* How many pictures the settings mean, and how many pixels all of them have together. */
enum status relight_plan_count(const struct relight_job *job, uint64_t *pictures, uint64_t *pixels, struct error *err);

struct relight_plan {
    uint64_t pictures;
    double paths;                 /* pixels times samples, of all of them; a guess where noise or time limit them */
    char digest[SHA256_HEX_SIZE]; /* with which views.jsonl records its pictures */
};
enum status relight_plan_make(const struct relight_job *job, struct relight_plan *plan, struct error *err);

/* Whether any pass that the settings ask for is light, not only what the first hits are. */
bool relight_plan_needs_light(const cJSON *settings);

#endif
