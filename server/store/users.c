/* users.c -- see users.h. A token is "unbake_NUMBER_SECRET": the number finds the row; the secret's hash is compared
 * in constant time. */
#include "server/store/users.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "common/clock.h"
#include "common/mem.h"
#include "common/random_hex.h"
#include "common/sha256.h"
#include "server/store/internal.h"

#define TOKEN_PREFIX "unbake_"
#define SECRET_DIGITS 48 /* random hex digits of a token: 192 bits */

static const char *const role_names[] = {"viewer", "user", "admin"};

const char *role_name(enum role role) { return role_names[role]; }

bool role_parse(const char *name, enum role *role) {
    for (int i = ROLE_VIEWER; i <= ROLE_ADMIN; i++) {
        if (strcmp(name, role_names[i]) != 0)
            continue;
        *role = (enum role)i;
        return true;
    }
    return false;
}

/* --- access ------------------------------------------------------------------------------- */

static enum access access_of(const struct caller *who, bool owns, bool is_shared) {
    if (who->role == ROLE_ADMIN)
        return ACCESS_CHANGE;
    if (owns)
        return who->role >= ROLE_USER ? ACCESS_CHANGE : ACCESS_READ;
    return is_shared ? ACCESS_READ : ACCESS_NONE;
}

enum access caller_access_job(const struct caller *who, const struct job *job) {
    return access_of(who, job->owner_id == who->user_id, job->is_shared);
}

enum status store_scene_access(struct store *store, const struct caller *who, const char *scene_id, enum access *access,
                               struct error *err) {
    int64_t owns = 0, shared = 0;
    *access = ACCESS_NONE;
    store_lock(store);
    enum status status =
        sql_int(&store->sql, 0, &owns, err, "SELECT 1 FROM scene_owners WHERE scene_id = ? AND user_id = ?", "ti",
                scene_id, who->user_id);
    if (status == STATUS_OK && !owns)
        status = sql_int(&store->sql, 0, &shared, err,
                         "SELECT 1 FROM jobs WHERE scene_id = ? AND shared = 1 AND kind = 0 LIMIT 1", "t", scene_id);
    store_unlock(store);
    if (status == STATUS_OK)
        *access = access_of(who, owns, shared);
    return status;
}

/* --- tokens -------------------------------------------------------------------------------- */

bool store_has_users(struct store *store) { return atomic_load(&store->has_users); }

enum status store_load_has_users(struct store *store, struct error *err) {
    int64_t found;
    enum status status = sql_int(&store->sql, 0, &found, err, "SELECT 1 FROM users LIMIT 1", "");
    atomic_store(&store->has_users, found != 0);
    return status;
}

static bool name_is_good(const char *name) {
    size_t length = strlen(name);
    if (length == 0 || length >= USER_NAME_SIZE || !isalpha((unsigned char)name[0]))
        return false; /* a name that starts with a digit could be taken for a token's number */
    for (size_t i = 0; i < length; i++)
        if (!isalnum((unsigned char)name[i]) && !strchr("._-@", name[i]))
            return false;
    return true;
}

static enum status insert_token(struct store *store, const char *name, enum role role, int64_t expires_ms,
                                const char *hash, int64_t *id, struct error *err) {
    int64_t user;
    enum status status = sql_run(&store->sql, err,
                                 "INSERT INTO users (name, created_ms) VALUES (?, ?)"
                                 " ON CONFLICT (name) DO NOTHING",
                                 "ti", name, store_now_ms());
    if (status == STATUS_OK)
        status = sql_int(&store->sql, 0, &user, err, "SELECT id FROM users WHERE name = ?", "t", name);
    if (status == STATUS_OK)
        status = sql_run(&store->sql, err,
                         "INSERT INTO tokens (user_id, role, hash, created_ms, expires_ms)"
                         " VALUES (?, ?, ?, ?, ?)",
                         "intii", user, (int)role, hash, store_now_ms(), expires_ms);
    if (status == STATUS_OK)
        *id = sqlite3_last_insert_rowid(store->sql.db);
    return status;
}

