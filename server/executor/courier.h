/* courier.h -- who runs a site's commands and brings back what they said. The scheduler's thread sends and receives,
 * and never waits: a command may take its whole deadline. */
#ifndef UNBAKE_EXECUTOR_COURIER_H
#define UNBAKE_EXECUTOR_COURIER_H

#include <stdbool.h>

#include "common/error.h"

enum errand_kind { ERRAND_SUBMIT, ERRAND_STATUS, ERRAND_CANCEL };

struct errand {
    enum errand_kind kind;
    char name[64]; /* of the attempt, as the site knows it; "" for status */
    char **argv;   /* owned, as words_free frees it */
    char *input;   /* owned; NULL: none */
    double begun;  /* when it was sent; the sender's clock */
    /* once it is done: */
    enum status status; /* as of command_run */
    char *output;       /* owned */
    struct error err;
};

void errand_free(struct errand *errand);

struct courier {
    void (*send)(struct courier *courier, struct errand *errand); /* takes it */
    /* One that is done, the caller's (errand_free); NULL: none is. In the order in which they were sent. */
    struct errand *(*receive)(struct courier *courier);
};

/* One thread, which does one errand after the other. `wake` is called on it after each. NULL with *err where there is
 * no thread. */
struct courier *courier_thread_new(double deadline_sec, void (*wake)(void *user), void *user, struct error *err);
/* Ends the command that runs, and drops the other errands. */
void courier_thread_free(struct courier *courier);

#endif
