/* background.c -- see background.h. */
#include "common/background.h"

#include <signal.h>
#include <time.h>

enum status background_start(struct background *b, void *(*run)(void *user), void *user, const char *purpose,
                             struct error *err) {
    pthread_condattr_t monotonic;
    sigset_t all, before;
    atomic_init(&b->stopping, false);
    pthread_mutex_init(&b->mutex, NULL);
    pthread_condattr_init(&monotonic);
    pthread_condattr_setclock(&monotonic, CLOCK_MONOTONIC);
    pthread_cond_init(&b->changed, &monotonic);
    pthread_condattr_destroy(&monotonic);
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    int failed = pthread_create(&b->thread, NULL, run, user);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    if (failed == 0)
        return STATUS_OK;
    pthread_cond_destroy(&b->changed);
    pthread_mutex_destroy(&b->mutex);
    return error_set_errno(err, failed, "cannot start the thread that %s", purpose);
}

void background_stop(struct background *b) {
    pthread_mutex_lock(&b->mutex);
    atomic_store(&b->stopping, true);
    pthread_cond_broadcast(&b->changed);
    pthread_mutex_unlock(&b->mutex);
    pthread_join(b->thread, NULL);
    pthread_cond_destroy(&b->changed);
    pthread_mutex_destroy(&b->mutex);
}

bool background_wait_until(struct background *b, double until_sec) {
    struct timespec until = {.tv_sec = (time_t)until_sec};
    until.tv_nsec = (long)(1e9 * (until_sec - (double)until.tv_sec));
    return pthread_cond_timedwait(&b->changed, &b->mutex, &until) == 0;
}
