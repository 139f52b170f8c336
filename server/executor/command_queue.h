/* command_queue.h -- runs a site's commands one after another on a thread of its own, so that the scheduler's thread
 * never waits for one: a command may take its whole deadline. The functions behind the interface are those of a thread,
 * or of a model in tests. */
#ifndef UNBAKE_EXECUTOR_COMMAND_QUEUE_H
#define UNBAKE_EXECUTOR_COMMAND_QUEUE_H

#include "common/error.h"

enum site_command_kind { SITE_COMMAND_SUBMIT, SITE_COMMAND_STATUS, SITE_COMMAND_CANCEL };

struct site_command {
    enum site_command_kind kind;
    char name[64]; /* of the attempt, as the site knows it; "" for status */
    char **argv;   /* owned, as words_free frees it */
    char *input;   /* owned; NULL: none */
    double begun;  /* when it was added; seconds, the caller's clock */
    /* once it is done: */
    enum status status; /* as of command_run */
    char *output;       /* owned */
    struct error err;
};

void site_command_free(struct site_command *command);

struct command_queue {
    void (*add)(struct command_queue *commands, struct site_command *command); /* takes it */
    /* One that is done, the caller's (site_command_free); NULL: none is. In the order in which they were added. */
    struct site_command *(*next_done)(struct command_queue *commands);
};

/* deadline_sec: of each command. `wake` is called on the queue's thread after each. NULL with *err where the thread
 * cannot be started. */
struct command_queue *command_queue_new(double deadline_sec, void (*wake)(void *user), void *user, struct error *err);
/* Kills the command that runs, and drops those that wait. NULL is allowed. */
void command_queue_free(struct command_queue *commands);

#endif
