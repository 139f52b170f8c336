/* background.h -- one thread beside those that answer requests, with the mutex and the condition that its owner shares
 * with it. It begins with background_start and ends with background_stop; all signals are blocked in it. */
#ifndef UNBAKE_COMMON_BACKGROUND_H
#define UNBAKE_COMMON_BACKGROUND_H

#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>

#include "common/error.h"

struct background {
    pthread_t thread;
    pthread_mutex_t mutex;  /* guards what the owner keeps beside this */
    pthread_cond_t changed; /* for changes of that; by CLOCK_MONOTONIC */
    atomic_bool stopping;   /* run() returns as soon as it can; set under the mutex, may be read without */
};

/* Starts run(user). `purpose` completes the message "cannot start the thread that ...". */
enum status background_start(struct background *b, void *(*run)(void *user), void *user, const char *purpose,
                             struct error *err);
/* Sets `stopping`, wakes the thread and waits for its end. */
void background_stop(struct background *b);

/* Under the mutex: waits for a change, or until clock_sec() is `until_sec`: then false. */
bool background_wait_until(struct background *b, double until_sec);

#endif
