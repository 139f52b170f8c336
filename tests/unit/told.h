/* told.h -- what loading a bundle says: problems and warnings as text. */
#ifndef UNBAKE_TESTS_UNIT_TOLD_H
#define UNBAKE_TESTS_UNIT_TOLD_H

#include "server/ingest/bundle.h"
#include "tests/check.h"

/* Loads the bundle in a folder in place of *scene, which the caller releases. told[size]: a line for each member of a
 * problem, and for each warning. */
static inline enum status load_told(const char *folder, const struct bundle_limits *limits, struct parallel *pool,
                                    struct scene *scene, char *told, size_t size) {
    cJSON *problems = cJSON_CreateArray(), *problem;
    struct error err = {.message = ""};
    size_t used = 0;
    scene_release(scene);
    enum status status = bundle_load(folder, NULL, limits, pool, scene, problems, &err);
    told[0] = '\0';
    cJSON_ArrayForEach(problem, problems) {
        for (const cJSON *part = problem->child; part && used < size; part = part->next)
            used += (size_t)snprintf(told + used, size - used, "%s: %s\n", part->string, part->valuestring);
    }
    for (size_t i = 0; i < scene->warning_count && used < size; i++)
        used += (size_t)snprintf(told + used, size - used, "%s\n", scene->warning[i]);
    cJSON_Delete(problems);
    CHECK_THAT(status == STATUS_OK || status == STATUS_INPUT, "%s: %s", folder, err.message);
    return status;
}

#endif
