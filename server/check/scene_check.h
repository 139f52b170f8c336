/* scene_check.h -- loads a bundle and finds out whether it fits; takes a remedy that is beyond doubt. */
#ifndef UNBAKE_CHECK_SCENE_CHECK_H
#define UNBAKE_CHECK_SCENE_CHECK_H

#include "server/check/fit.h"
#include "server/ingest/bundle.h"

/* Called when the bundle has been read, before it is judged; again where a remedy was taken. */
typedef void scene_check_read(void *user, const struct scene *scene);

struct scene_check {
    struct scene scene;
    struct accel *accel;    /* of the scene's mesh; owned */
    struct reading reading; /* that counts: as given, with what was taken */
    struct fit_result fit;  /* of the scene by that reading */
    bool was_taken;
    struct fit_result given; /* of the scene as it was given, where a remedy was taken */
    struct reading given_reading;
    double load_sec, fit_sec;
    scene_check_read *read; /* may be NULL */
    void *user;
};

/* As bundle_load; *check is the caller's (scene_check_release) in any case. Members of the reading that the user gave
 * are never replaced: their remedy is only told. `read` may be NULL. */
enum status scene_check(struct scene_check *check, const char *dir, const struct reading *reading,
                        const struct bundle_limits *limits, struct parallel *pool, cJSON *problems,
                        scene_check_read *read, void *user, struct error *err);
void scene_check_release(struct scene_check *check);

/* {"fit": ..., "reading": ...} for the scene's facts; the caller's. */
void scene_check_facts(const struct scene_check *check, cJSON *facts);

#endif
