/* scheduler.c -- see scheduler.h.
 *
 * One loop: give free slots to what waits, tell workers what is requested of them, sleep in poll
 * until a worker says something, ends, must be killed, or somebody calls. While nothing happens
 * it does not wake up.
 *
 * Slots 0 .. max_running - 1 run jobs, the next small_renders small renders, the others check scenes: a check and a
 * small render are short and must not wait behind hours of work; nor a check behind another user's: checks.c. */
#include "server/job/scheduler.h"

#include <errno.h>
#include <math.h>
#include <poll.h>
#include <sched.h>
#include <stdatomic.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "common/clock.h"
#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"
#include "server/job/attempt.h"
#include "server/job/checks.h"
#include "server/job/deliveries.h"
#include "server/job/disk_usage.h"
#include "server/job/disk_watch.h"
#include "server/job/dispatch.h"
#include "server/job/housekeeping.h"
#include "server/job/outcome.h"
#include "server/job/resume.h"
#include "server/job/worker_messages.h"

#define HOUSEKEEPING_SEC 600.0 /* between two calls of housekeeping_run */
#define RETRY_SEC 5.0          /* after a failure of the store or of a start */

struct scheduler {
    struct scheduler_config config;
    struct store *store;
    int wake_fd; /* an eventfd: many calls become one wake-up */
    atomic_bool stopping;
    atomic_int running;
    struct counters counters;
    atomic_ulong rounds;
    struct dispatch dispatch;
    size_t slot_count;
    struct attempt *slot; /* [slot_count]; the first dispatch.job_slots run jobs */
    struct checks checks;
    struct trash *trash;    /* NULL: this thread removes trees itself */
    bool must_retry;        /* something failed that may work later */
    double housekeeping_at; /* when it is due, as clock_sec */
    struct disk_watch disk;
    atomic_bool waits_for_disk; /* disk.is_low, for other threads */
    uint64_t check_room;        /* free bytes above which scenes that had too little are checked again; 0: none waits */
    struct deliveries deliveries;
    struct pollfd *poll; /* [1 + RUN_FDS * (slot_count + DELIVERIES_AT_ONCE)] */
};

enum status scheduler_new(struct scheduler **out, const struct scheduler_config *config, struct store *store,
                          struct error *err) {
    *out = NULL;
    int fd = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (fd < 0)
        return error_set_errno(err, errno, "cannot make an eventfd");
    struct scheduler *s = mem_calloc(1, sizeof *s);
    s->config = *config;
    s->store = store;
    s->wake_fd = fd;
    disk_watch_init(&s->disk, config->low_disk_bytes);
    if (s->config.thread_count <= 0) {
        cpu_set_t set;
        s->config.thread_count = sched_getaffinity(0, sizeof set, &set) == 0 ? CPU_COUNT(&set) : 1;
    }
    if (config->small_renders == 0)
        s->config.small_render_cost = 0.0; /* without a lane of their own they wait with the others */
    dispatch_init(&s->dispatch, &s->config, store, &s->counters);
    s->slot_count = s->dispatch.job_slots + (size_t)(config->max_checks > 0 ? config->max_checks : CHECKS_AT_ONCE);
    s->dispatch.slot = s->slot = mem_calloc(s->slot_count, sizeof *s->slot);
    s->poll = mem_calloc(1 + RUN_FDS * (s->slot_count + DELIVERIES_AT_ONCE), sizeof *s->poll);
    *out = s;
    return STATUS_OK;
}

void scheduler_use_trash(struct scheduler *s, struct trash *trash) { s->trash = trash; }

void scheduler_free(struct scheduler *s) {
    if (!s)
        return;
    close(s->wake_fd);
    for (size_t i = 0; i < s->slot_count; i++) /* what outlives this daemon, and what could not be entered */
        attempt_empty(&s->slot[i]);
    dispatch_release(&s->dispatch);
    mem_free(s->slot);
    mem_free(s->poll);
    mem_free(s);
}

void scheduler_wake(struct scheduler *s) {
    uint64_t one = 1;
    /* write fails only when the counter is full; then the loop is awake already */
    if (write(s->wake_fd, &one, sizeof one) < 0)
        return;
}

void scheduler_stop(struct scheduler *s) {
    atomic_store(&s->stopping, true);
    scheduler_wake(s);
}

const struct counters *scheduler_counters(const struct scheduler *s) { return &s->counters; }

int scheduler_running(const struct scheduler *s) { return atomic_load(&s->running); }

bool scheduler_waits_for_disk(const struct scheduler *s) { return atomic_load(&s->waits_for_disk); }

/* A failure that is not the job's fault: log it once per round and retry. */
static void retry_later(struct scheduler *s, const char *what, const struct error *err) {
    if (!s->must_retry)
        log_error("%s: %s", what, err->message);
    s->must_retry = true;
}

/* A check that fails for lack of space fills the disk for a moment. It is retried only when there is clearly more
 * space: an eighth more. */
