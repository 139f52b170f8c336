/* test_delivery.c -- the call of a webhook, from the outbox to the entry of what became of it, while a call of SQLite
 * or of the system fails, or all from one on: a message is sent until it is taken, no more often than that takes, and
 * nothing of the call is left over. As worker stands in this program itself: `test_delivery worker DIR`. */
#include "server/job/delivery.h"

#include <signal.h>

#include "server/worker/progress.h"
#include "tests/unit/fault_rig.h"

/* --- the worker's side ------------------------------------------------------------------------------ */

/* Does what the URL says; its message is one line of the file DATA/sent. */
static int worker(const char *folder) {
    struct progress p = {.fd = PROGRESS_FD};
    const char *url;
    cJSON *order;
    char *path = file_join(folder, "job.json"), *sent = file_join(folder, "../../sent");
    if (json_read(path, 1 << 20, &order, &err) != STATUS_OK ||
        json_string(order, "url", "job.json", "", &url, &err) != STATUS_OK)
        return PROGRESS_EXIT_FAILED;
    FILE *file = fopen(sent, "ae");
    if (!file || fputs("sent\n", file) < 0 || fclose(file) != 0)
        return PROGRESS_EXIT_FAILED;
    if (strstr(url, "hang"))
        pause();
    progress_end(&p, strstr(url, "refuse") ? STATUS_UNAVAILABLE : STATUS_OK, "it answers 500", "");
    return strstr(url, "refuse") ? PROGRESS_EXIT_FAILED : PROGRESS_EXIT_OK;
}

/* --- the daemon's side ------------------------------------------------------------------------------ */

/* The messages that were sent; forgets them. */
static int count_sent(void) {
    char *path = file_join(dir, "sent");
    struct buf text;
    buf_init(&text, 4096);
    int count = file_read(path, &text, NULL) == STATUS_OK ? (int)(text.length / 5) : 0;
    unlink(path);
    buf_release(&text);
    mem_free(path);
    return count;
}

static int64_t count_outbox(void) {
    struct store_counts counts;
    OK(store_count(store, &counts, &err));
    return counts.outbox;
}

/* Nothing is left of a call. Empties it. */
static bool is_trash_empty(void) {
    char *path = file_join(dir, "trash"), **names;
    size_t count;
    if (file_list(path, &names, &count, &err) != STATUS_OK)
        CHECK(err.status == STATUS_NOT_FOUND);
    file_free_names(names, count);
    OK(file_remove_tree(path, &err));
    mem_free(path);
    return count == 0;
}

/* A message for `url`: of a job that starts, and ends. */
static void add_message(const char *url) {
    int number;
    int64_t id = add_job("{}", url);
    OK(store_job_start(store, id, "process", &number, &err));
}

static enum status start(struct delivery *d, struct error *why) {
    struct outbox_row row;
    bool was_off = faults_are_off;
    faults_are_off = true;
    OK(store_outbox_next(store, 0, NULL, 0, &row, &err));
    faults_are_off = was_off;
    enum status status = delivery_start(d, &config, &row, why);
    outbox_row_release(&row);
    return status;
}

static void wait_for(struct delivery *d) {
    while (!delivery_poll(d, store))
        usleep(1000);
}

/* False where there is no n-th call. */
static bool start_once(long n, bool stays) {
    struct delivery d = {0};
    struct error why = {0};
    int before = count_descriptors();
    add_message("http://127.0.0.1/take");
    log_forget();
    strike(false, n, stays);
    enum status status = start(&d, &why);
    bool struck = lift();
    if (status != STATUS_OK) {
        char *left = mem_printf("%s/trash/message-", dir);
        CHECK_THAT(*why.message && d.id == 0 && !has_child() && count_descriptors() == before && count_sent() == 0,
                   "call %ld: something is left", n);
        CHECK_THAT(is_trash_empty() || log_count(left) == 1, "call %ld: a folder is left, and nobody knows", n);
        CHECK(count_outbox() == 1);
        OK(start(&d, &err));
        mem_free(left);
    }
    wait_for(&d);
    CHECK_THAT(count_outbox() == 0 && count_sent() == 1 && is_trash_empty() && count_descriptors() == before,
               "call %ld", n);
    return struck;
}

/* While what became of it cannot be entered the message is not sent again, and the log says so once. */
static bool end_once(bool is_sql, long n, bool stays) {
    struct delivery d;
    add_message("http://127.0.0.1/take");
    log_forget();
    OK(start(&d, &err));
    strike(is_sql, n, stays);
    for (int i = 0; i < 60000 && !d.has_ended && d.id; i++, usleep(1000))
        delivery_poll(&d, store);
    if (d.id)
        delivery_poll(&d, store);
    bool struck = lift();
    CHECK(d.id == 0 || (d.has_ended && d.delivered));
    CHECK_THAT(log_count("outcome cannot be recorded") <= 1, "call %ld: the log is filled", n);
    wait_for(&d);
    CHECK_THAT(count_outbox() == 0 && count_sent() == 1, "call %ld of %s: it is sent again", n,
               is_sql ? "SQLite" : "the system");
    CHECK_THAT(is_trash_empty() || log_count("/trash/message-") == 1, "call %ld: a folder is left, and nobody knows",
               n);
    return struck;
}

/* A message that is not taken is given up at last; each time the log says why. */
static void check_refused(const char *url, const char *why) {
    struct delivery d;
    struct outbox_row row;
    int tries = 0;
    add_message(url);
    log_forget();
    OK(store_outbox_next(store, 0, NULL, 0, &row, &err)); /* the first time; later ones do not wait for theirs */
    for (; count_outbox() == 1 && tries < 1000; tries++) {
        CHECK_THAT(log_count("will not be again") == 0 && log_count(why) == tries, "try %d", tries);
        OK(delivery_start(&d, &config, &row, &err));
        if (strstr(url, "hang"))
            d.kill_at_sec = 0.0;
        wait_for(&d);
    }
    CHECK_THAT(tries == 30 && log_count("cannot be called, and will not be again: ") == 1 && log_count(why) == tries,
               "%d tries", tries);
    count_sent();
    outbox_row_release(&row);
}

/* When the daemon ends, what is under way is sent again by the next one, as is what could not be entered. */
static void check_stop(void) {
    struct delivery d;
    int before = count_descriptors();
    add_message("http://127.0.0.1/hang");
    OK(start(&d, &err));
    delivery_stop(&d, store);
    CHECK(d.id == 0 && !has_child() && count_outbox() == 1 && is_trash_empty());
    add_message("http://127.0.0.1/take");
    OK(start(&d, &err));
    strike_sql("COMMIT", 1, true);
    delivery_stop(&d, store);
    CHECK(lift() && d.id == 0 && !has_child() && count_outbox() == 2 && is_trash_empty());
    CHECK(count_descriptors() == before);
}

int main(int argc, char **argv) {
    if (argc == 3 && strcmp(argv[1], "worker") == 0)
        _exit(worker(argv[2]));
    long strikes = 0;
    rig_start();
    for (int stays = 0; stays < 2; stays++) {
        for (long n = 1; start_once(n, stays) && check_failed_count == 0; n++)
            strikes++;
        for (int is_sql = 0; is_sql < 2; is_sql++)
            for (long n = 1; end_once(is_sql, n, stays) && check_failed_count == 0; n++)
                strikes++;
    }
    check_refused("http://127.0.0.1/refuse", "it answers 500");
    check_refused("http://127.0.0.1/hang", "it timed out");
    check_stop();
    rig_stop();
    printf("%ld calls failed\n", strikes);
    return check_result();
}
