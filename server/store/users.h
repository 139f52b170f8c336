/* users.h -- who may do what: users, their tokens and roles, and who sees which scene and job.
 *
 * 1. A token is shown once, when it is made; the database has only the SHA-256 of its secret.
 * 2. A thing belongs to the user who made it (0: nobody, from a time without tokens). Others'
 *    things do not exist for a caller, unless their owner shares them with the lab:
 *
 *      role     own things      shared jobs and their scenes   others' things
 *      viewer   read            read                           --
 *      user     read, change    read                           --
 *      admin    read, change    read, change                   read, change
 *
 * 3. Users are never removed, so that a number never names another one.
 *
 * Thread-safe as store.h is. */
#ifndef UNBAKE_STORE_USERS_H
#define UNBAKE_STORE_USERS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "common/error.h"
#include "server/job/job.h"

struct store;

enum role { ROLE_VIEWER, ROLE_USER, ROLE_ADMIN }; /* stored as numbers, each may do more */
const char *role_name(enum role role);
bool role_parse(const char *name, enum role *role);

#define USER_NAME_SIZE 65 /* 64 characters and the NUL */
#define TOKEN_SIZE 80     /* "unbake_ID_" with 48 hex digits and the NUL, rounded up */

/* The caller of a request. */
struct caller {
    int64_t user_id;  /* 0: nobody: the daemon is open, and every caller is an admin */
    int64_t token_id; /* 0: no token was needed */
    enum role role;
    char name[USER_NAME_SIZE]; /* "" for nobody */
    int64_t expires_ms;        /* when the token ends; 0: never */
};

enum access { ACCESS_NONE, ACCESS_READ, ACCESS_CHANGE };
enum access caller_access_job(const struct caller *who, const struct job *job);
/* STATUS_OK with ACCESS_NONE also where no such scene exists. */
enum status store_scene_access(struct store *store, const struct caller *who, const char *scene_id, enum access *access,
                               struct error *err);

/* Whether a user exists or ever did: from then on every caller needs a token. */
bool store_has_users(struct store *store);

/* Makes a token that ends at expires_ms (0: never), and the user if the name is new: 1 to 64 letters, digits and
 * the characters . _ - @. STATUS_INPUT where that time is past. */
enum status store_token_add(struct store *store, const char *name, enum role role, int64_t expires_ms,
                            char token[TOKEN_SIZE], int64_t *id, struct error *err);
/* The caller that presents this token; STATUS_CONFLICT where it has expired, which only its secret is told;
 * STATUS_NOT_FOUND unless it is valid. The time taken does not depend on how much of a wrong token is right. */
enum status store_token_find(struct store *store, const char *token, struct caller *caller, struct error *err);
/* Revokes the token of that number, or all tokens of the user of that name. */
enum status store_token_revoke(struct store *store, const char *number_or_name, size_t *count, struct error *err);
bool store_token_is_valid(struct store *store, int64_t id);
/* Whether a token that is valid now makes its holder an admin. */
enum status store_has_admin(struct store *store, bool *has, struct error *err);

struct token_row {
    int64_t id, created_ms, expires_ms; /* expires_ms: 0: never */
    enum role role;
    char name[USER_NAME_SIZE];
};
/* Ordered by number; *rows is the caller's (mem_free). */
enum status store_token_list(struct store *store, struct token_row **rows, size_t *count, struct error *err);

struct user_row {
    int64_t id, created_ms;
    int64_t jobs, open_jobs; /* of all kinds; open: queued, running or paused */
    char name[USER_NAME_SIZE];
};
/* All users that ever were, by name; *rows is the caller's (mem_free). */
enum status store_user_list(struct store *store, struct user_row **rows, size_t *count, struct error *err);

#endif