static void postpone_check(struct scheduler *s) {
    uint64_t room = 0;
    struct error err;
    if (file_free_bytes(s->config.data_dir, &room, &err) != STATUS_OK)
        log_warning("%s", err.message);
    s->check_room = room + room / 8 + 1;
}

static enum status check_again(struct scheduler *s, struct error *err) {
    uint64_t room;
    if (s->check_room == 0)
        return STATUS_OK;
    enum status status = file_free_bytes(s->config.data_dir, &room, err);
    if (status != STATUS_OK || room < s->check_room)
        return status;
    status = store_scene_check_again(s->store, err);
    if (status == STATUS_OK)
        s->check_room = 0;
    return status;
}

static void start_checks(struct scheduler *s) {
    struct attempt *slots = s->slot + s->dispatch.job_slots;
    struct error err;
    enum status status = check_again(s, &err);
    for (size_t i = 0; i < s->slot_count - s->dispatch.job_slots && status == STATUS_OK; i++) {
        struct unchecked next;
        if (slots[i].phase != ATTEMPT_EMPTY)
            continue;
        status = checks_next(&s->checks, s->store, slots, s->slot_count - s->dispatch.job_slots, &next, &err);
        if (status == STATUS_OK)
            status = attempt_start_check(&slots[i], &s->config, s->store, &next, s->config.thread_count, &err);
    }
    if (status != STATUS_OK && status != STATUS_NOT_FOUND)
        retry_later(s, "cannot check a scene", &err);
}

/* The request now, force after the grace period. */
static void ask_to_stop(struct scheduler *s, struct attempt *a) {
    if (a->phase != ATTEMPT_ALIVE || a->stopping)
        return;
    a->stopping = true;
    a->kill_at_sec = clock_sec() + s->config.stop_grace_sec + a->run->slow_sec;
    run_ask(a->run, RUN_STOP);
}

static void kill_now(struct attempt *a) {
    a->killed = true;
    a->kill_at_sec = 0.0;
    run_ask(a->run, RUN_KILL);
}

static void follow_wish(struct scheduler *s, struct attempt *a, enum job_wanted wanted) {
    if (wanted == JOB_WANT_PAUSE) {
        ask_to_stop(s, a);
    } else if (wanted == JOB_WANT_CANCEL && !a->killed) {
        a->stopping = true;
        kill_now(a); /* its state is no longer wanted */
    }
}

/* An attempt that the store has as running, and nobody else: entering its false start had failed. Or a job of which
 * none runs: no part of it could begin. */
static void requeue_orphan(struct scheduler *s, const struct attempt_key *key) {
    struct error err;
    enum status status = key->number ? store_job_stop(s->store, key->job_id, key->number, "its start failed", &err)
                                     : store_job_yield(s->store, key->job_id, "", &err);
    if (status != STATUS_OK && status != STATUS_CONFLICT)
        retry_later(s, "cannot queue a job again", &err);
}

static void follow_wishes(struct scheduler *s) {
    size_t limit = s->slot_count + 16, count; /* any further orphans are handled in the next round */
    struct running *list = mem_array(limit, sizeof *list);
    struct error err;
    if (store_job_running(s->store, limit, list, &count, &err) != STATUS_OK) {
        retry_later(s, "cannot read the users' requests", &err);
        count = 0;
    }
    for (size_t i = 0; i < count; i++) {
        struct attempt *a = NULL;
        for (size_t k = 0; k < s->dispatch.job_slots && !a; k++)
            if (s->slot[k].phase != ATTEMPT_EMPTY && s->slot[k].job_id == list[i].key.job_id &&
                s->slot[k].number == list[i].key.number)
                a = &s->slot[k];
        if (!a)
            requeue_orphan(s, &list[i].key);
        else if (a->phase == ATTEMPT_ALIVE)
            follow_wish(s, a, list[i].wanted);
    }
    mem_free(list);
}

static bool outlives(const struct attempt *a) { return a->run && a->run->outlives; }

static bool any_alive(const struct scheduler *s) {
    for (size_t i = 0; i < s->slot_count; i++)
        if (s->slot[i].phase == ATTEMPT_ALIVE && !(atomic_load(&s->stopping) && outlives(&s->slot[i])))
            return true;
    return false;
}

/* While the disk is nearly full, running jobs are stopped at a checkpoint, and queued jobs give the reason. */
static void watch_disk(struct scheduler *s) {
    struct error err;
    bool changed = disk_watch_check(&s->disk, s->config.data_dir);
    atomic_store(&s->waits_for_disk, s->disk.is_low);
    if (!changed && !s->disk.is_low)
        return;
    dispatch_forget_reasons(&s->dispatch); /* the reason that a job waits is the disk now, or none */
    for (size_t i = 0; s->disk.is_low && i < s->dispatch.job_slots; i++)
        ask_to_stop(s, &s->slot[i]);
    if (store_job_explain(s->store, 0, s->disk.is_low ? s->disk.reason : "", DISK_REASON,
                          s->disk.is_low ? DISK_HINT : "", &err) != STATUS_OK)
        retry_later(s, "cannot say why jobs wait", &err);
}

