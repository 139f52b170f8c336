/* users_rig.h -- users with tokens, and jobs of their own. */
#ifndef UNBAKE_TESTS_UNIT_USERS_RIG_H
#define UNBAKE_TESTS_UNIT_USERS_RIG_H

#include "common/sha256.h"
#include "server/store/internal.h"
#include "tests/unit/store_rig.h"

static inline int64_t add_own_job(struct store *store, const char *scene, int64_t owner, const char *key) {
    struct job_new new = {.scene_id = scene,
                          .owner_id = owner,
                          .name = "n",
                          .labels = "{}",
                          .settings = "{}",
                          .max_attempts = 2,
                          .idempotency_key = key,
                          .request_sha256 = "x"};
    int64_t id = 0;
    bool replayed;
    OK(store_job_add(store, &new, 1000, &id, &replayed, &err));
    return id;
}

static inline struct caller add_user(struct store *store, const char *name) {
    char token[TOKEN_SIZE];
    struct caller who = {0};
    int64_t id;
    OK(store_token_add(store, name, ROLE_USER, 0, token, &id, &err));
    OK(store_token_find(store, token, &who, &err));
    return who;
}

#endif
