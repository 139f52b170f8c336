/* collection.h -- shared by `scenes` and `uploads`: list, show, keep, rm. */
#ifndef UNBAKE_CLIENT_COLLECTION_H
#define UNBAKE_CLIENT_COLLECTION_H

#include "client/client.h"

struct collection {
    const char *name;                                        /* of the command, "scenes" */
    const char *one;                                         /* "scene" */
    const char *path;                                        /* "/v1/scenes" */
    void (*print_all)(struct client *c, const cJSON *items); /* at least one */
    void (*print_one)(struct client *c, const cJSON *thing);
    const char *further; /* an action that only this command has, elsewhere; NULL: none */
};

extern const struct command_option collection_options[];

/* Runs such a command. */
int collection_run(struct client *c, const struct options *o, const struct collection *what);

#endif
