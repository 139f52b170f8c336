/* fit.h -- do a scene's mesh and photographs belong together?
 *
 * Evidence: what the photographs' rays meet, and how well photographs agree about the points that they meet, under the
 * poses as loaded against other hypotheses (search.h). The verdict is
 *
 *   yes       the photographs agree about the surface, and no other hypothesis agrees significantly better;
 *   no        another one does (the remedy); or the rays miss the mesh; or the photographs have detail and see common
 *             points, but do not agree about them;
 *   doubtful  none of these can be told: plain walls, photographs from one place, or little in common. */
#ifndef UNBAKE_CHECK_FIT_H
#define UNBAKE_CHECK_FIT_H

#include <stdbool.h>

#include "common/error.h"
#include "common/json.h"
#include "server/check/search.h"

enum fit_verdict { FIT_YES, FIT_DOUBTFUL, FIT_NO };

#define FIT_EVIDENCE_MAX 6 /* sentences */

struct fit_result {
    enum fit_verdict verdict;
    struct search_result search;
    double detail;        /* share of the photographs' area that shows detail */
    float *brightness;    /* [photograph_count] median luminance of the stored pixels; owned */
    bool has_remedy;      /* search.best is significantly better */
    bool is_overwhelming; /* beyond doubt, and a reading can say it */
    size_t evidence_count;
    char *evidence[FIT_EVIDENCE_MAX]; /* sentences; owned */
};

/* Judges a scene as it was loaded. *fit is the caller's (fit_release). */
void fit_judge(struct fit_result *fit, const struct scene *scene, const struct accel *accel, struct parallel *pool);
void fit_release(struct fit_result *fit);

const char *fit_verdict_name(enum fit_verdict verdict);

/* {"verdict", "evidence", "remedy", "remedy_text", and figures} of a scene that was loaded by this reading; the
 * caller's. */
cJSON *fit_json(const struct fit_result *fit, const struct reading *loaded);

#endif
