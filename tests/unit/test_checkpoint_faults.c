/* test_checkpoint_faults.c -- a call of SQLite or of the system fails a checkpoint while it is opened, saved, loaded or
 * cleared, or all from one on: what was saved last is what the next attempt finds, whole, or it is told why not. */
#include "server/worker/checkpoint.h"
#include "server/worker/checkpoint_file.h"

#include "common/file.h"
#include "common/mem.h"
#include "tests/check.h"
#include "tests/system_faults.h"

static struct error err;
#define OK(call) CHECK_THAT((call) == STATUS_OK, "%s", err.message)

#define ARRAYS 3
#define NAME "scene+settings"

static char dir[64], note[512];
static char *path;
static long strikes, iteration; /* that was saved last */
static uint32_t texture[CHECKPOINT_TILE_BYTES / 4 + 3], counter[2];
static struct state_array array[ARRAYS] = {
    {"texture", texture, sizeof texture, 1}, {"counter", counter, sizeof counter, 1}, {"empty", counter, 0, 1}};

/* One tile stays as it is. */
static void set(long k) {
    memset(texture, 7, sizeof texture);
    texture[sizeof texture / 4 - 1] = counter[0] = counter[1] = (uint32_t)k;
}

static bool is(long k) {
    bool same = texture[0] == 0x07070707 && texture[sizeof texture / 4 - 1] == (uint32_t)k;
    return same && counter[0] == (uint32_t)k && counter[1] == (uint32_t)k;
}

static void arm(bool is_sql, long n, bool stays) {
    faults_are_off = false;
    if (is_sql)
        sql_faults_arm_only(NULL, n, stays);
    else
        system_faults_arm_only(NULL, n, stays);
}

static bool lift(bool is_sql) {
    faults_are_off = true;
    return is_sql ? sql_faults_lift() : system_faults_lift();
}

static struct checkpoint *open_it(void) {
    struct checkpoint *c = NULL;
    OK(checkpoint_open(&c, path, NAME, note, &err));
    return c;
}

/* What an attempt would find; 0: nothing. */
static long find(void) {
    struct checkpoint *c = open_it();
    bool found = false;
    long at = 0;
    set(-1);
    OK(checkpoint_load(c, array, ARRAYS, &found, &at, &err));
    CHECK(!*note && (!found || is(at)));
    checkpoint_close(c);
    return found ? at : 0;
}

static void save(void) {
    struct checkpoint *c = open_it();
    set(++iteration);
    OK(checkpoint_save(c, iteration, array, ARRAYS, NULL, &err));
    checkpoint_close(c);
}

static void drop(void) {
    char *journal = mem_printf("%s-journal", path);
    OK(file_remove_tree(journal, &err));
    OK(file_remove_tree(path, &err));
    mem_free(journal);
    iteration = 0;
}

/* Damage that is told of costs what was there; nothing else does. */
static bool open_once(bool is_sql, long n, bool stays) {
    struct checkpoint *c = NULL;
    save();
    arm(is_sql, n, stays);
    err = (struct error){0};
    enum status status = checkpoint_open(&c, path, NAME, note, &err);
    bool struck = lift(is_sql);
    CHECK((status == STATUS_OK) == (c != NULL));
    CHECK_THAT(status == STATUS_OK || (struck && *err.message), "call %ld: no sentence", n);
    checkpoint_close(c);
    bool is_lost = *note != '\0';
    CHECK_THAT(!is_lost || strstr(note, "cannot be used"), "%s", note);
    long found = find();
    CHECK_THAT(found == iteration || (is_lost && found == 0), "call %ld: %ld is found, not %ld", n, found, iteration);
    return struck;
}

/* One of another scene gives way, now or at the next attempt. */
static bool replace_once(bool is_sql, long n, bool stays) {
    struct checkpoint *c = NULL;
    save();
    arm(is_sql, n, stays);
    err = (struct error){0};
    enum status status = checkpoint_open(&c, path, "another", note, &err);
    bool struck = lift(is_sql);
    CHECK_THAT(status == STATUS_OK || (struck && *err.message && !c), "call %ld: no sentence", n);
    checkpoint_close(c);
    OK(checkpoint_open(&c, path, "another", note, &err));
    bool found = true;
    OK(checkpoint_load(c, array, ARRAYS, &found, &(long){0}, &err));
    CHECK(!found);
    checkpoint_close(c);
    drop();
    return struck;
}

static bool save_once(bool is_sql, long n, bool stays) {
    struct checkpoint *c;
    struct checkpoint_cost cost = {0};
    if (n % 2)
        save(); /* else there is none yet */
    else
        drop();
    c = open_it();
    set(iteration + 1);
    arm(is_sql, n, stays);
    enum status status = checkpoint_save(c, iteration + 1, array, ARRAYS, &cost, &err);
    bool struck = lift(is_sql);
    CHECK_THAT(status == STATUS_OK || (struck && *err.message && cost.tile_count == 0), "call %ld: no sentence", n);
    iteration += status == STATUS_OK;
    if (n % 4 < 2) { /* the same attempt goes on */
        set(++iteration);
        OK(checkpoint_save(c, iteration, array, ARRAYS, NULL, &err));
    }
    checkpoint_close(c);
    CHECK_THAT(find() == iteration, "call %ld: it is not what was saved last", n);
    return struck;
}

static bool load_once(bool is_sql, long n, bool stays) {
    bool found = true;
    long at = 0;
    save();
    struct checkpoint *c = open_it();
    arm(is_sql, n, stays);
    enum status status = checkpoint_load(c, array, ARRAYS, &found, &at, &err);
    bool struck = lift(is_sql);
    CHECK_THAT(found == (status == STATUS_OK) && (found || (struck && *err.message)), "call %ld", n);
    OK(checkpoint_load(c, array, ARRAYS, &found, &at, &err));
    CHECK(found && at == iteration && is(at));
    checkpoint_close(c);
    return struck;
}

static bool clear_once(bool is_sql, long n, bool stays) {
    save();
    struct checkpoint *c = open_it();
    arm(is_sql, n, stays);
    enum status status = checkpoint_clear(c, &err);
    bool struck = lift(is_sql), found;
    long at;
    CHECK_THAT(status == STATUS_OK || (struck && *err.message), "call %ld: no sentence", n);
    OK(checkpoint_load(c, array, ARRAYS, &found, &at, &err));
    CHECK(found == (status != STATUS_OK));
    checkpoint_close(c);
    CHECK(find() == (found ? iteration : 0));
    return struck;
}

int main(void) {
    static bool (*const all[])(bool is_sql, long n, bool stays) = {open_once, replace_once, save_once, load_once,
                                                                   clear_once};
    snprintf(dir, sizeof dir, "%s/unbake-test-checkpoint-XXXXXX", check_fast_dir());
    if (!mkdtemp(dir))
        return 1;
    path = file_join(dir, "checkpoint.db");
    faults_are_off = true;
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        for (int way = 0; way < 4; way++)
            for (long n = 1; all[i](way % 2, n, way / 2) && check_failed_count == 0; n++)
                strikes++;
    OK(file_remove_tree(dir, &err));
    mem_free(path);
    printf("%ld calls failed\n", strikes);
    return check_result();
}
