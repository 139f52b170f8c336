/* test_delivery_turns.c -- one user's receivers that hang do not hold up another user's webhook: six jobs of one, one
 * of another. The worker that delivers is this program. */
#include "tests/unit/scheduler_rig.h"

enum { ANNA = 1, BERT };

static int play(const char *role, const char *dir, int attempt) {
    (void)role, (void)dir, (void)attempt;
    return 91;
}

static int play_check(const char *role, const char *dir) {
    (void)role, (void)dir;
    return 91;
}

/* A call: of a URL with "hang" in it, until it is killed. */
static int deliver(const char *dir) {
    struct buf order;
    struct progress p = {.fd = PROGRESS_FD};
    char *path = file_join(dir, "job.json");
    buf_init(&order, 1 << 20);
    if (file_read(path, &order, &err) != STATUS_OK)
        return 93;
    while (strstr(buf_text(&order), "hang"))
        usleep(WAIT_US);
    progress_end(&p, STATUS_OK, "", "");
    return 0;
}

static int64_t add_job(struct daemon *d, int64_t owner, const char *url) {
    struct job_new new = {.scene_id = SCENE_A,
                          .name = "n",
                          .labels = "{}",
                          .settings = "{}",
                          .max_attempts = 1,
                          .owner_id = owner,
                          .webhook_url = url,
                          .webhook_secret = "0123456789abcdef"};
    int64_t id = 0;
    bool replayed;
    OK(store_job_add(d->store, &new, 1000, &id, &replayed, &err));
    OK(store_job_cancel(d->store, id, &err)); /* which is told; no job runs here */
    return id;
}

static bool is_delivered(struct daemon *d, int64_t id) {
    struct job job;
    OK(store_job_get(d->store, id, &job, &err));
    bool done = strstr(job.delivery, "\"state\":\"delivered\"") != NULL;
    job_release(&job);
    return done;
}

int main(int argc, char **argv) {
    struct daemon d;
    bool existed;
    if (argc == 3 && strcmp(argv[1], "worker") == 0 && strstr(argv[2], "/message-"))
        _exit(deliver(argv[2]));
    daemon_begin(&d, argc, argv);
    OK(store_open(&d.store, d.dir, &err)); /* all of it is there when the scheduler begins */
    OK(store_scene_add(d.store, SCENE_A, "scene", 1, ANNA, &existed, &err));
    OK(store_scene_ready(d.store, SCENE_A, NULL, "{}", &err));
    int64_t hanging[12], quick;
    for (int i = 0; i < 12; i++)
        hanging[i] = add_job(&d, ANNA, "http://127.0.0.1/hang");
    quick = add_job(&d, BERT, "http://127.0.0.1/quick");
    store_close(d.store);
    daemon_start(&d, 1, "/proc/self/exe");
    /* In less time than the first of the calls that hang is given (20 s): none of them has ended. */
    int tries = 0;
    while (!is_delivered(&d, quick) && tries++ < WAIT_TRIES)
        usleep(WAIT_US);
    struct job job;
    CHECK(is_delivered(&d, quick));
    for (int i = 0; i < 12; i++) {
        OK(store_job_get(d.store, hanging[i], &job, &err));
        CHECK_THAT(strstr(job.delivery, "\"attempts\":0"), "job %d: %s", i, job.delivery);
        job_release(&job);
    }
    daemon_stop(&d);
    daemon_end(&d);
    return check_result();
}
