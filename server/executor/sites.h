/* sites.h -- the executors that the configuration names, "process slurm", in their order. */
#ifndef UNBAKE_EXECUTOR_SITES_H
#define UNBAKE_EXECUTOR_SITES_H

#include "server/executor/remote.h"

struct site_place {
    bool is_process; /* this machine; the rest is empty then */
    struct site site;
    struct command_queue *commands;
    struct remote *remote;
};

struct sites {
    struct site_place *place;         /* [count]; owned */
    const struct executor **executor; /* [count] after sites_start; owned */
    size_t count;
};

/* Reads DIR/NAME.conf of each name. Each fault appends a line to *problems. *sites needs sites_release in any case. */
void sites_read(struct sites *sites, const char *names, const char *dir, struct buf *problems);
/* Sets them to work; `wake` is called by other threads when there is something to do. Everything is borrowed. */
enum status sites_start(struct sites *sites, const struct executor *process, struct store *store, const char *data_dir,
                        void (*wake)(void *user), void *user, struct error *err);
/* After the scheduler that used them. */
void sites_release(struct sites *sites);

#endif