enum status store_token_add(struct store *store, const char *name, enum role role, int64_t expires_ms,
                            char token[TOKEN_SIZE], int64_t *id, struct error *err) {
    char secret[SECRET_DIGITS + 1], hash[SHA256_HEX_SIZE];
    if (!name_is_good(name)) {
        error_set(err, STATUS_INPUT, "\"%.80s\" is no name for a user", name);
        return error_hint(err, "1 to %d letters, digits and . _ - @, a letter first", USER_NAME_SIZE - 1);
    }
    if (expires_ms != 0 && expires_ms <= store_now_ms())
        return error_set(err, STATUS_INPUT, "the time at which the token would end is past");
    enum status status = random_hex(secret, SECRET_DIGITS, err);
    if (status != STATUS_OK)
        return status;
    sha256_of(secret, SECRET_DIGITS, hash);
    status = store_begin(store, err);
    if (status != STATUS_OK)
        return status;
    status = insert_token(store, name, role, expires_ms, hash, id, err);
    status = store_end(store, status, STORE_NOTHING_CHANGED, err);
    if (status != STATUS_OK)
        return status;
    atomic_store(&store->has_users, true);
    snprintf(token, TOKEN_SIZE, TOKEN_PREFIX "%lld_%s", (long long)*id, secret);
    return STATUS_OK;
}

/* Splits the token; false where it is malformed. */
static bool parse_token(const char *token, int64_t *id, const char **secret) {
    size_t prefix = strlen(TOKEN_PREFIX);
    if (strncmp(token, TOKEN_PREFIX, prefix) != 0)
        return false;
    const char *number = token + prefix;
    size_t digits = strspn(number, "0123456789");
    if (digits < 1 || digits > 18 || number[digits] != '_')
        return false;
    *id = strtoll(number, NULL, 10);
    *secret = number + digits + 1;
    return strlen(*secret) == SECRET_DIGITS;
}

static bool is_past(int64_t expires_ms) { return expires_ms != 0 && expires_ms <= store_now_ms(); }

static enum status tell_expired(int64_t expires_ms, struct error *err) {
    char when[CLOCK_TEXT_SIZE];
    clock_text(expires_ms, when);
    error_set(err, STATUS_CONFLICT, "the token expired at %s", when);
    return error_hint(err, "an admin makes another one");
}

enum status store_token_find(struct store *store, const char *token, struct caller *caller, struct error *err) {
    int64_t id;
    const char *secret;
    char hash[SHA256_HEX_SIZE], wanted[SHA256_HEX_SIZE] = "";
    sqlite3_stmt *stmt;
    bool found = false;
    *caller = (struct caller){0};
    if (!parse_token(token, &id, &secret))
        return error_set(err, STATUS_NOT_FOUND, "that is no token of this daemon");
    sha256_of(secret, SECRET_DIGITS, hash);
    store_lock(store);
    enum status status =
        sql_first(&store->sql, &stmt, &found, err,
                  "SELECT users.id, role, name, hash, expires_ms FROM tokens JOIN users ON users.id = user_id"
                  " WHERE tokens.id = ?",
                  "i", id);
    if (found) {
        caller->user_id = sqlite3_column_int64(stmt, 0);
        caller->token_id = id;
        caller->role = (enum role)sqlite3_column_int(stmt, 1);
        snprintf(caller->name, sizeof caller->name, "%s", sql_text(stmt, 2));
        snprintf(wanted, sizeof wanted, "%s", sql_text(stmt, 3));
        caller->expires_ms = sqlite3_column_int64(stmt, 4);
        sqlite3_reset(stmt);
    }
    store_unlock(store);
    bool same = sha256_equal(hash, wanted);
    int64_t expires_ms = caller->expires_ms;
    if (status != STATUS_OK || (found && same && !is_past(expires_ms)))
        return status;
    *caller = (struct caller){0};
    if (found && same)
        return tell_expired(expires_ms, err);
    return error_set(err, STATUS_NOT_FOUND, "the token is invalid or was revoked");
}

