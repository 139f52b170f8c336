/* test_users.c -- tokens: made, checked, named, expired. */
#include <limits.h>
#include <sqlite3.h>
#include <time.h>

#include "tests/unit/users_rig.h"

static void test_equal(void) {
    char a[SHA256_HEX_SIZE], b[SHA256_HEX_SIZE];
    sha256_of("a", 1, a);
    memcpy(b, a, sizeof b);
    CHECK(sha256_equal(a, b));
    for (size_t i = 0; i < sizeof a - 1; i++) {
        b[i] = b[i] == '0' ? '1' : '0';
        CHECK(!sha256_equal(a, b) && !sha256_equal(b, a));
        b[i] = a[i];
    }
    CHECK(!sha256_equal("", "") && !sha256_equal(a, "") && !sha256_equal("", a));
    b[SHA256_HEX_SIZE - 2] = '\0';
    CHECK(!sha256_equal(b, b));
}

static void check_bad_names(struct store *store) {
    char token[TOKEN_SIZE];
    int64_t id;
    static const char *const bad[] = {"",
                                      "7up",
                                      "a b",
                                      "a/b",
                                      ".",
                                      "\xc3\xa9t\xc3\xa9",
                                      "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        IS(store_token_add(store, bad[i], ROLE_USER, 0, token, &id, &err), STATUS_INPUT);
    CHECK(!store_has_users(store));
}

/* Each digit counts, the secret of token `other` is not this one's, and forms that are none. */
static void check_wrong_tokens(struct store *store, const char *token, int64_t other) {
    char wrong[TOKEN_SIZE + 40];
    struct caller who;
    for (size_t i = 0; token[i]; i++) {
        memcpy(wrong, token, TOKEN_SIZE);
        wrong[i] = wrong[i] == '0' ? '1' : '0';
        IS(store_token_find(store, wrong, &who, &err), STATUS_NOT_FOUND);
        CHECK(who.user_id == 0 && who.token_id == 0 && who.role == ROLE_VIEWER);
        memcpy(wrong, token, TOKEN_SIZE);
        wrong[i] = '\0';
        IS(store_token_find(store, wrong, &who, &err), STATUS_NOT_FOUND);
    }
    snprintf(wrong, sizeof wrong, "unbake_%lld%s", (long long)other, strchr(token + 7, '_'));
    IS(store_token_find(store, wrong, &who, &err), STATUS_NOT_FOUND);
    snprintf(wrong, sizeof wrong, "%s0", token);
    IS(store_token_find(store, wrong, &who, &err), STATUS_NOT_FOUND);
    IS(store_token_find(store, "unbake_99999999999999999999_", &who, &err), STATUS_NOT_FOUND);
}

/* The secret of a token is not in the database. */
static void check_secrecy(const char *dir, const char *token) {
    struct buf content;
    buf_init(&content, (size_t)64 << 20);
    char *path = file_join(dir, "state.db-wal");
    OK(file_read(path, &content, &err));
    CHECK(content.length > 0 && !memmem(content.data, content.length, strchr(token + 7, '_') + 1, 48));
    mem_free(path);
    buf_release(&content);
}

/* Revokes a token of alice's, who has two, by its number, then the other by her name. */
static void check_revocation(struct store *store, const char *token, int64_t id, int64_t other) {
    struct caller who;
    struct token_row *rows;
    size_t count;
    char number[24];
    OK(store_token_list(store, &rows, &count, &err));
    CHECK(count == 2 && rows[0].id == id && rows[1].role == ROLE_VIEWER);
    CHECK_STRING(rows[1].name, "alice");
    mem_free(rows);
    snprintf(number, sizeof number, "%lld", (long long)id);
    OK(store_token_revoke(store, number, &count, &err));
    CHECK(count == 1 && !store_token_is_valid(store, id) && store_token_is_valid(store, other));
    IS(store_token_find(store, token, &who, &err), STATUS_NOT_FOUND);
    IS(store_token_revoke(store, number, &count, &err), STATUS_NOT_FOUND);
    IS(store_token_revoke(store, "bob", &count, &err), STATUS_NOT_FOUND);
    OK(store_token_revoke(store, "alice", &count, &err));
    CHECK(count == 1);
}

static void test_tokens(void) {
    char *dir = fresh_dir(), token[TOKEN_SIZE], second[TOKEN_SIZE];
    struct store *store;
    struct caller who;
    int64_t id, other;
    OK(store_open(&store, dir, &err));
    CHECK(!store_has_users(store));
    check_bad_names(store);
    OK(store_token_add(store, "alice", ROLE_USER, 0, token, &id, &err));
    OK(store_token_add(store, "alice", ROLE_VIEWER, 0, second, &other, &err));
    CHECK(store_has_users(store) && id != other);
    OK(store_token_find(store, token, &who, &err));
    CHECK(who.role == ROLE_USER && who.token_id == id);
    CHECK_STRING(who.name, "alice");
    int64_t alice = who.user_id;
    OK(store_token_find(store, second, &who, &err));
    CHECK(who.role == ROLE_VIEWER && who.user_id == alice);
    check_wrong_tokens(store, token, other);
    check_secrecy(dir, token);
    check_revocation(store, token, id, other);
    CHECK(store_has_users(store)); /* who had users once does not fall open */
    store_close(store);
    OK(store_open(&store, dir, &err));
    CHECK(store_has_users(store));
    store_close(store);
    drop_dir(dir);
}

/* A token that ends by itself: its holder is told, whoever guesses is not; one that is past is not made. */
static void test_expiry(void) {
    char *dir = fresh_dir(), token[TOKEN_SIZE], wrong[TOKEN_SIZE];
    struct store *store;
    struct caller who;
    struct token_row *rows;
    int64_t id, until = store_now_ms() + 3600000;
    size_t count;
    OK(store_open(&store, dir, &err));
    IS(store_token_add(store, "alice", ROLE_USER, 1, token, &id, &err), STATUS_INPUT);
    CHECK(!store_has_users(store));
    OK(store_token_add(store, "alice", ROLE_USER, until, token, &id, &err));
    OK(store_token_find(store, token, &who, &err));
    CHECK(who.expires_ms == until && store_token_is_valid(store, id));
    OK(store_token_list(store, &rows, &count, &err));
    CHECK(count == 1 && rows[0].expires_ms == until);
    mem_free(rows);
    store_close(store);

    sqlite3 *db;
    char *path = file_join(dir, "state.db");
    CHECK(sqlite3_open(path, &db) == SQLITE_OK);
    CHECK(sqlite3_exec(db, "UPDATE tokens SET expires_ms = 1767225600000", NULL, NULL, NULL) == SQLITE_OK);
    sqlite3_close(db);
    mem_free(path);
    OK(store_open(&store, dir, &err));
    IS(store_token_find(store, token, &who, &err), STATUS_CONFLICT);
    CHECK_STRING(err.message, "the token expired at 2026-01-01T00:00:00.000Z");
    CHECK(who.user_id == 0 && who.token_id == 0 && who.role == ROLE_VIEWER && !store_token_is_valid(store, id));
    memcpy(wrong, token, sizeof wrong);
    wrong[strlen(wrong) - 1] = wrong[strlen(wrong) - 1] == '0' ? '1' : '0';
    IS(store_token_find(store, wrong, &who, &err), STATUS_NOT_FOUND);
    struct user_row *users;
    OK(store_user_list(store, &users, &count, &err));
    CHECK(count == 1 && users[0].jobs == 0);
    CHECK_STRING(users[0].name, "alice");
    mem_free(users);
    store_close(store);
    drop_dir(dir);
}

/* What `who` is told that the scene is called, and whose it is; "-": nothing at all. */
static void check_name(struct store *store, const struct caller *who, const char *name, const char *owner) {
    struct scene_row row, rows[10];
    size_t count;
    char next[128];
    if (store_scene_find(store, who, SCENE_A, &row, &err) != STATUS_OK) {
        CHECK(name[0] == '-' && err.status == STATUS_NOT_FOUND);
        return;
    }
    CHECK_STRING(row.name, name);
    CHECK_STRING(row.owner, owner);
    scene_row_release(&row);
    OK(store_scene_list(store, who, "", 10, rows, &count, next, &err));
    CHECK(count == 1); /* once, however many own it */
    for (size_t i = 0; i < count; i++) {
        CHECK_STRING(rows[i].name, name);
        CHECK_STRING(rows[i].owner, owner);
        scene_row_release(&rows[i]);
    }
}

/* Each owner of a scene calls it as he likes, and learns neither how others call it nor who they are. */
static void test_names(void) {
    static const char *const users[] = {"alice", "bob", "carol", "dora"};
    char *dir = fresh_dir();
    struct caller who[4], *alice = &who[0], *bob = &who[1], *carol = &who[2], *dora = &who[3];
    const struct caller admin = {.role = ROLE_ADMIN};
    const struct retention as_is = {0};
    struct store *store;
    bool existed, is_gone;
    OK(store_open(&store, dir, &err));
    for (int i = 0; i < 4; i++)
        who[i] = add_user(store, users[i]);
    OK(store_scene_add(store, SCENE_A, "secret of alice", 1, alice->user_id, &existed, &err));
    OK(store_scene_add(store, SCENE_A, "kitchen", 1, bob->user_id, &existed, &err));
    OK(store_scene_add(store, SCENE_A, "hall", 1, carol->user_id, &existed, &err));
    OK(store_scene_ready(store, SCENE_A, NULL, "{}", &err));
    check_name(store, alice, "secret of alice", "alice");
    check_name(store, bob, "kitchen", "bob");
    check_name(store, carol, "hall", "carol");
    check_name(store, dora, "-", "");
    check_name(store, &admin, "secret of alice", "alice");
    check_name(store, NULL, "secret of alice", "alice");

    OK(store_scene_patch(store, bob, SCENE_A, &(struct scene_patch){"his kitchen", as_is, NULL}, &err));
    OK(store_scene_patch(store, &admin, SCENE_A, &(struct scene_patch){"hers", as_is, NULL}, &err));
    check_name(store, alice, "hers", "alice");
    check_name(store, bob, "his kitchen", "bob");
    check_name(store, carol, "hall", "carol");

    /* Who may read it by a shared job is told what the one calls it who shares it; its other owners still their own. */
    int64_t shared = add_own_job(store, SCENE_A, bob->user_id, "key");
    OK(store_job_patch(store, shared, -1, &(struct job_patch){.priority = INT_MIN, .shared = 1}, &err));
    check_name(store, dora, "his kitchen", "bob");
    check_name(store, carol, "hall", "carol");
    OK(store_scene_add(store, SCENE_A, "of nobody", 1, 0, &existed, &err));
    check_name(store, &admin, "of nobody", "");
    OK(store_scene_delete(store, SCENE_A, 0, false, &is_gone, &err));
    check_name(store, NULL, "hers", "alice");

    /* The first who sent it goes, and so does one who shared it. */
    OK(store_scene_delete(store, SCENE_A, alice->user_id, false, &is_gone, &err));
    check_name(store, alice, "his kitchen", "bob"); /* shared with her, too */
    check_name(store, NULL, "his kitchen", "bob");
    OK(store_job_cancel(store, shared, &err));
    OK(store_scene_delete(store, SCENE_A, bob->user_id, false, &is_gone, &err));
    check_name(store, dora, "aaaaaaaaaaaa", "");
    check_name(store, carol, "hall", "carol");
    store_close(store);
    drop_dir(dir);
}

/* To each owner a scene is as new as his own upload of it, also in the order of lists and from page to page. */
static void test_ages(void) {
    const struct timespec moment = {.tv_nsec = 3000000};
    char *dir = fresh_dir(), at[128] = "", next[128];
    struct caller alice, bob;
    struct store *store;
    struct scene_row row;
    int64_t created_ms[3];
    size_t count;
    bool existed;
    OK(store_open(&store, dir, &err));
    alice = add_user(store, "alice");
    bob = add_user(store, "bob");
    OK(store_scene_add(store, SCENE_A, "a", 1, alice.user_id, &existed, &err));
    nanosleep(&moment, NULL);
    OK(store_scene_add(store, SCENE_C, "c", 1, bob.user_id, &existed, &err));
    nanosleep(&moment, NULL);
    OK(store_scene_add(store, SCENE_A, "a", 1, bob.user_id, &existed, &err));
    static const char *const newest_first[] = {SCENE_A, SCENE_C};
    for (size_t i = 0; i < 2; i++) {
        OK(store_scene_list(store, &bob, at, 1, &row, &count, next, &err));
        memcpy(at, next, sizeof at);
        CHECK(count == 1 && (next[0] != '\0') == (i == 0));
        CHECK_STRING(row.id, newest_first[i]);
        created_ms[i] = row.created_ms;
        scene_row_release(&row);
    }
    OK(store_scene_find(store, &alice, SCENE_A, &row, &err));
    created_ms[2] = row.created_ms;
    scene_row_release(&row);
    CHECK(created_ms[0] > created_ms[1] && created_ms[1] > created_ms[2]);
    store_close(store);
    drop_dir(dir);
}

int main(void) {
    test_equal();
    test_tokens();
    test_expiry();
    test_names();
    test_ages();
    return check_result();
}
