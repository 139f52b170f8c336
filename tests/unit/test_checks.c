/* test_checks.c -- whose scene is checked next: one user's large archives do not hold up another's small room. */
#include "server/job/checks.h"

#include "tests/unit/scheduler_rig.h"

enum { ANNA = 1, BERT, CORA };

/* --- the worker's side: a check that goes on until there is a file "go" in the data folder --------- */

static int play(const char *role, const char *dir, int attempt) {
    (void)role, (void)dir, (void)attempt;
    return 91;
}

static int play_check(const char *role, const char *dir) {
    struct progress p = {.fd = PROGRESS_FD};
    char *files = file_join(dir, "files"), *go = file_join(dir, "../../go");
    if (file_make_dirs(files, &err) != STATUS_OK)
        return 92;
    while (strcmp(role, "slow") == 0 && access(go, F_OK) != 0)
        usleep(WAIT_US);
    check_out(&p);
    return 0;
}

/* --- the daemon's side ------------------------------------------------------------------------------ */

static const char *id_of(int number) {
    static char id[8][SCENE_ID_SIZE];
    snprintf(id[number % 8], SCENE_ID_SIZE, "%08x%.56s", (unsigned)number, SCENE_A);
    return id[number % 8];
}

static bool has_begun(const struct daemon *d, int number) {
    char *path = mem_printf("%s/scenes/%s/files", d->dir, id_of(number));
    bool there = access(path, F_OK) == 0;
    mem_free(path);
    return there;
}

static void test_two_users(struct daemon *d) {
    daemon_start(d, 1, "/proc/self/exe");
    for (int i = 1; i <= 4; i++)
        add_scene_of(d, id_of(i), "slow", ANNA);
    for (int i = 0; i < WAIT_TRIES && !has_begun(d, 1); i++)
        usleep(WAIT_US);
    add_scene_of(d, id_of(5), "good", BERT);
    add_scene_of(d, id_of(6), "good", CORA);
    CHECK(wait_for_scene(d, id_of(5), SCENE_READY) && wait_for_scene(d, id_of(6), SCENE_READY));
    CHECK(has_begun(d, 1) && !has_begun(d, 2) && !has_begun(d, 3) && !has_begun(d, 4));
    char *go = file_join(d->dir, "go");
    OK(file_replace(go, "", 0, &err));
    for (int i = 1; i <= 4; i++)
        CHECK(wait_for_scene(d, id_of(i), SCENE_READY));
    mem_free(go);
    daemon_stop(d);
}

/* Anna has sent three, Bert two, Cora one, in that order: they take turns. */
static void test_turns(struct daemon *d) {
    static const int owner[] = {ANNA, ANNA, ANNA, BERT, BERT, CORA}, wanted[] = {11, 14, 16, 12, 15, 13};
    struct checks checks = {0};
    struct attempt slots[2] = {0};
    struct unchecked next;
    bool existed;
    OK(store_open(&d->store, d->dir, &err));
    for (int i = 0; i < 6; i++) {
        OK(store_scene_add(d->store, id_of(11 + i), "scene", 1, owner[i], &existed, &err));
        usleep(2000); /* their times are in milliseconds */
    }
    for (int i = 0; i < 6; i++) {
        OK(checks_next(&checks, d->store, slots, 2, &next, &err));
        CHECK_THAT(strcmp(next.id, id_of(wanted[i])) == 0, "turn %d: %.8s", i, next.id);
        OK(store_scene_ready(d->store, next.id, NULL, "{}", &err));
    }
    CHECK(checks_next(&checks, d->store, slots, 2, &next, &err) == STATUS_NOT_FOUND);

    /* With one slot, one user may have all of it. */
    OK(store_scene_add(d->store, id_of(20), "scene", 1, ANNA, &existed, &err));
    OK(checks_next(&checks, d->store, slots, 1, &next, &err));
    /* What is being checked is no next one, and its user has no second of two slots. */
    slots[0] = (struct attempt){.phase = ATTEMPT_ALIVE, .owner_id = ANNA};
    memcpy(slots[0].scene_id, next.id, SCENE_ID_SIZE);
    CHECK(checks_next(&checks, d->store, slots, 2, &next, &err) == STATUS_NOT_FOUND);
    OK(store_scene_add(d->store, id_of(21), "scene", 1, ANNA, &existed, &err));
    CHECK(checks_next(&checks, d->store, slots, 2, &next, &err) == STATUS_NOT_FOUND);
    OK(store_scene_add(d->store, id_of(22), "scene", 1, BERT, &existed, &err));
    OK(checks_next(&checks, d->store, slots, 2, &next, &err));
    CHECK(next.owner_id == BERT);
    store_close(d->store);
}

int main(int argc, char **argv) {
    struct daemon d;
    daemon_begin(&d, argc, argv);
    test_two_users(&d);
    test_turns(&d);
    daemon_end(&d);
    return check_result();
}