static enum status revoke(struct store *store, const char *number_or_name, size_t *count, struct error *err) {
    size_t digits = strspn(number_or_name, "0123456789");
    bool is_number = digits > 0 && digits <= 18 && number_or_name[digits] == '\0';
    *count = 0;
    enum status status = store_begin_freeing(store, err);
    if (status != STATUS_OK)
        return status;
    if (is_number)
        status = sql_run(&store->sql, err, "DELETE FROM tokens WHERE id = ?", "i",
                         (int64_t)strtoll(number_or_name, NULL, 10));
    else
        status = sql_run(&store->sql, err,
                         "DELETE FROM tokens WHERE user_id ="
                         " (SELECT id FROM users WHERE name = ?)",
                         "t", number_or_name);
    size_t gone = (size_t)sql_changes(&store->sql);
    if (status == STATUS_OK && gone == 0)
        status = error_set(err, STATUS_NOT_FOUND, is_number ? "there is no token %.80s" : "%.80s has no token",
                           number_or_name);
    status = store_end(store, status, STORE_NOTHING_CHANGED, err);
    if (status == STATUS_OK)
        *count = gone;
    return status;
}

enum status store_token_revoke(struct store *store, const char *number_or_name, size_t *count, struct error *err) {
    enum status status;
    do
        status = revoke(store, number_or_name, count, err);
    while (status == STATUS_NO_SPACE && store_reserve_spend(store));
    return status;
}

bool store_token_is_valid(struct store *store, int64_t id) {
    int64_t found = 0;
    store_lock(store);
    enum status status =
        sql_int(&store->sql, 0, &found, NULL,
                "SELECT 1 FROM tokens WHERE id = ? AND (expires_ms = 0 OR expires_ms > ?)", "ii", id, store_now_ms());
    store_unlock(store);
    return status == STATUS_OK && found != 0;
}

enum status store_has_admin(struct store *store, bool *has, struct error *err) {
    int64_t found = 0;
    store_lock(store);
    enum status status = sql_int(&store->sql, 0, &found, err,
                                 "SELECT 1 FROM tokens WHERE role = ? AND (expires_ms = 0 OR expires_ms > ?) LIMIT 1",
                                 "ii", (int64_t)ROLE_ADMIN, store_now_ms());
    store_unlock(store);
    *has = found != 0;
    return status;
}

enum status store_token_list(struct store *store, struct token_row **rows, size_t *count, struct error *err) {
    sqlite3_stmt *stmt;
    *rows = NULL;
    *count = 0;
    store_lock(store);
    enum status status = sql_query(&store->sql, &stmt, err,
                                   "SELECT tokens.id, tokens.created_ms, role, name, expires_ms FROM tokens"
                                   " JOIN users ON users.id = user_id ORDER BY tokens.id",
                                   "");
    while (sql_next(&store->sql, stmt, &status, err)) {
        *rows = mem_realloc_array(*rows, *count + 1, sizeof **rows);
        struct token_row *at = &(*rows)[(*count)++];
        *at = (struct token_row){.id = sqlite3_column_int64(stmt, 0),
                                 .created_ms = sqlite3_column_int64(stmt, 1),
                                 .role = (enum role)sqlite3_column_int(stmt, 2),
                                 .expires_ms = sqlite3_column_int64(stmt, 4)};
        snprintf(at->name, sizeof at->name, "%s", sql_text(stmt, 3));
    }
    store_unlock(store);
    return status;
}

enum status store_user_list(struct store *store, struct user_row **rows, size_t *count, struct error *err) {
    sqlite3_stmt *stmt;
    *rows = NULL;
    *count = 0;
    store_lock(store);
    enum status status = sql_query(&store->sql, &stmt, err,
                                   "SELECT id, created_ms, (SELECT count(*) FROM jobs WHERE owner_id = users.id),"
                                   " (SELECT count(*) FROM jobs WHERE owner_id = users.id AND state <= ?), name"
                                   " FROM users ORDER BY name",
                                   "n", (int)JOB_PAUSED);
    while (sql_next(&store->sql, stmt, &status, err)) {
        *rows = mem_realloc_array(*rows, *count + 1, sizeof **rows);
        struct user_row *at = &(*rows)[(*count)++];
        *at = (struct user_row){.id = sqlite3_column_int64(stmt, 0),
                                .created_ms = sqlite3_column_int64(stmt, 1),
                                .jobs = sqlite3_column_int64(stmt, 2),
                                .open_jobs = sqlite3_column_int64(stmt, 3)};
        snprintf(at->name, sizeof at->name, "%s", sql_text(stmt, 4));
    }
    store_unlock(store);
    return status;
}
