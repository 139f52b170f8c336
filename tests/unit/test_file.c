/* test_file.c -- each call of the system that file.c makes fails once, and closing: what was there is still there,
 * nothing is left beside it, and the same works when it is asked again. */
#include "common/file.h"

#include "common/mem.h"
#include "tests/check.h"
#include "tests/system_faults.h"

static struct error err;
static char dir[] = "/tmp/unbake-test-file-XXXXXX";
static char *path; /* of a file there */

#define OK(call) CHECK_THAT((call) == STATUS_OK, "%s", err.message)

static char *content(void) {
    struct buf text;
    buf_init(&text, 1000);
    OK(file_read(path, &text, &err));
    char *copy = mem_strdup(buf_text(&text));
    buf_release(&text);
    return copy;
}

/* The file, and nothing else. */
static void check_alone(const char *wanted) {
    char **names, *found = content();
    size_t count;
    OK(file_list(dir, &names, &count, &err));
    CHECK_THAT(count == 1, "%zu files are left", count);
    CHECK_STRING(found, wanted);
    file_free_names(names, count);
    mem_free(found);
}

/* --- what is asked ---------------------------------------------------------------------------------- */

static enum status replace(void) { return file_replace(path, "new", 3, &err); }
static enum status put_in_place(void) {
    char *other = file_join(dir, "other");
    FILE *file = fopen(other, "w"); /* libc's own calls do not fail */
    CHECK(file && fputs("new", file) >= 0 && fclose(file) == 0);
    enum status status = file_put_in_place(other, path, &err);
    mem_free(other);
    return status;
}
static enum status read_it(void) {
    struct buf text;
    buf_init(&text, 1000);
    enum status status = file_read(path, &text, &err);
    CHECK(status != STATUS_OK || strcmp(buf_text(&text), "old") == 0);
    buf_release(&text);
    return status;
}
static enum status list_it(void) {
    char **names;
    size_t count;
    enum status status = file_list(dir, &names, &count, &err);
    CHECK(status == STATUS_OK ? count == 1 : count == 0 && !names);
    file_free_names(names, count);
    return status;
}
static enum status look_how_full(void) {
    uint64_t bytes;
    return file_free_bytes(dir, &bytes, &err);
}

static const struct step {
    const char *name;
    enum status (*ask)(void);
    bool changes;
} steps[] = {
    {"replace", replace, true}, {"put_in_place", put_in_place, true},    {"read", read_it, false},
    {"list", list_it, false},   {"look_how_full", look_how_full, false},
};

static void strike(const struct step *step) {
    bool struck = true;
    for (long n = 1; struck && check_failed_count == 0; n++) {
        OK(file_replace(path, "old", 3, &err));
        system_faults_arm(n);
        enum status status = step->ask();
        struck = system_faults_lift();
        enum status wanted = !struck ? STATUS_OK : system_fault == ENOSPC ? STATUS_NO_SPACE : STATUS_IO;
        CHECK_THAT(status == wanted, "%s, call %ld: %s, not %s", step->name, n, status_name(status),
                   status_name(wanted));
        CHECK_THAT(!struck || strstr(err.message, dir), "%s, call %ld: %s", step->name, n, err.message);
        /* Once it has its name it is new, though that may not be on disk. */
        char *found = content();
        check_alone(step->changes && (!struck || strcmp(found, "new") == 0) ? "new" : "old");
        mem_free(found);
    }
}

/* A disk that only tells when a file is closed that it has no more room. */
static void check_closing(void) {
    OK(file_replace(path, "old", 3, &err));
    system_break(" close ", ENOSPC);
    CHECK(file_replace(path, "new", 3, &err) == STATUS_NO_SPACE);
    system_mend();
    CHECK_THAT(strstr(err.message, "cannot close") && strstr(err.message, path), "%s", err.message);
    check_alone("old");
    system_break(" write close ", EIO); /* what came first is told */
    CHECK(file_replace(path, "new", 3, &err) == STATUS_IO);
    system_mend();
    CHECK_THAT(strstr(err.message, "cannot write") && strstr(err.message, path), "%s", err.message);
    check_alone("old");
}

/* --- trees ------------------------------------------------------------------------------------------ */

static void plant(const char *tree) {
    char *inner = file_join(tree, "a/b"), *leaf = file_join(inner, "leaf");
    OK(file_make_dirs(inner, &err));
    OK(file_replace(leaf, "x", 1, &err));
    mem_free(leaf);
    mem_free(inner);
}

/* What is in the way of its size or removal is told; the removal is finished by the next one. */
static void check_trees(void) {
    char *tree = file_join(dir, "tree");
    uint64_t files, bytes;
    for (int is_removal = 0; is_removal < 2; is_removal++) {
        bool struck = true;
        for (long n = 1; struck && check_failed_count == 0; n++) {
            plant(tree);
            system_faults_arm(n);
            enum status status = is_removal ? file_remove_tree(tree, &err) : file_tree_size(tree, &files, &bytes, &err);
            struck = system_faults_lift();
            enum status wanted = !struck ? STATUS_OK : system_fault == ENOSPC ? STATUS_NO_SPACE : STATUS_IO;
            CHECK_THAT(status == wanted, "call %ld: %s, not %s", n, status_name(status), status_name(wanted));
            CHECK(struck ? strstr(err.message, tree) != NULL : is_removal || files == 1);
            CHECK(struck || !is_removal || access(tree, F_OK) != 0);
        }
    }
    OK(file_remove_tree(tree, &err));
    for (long n = 1; n < 20; n++) { /* making them goes on from where it was */
        char *inner = file_join(tree, "a/b");
        system_faults_arm(n);
        enum status status = file_make_dirs(inner, &err);
        bool struck = system_faults_lift();
        CHECK((status == STATUS_OK) == !struck);
        OK(file_make_dirs(inner, &err));
        CHECK(access(inner, F_OK) == 0);
        OK(file_remove_tree(tree, &err));
        mem_free(inner);
    }
    CHECK(file_tree_size(tree, &files, &bytes, &err) == STATUS_OK && files == 0 && bytes == 0);
    CHECK(file_tree_size("/dev/null/x", &files, &bytes, &err) == STATUS_IO && strstr(err.message, "cannot access"));
    mem_free(tree);
}

/* Somebody else removes the same meanwhile: what is gone is no fault. */
static void check_race(void) {
    char *tree = file_join(dir, "tree");
    uint64_t files, bytes;
    bool struck = true;
    for (long n = 1; struck; n++) {
        OK(file_make_dirs(tree, &err));
        for (int is_removal = 0; is_removal < 2; is_removal++) {
            system_faults_arm(n);
            system_fault = ENOENT;
            OK(is_removal ? file_remove_tree(tree, &err) : file_tree_size(tree, &files, &bytes, &err));
            struck = system_faults_lift();
        }
    }
    CHECK(access(tree, F_OK) != 0);
    mem_free(tree);
}

static void check_limit(void) {
    struct buf text;
    buf_init(&text, 2);
    OK(file_replace(path, "abc", 3, &err));
    CHECK(file_read(path, &text, &err) == STATUS_LIMIT);
    CHECK_THAT(strstr(err.message, "is larger than 2 bytes"), "%s", err.message);
    buf_release(&text);
}

int main(void) {
    if (!mkdtemp(dir))
        return 1;
    path = file_join(dir, "file");
    for (size_t i = 0; i < sizeof steps / sizeof *steps; i++)
        strike(&steps[i]);
    check_closing();
    check_trees();
    check_race();
    check_limit();
    mem_free(path);
    OK(file_remove_tree(dir, &err));
    return check_result();
}