/* Kills workers whose time is up; returns how long the loop may sleep. */
static double keep_deadlines(struct scheduler *s) {
    double now = clock_sec(), sleep = s->must_retry ? RETRY_SEC : (double)INFINITY;
    if (any_alive(s) || s->disk.is_low)
        sleep = fmin(sleep, fmax(s->disk.looked_at + DISK_LOOK_SEC - now, 0.01));
    if (s->check_room)
        sleep = fmin(sleep, DISK_LOOK_SEC);
    if (!atomic_load(&s->stopping))
        sleep = fmin(sleep, fmax(fmin(s->housekeeping_at, s->deliveries.due_at) - now, 0.0));
    for (size_t i = 0; i < s->slot_count; i++) {
        struct attempt *a = &s->slot[i];
        if (a->phase != ATTEMPT_ALIVE)
            continue;
        if (a->kill_at_sec > 0.0 && a->kill_at_sec <= now)
            kill_now(a);
        if (a->kill_at_sec > 0.0)
            sleep = fmin(sleep, a->kill_at_sec - now);
    }
    return sleep;
}

unsigned long scheduler_rounds(const struct scheduler *s) { return atomic_load(&s->rounds); }

/* Sleeps until somebody calls, something is heard of a run, or that time is over. */
static void wait_for_something(struct scheduler *s, double sleep) {
    double look;
    nfds_t count = 0;
    atomic_fetch_add(&s->rounds, 1);
    s->poll[count++] = (struct pollfd){.fd = s->wake_fd, .events = POLLIN};
    for (size_t i = 0; i < s->slot_count; i++) {
        const struct attempt *a = &s->slot[i];
        if (a->phase != ATTEMPT_ALIVE)
            continue;
        count += run_poll(a->run, s->poll + count, &look);
        sleep = fmin(sleep, look);
    }
    if (!atomic_load(&s->stopping)) { /* else nobody listens to them */
        count += deliveries_poll(&s->deliveries, s->poll + count, &look);
        sleep = fmin(sleep, look);
    }
    /* Rounded up: rounded down, the loop would spin. A signal ends it early, which is harmless. */
    poll(s->poll, count, isinf(sleep) ? -1 : (int)ceil(sleep * 1000.0));
    uint64_t calls;
    if (s->poll[0].revents && read(s->wake_fd, &calls, sizeof calls) < 0)
        return;
}

static void listen_and_settle(struct scheduler *s) {
    int running = 0;
    for (size_t i = 0; i < s->slot_count; i++) {
        struct attempt *a = &s->slot[i];
        struct error err;
        worker_messages_read(a, s->store, &s->counters);
        bool is_postponed = i >= s->dispatch.job_slots && outcome_lacks_space(a);
        if (a->phase == ATTEMPT_ENDED && outcome_settle(a, s->store, s->trash, &s->counters, &err) != STATUS_OK)
            retry_later(s, "cannot record how an attempt ended", &err);
        else if (is_postponed)
            postpone_check(s);
        running += a->phase == ATTEMPT_ALIVE;
    }
    atomic_store(&s->running, running);
}

static void keep_house(struct scheduler *s) {
    if (clock_sec() < s->housekeeping_at)
        return;
    housekeeping_run(&s->config, s->store);
    s->housekeeping_at = clock_sec() + HOUSEKEEPING_SEC;
}

enum status scheduler_run(struct scheduler *s, struct error *err) {
    size_t requeued;
    housekeeping_after_kill(&s->config, s->store);
    enum status status =
        resume_all(s->slot, s->dispatch.job_slots, &s->dispatch.places, &s->config, s->store, &requeued, err);
    if (status == STATUS_OK)
        status = store_scene_check_again(s->store, err);
    if (status != STATUS_OK)
        return status;
    if (requeued)
        log_info("%zu jobs that ran when the daemon ended are queued again", requeued);
    disk_usage_enter_unknown(&s->config, s->store);
    for (;;) {
        bool stopping = atomic_load(&s->stopping);
        s->must_retry = false;
        listen_and_settle(s);
        if (stopping) {
            for (size_t i = 0; i < s->slot_count; i++)
                if (!outlives(&s->slot[i]))
                    ask_to_stop(s, &s->slot[i]);
            if (!any_alive(s))
                break;
        } else {
            watch_disk(s);
            start_checks(s);
            struct error why;
            if (!s->disk.is_low && dispatch_start(&s->dispatch, &why) != STATUS_OK)
                retry_later(s, "cannot start a job", &why);
            keep_house(s);
            if (deliveries_run(&s->deliveries, &s->config, s->store, &why) != STATUS_OK)
                retry_later(s, "cannot call a webhook", &why);
        }
        follow_wishes(s);
        wait_for_something(s, keep_deadlines(s));
    }
    (void)store_usage_pay(s->store, NULL);
    deliveries_stop(&s->deliveries, s->store);
    /* Attempts that could not be entered are "running" in the store; the next start queues them again. */
    return STATUS_OK;
}
