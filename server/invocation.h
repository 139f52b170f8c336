/* invocation.h -- a command line of `unbaked` and the configuration that it names.
 *
 * Options come from their defaults, then the file, then the command line. */
#ifndef UNBAKE_SERVER_INVOCATION_H
#define UNBAKE_SERVER_INVOCATION_H

#include <stdbool.h>

#include "server/arguments.h"
#include "server/config.h"

#define CONFIG_FILE_DEFAULT "/etc/unbaked.conf" /* of the commands; the daemon is told its file */

struct invocation {
    struct config config;
    struct options arguments;
};

/* Every command that works on a data folder takes these: --config, --data, --set. */
#define INVOCATION_FLAGS                                                                                               \
    {"config", 0, OPTION_TEXT, "FILE", "read options from FILE; unbaked.conf(5) lists them"},                          \
        {"data", 0, OPTION_TEXT, "DIR", "the same as --set data_dir=DIR"}, {                                           \
        "set", 0, OPTION_TEXT, "NAME=VALUE", "an option; wins over the file"                                           \
    }

/* Reads argv[1...]. Faults are told on stderr, all those of the configuration at once. -1 to go
 * on, or the exit status. Needs invocation_release in any case. `config_file` is read where no
 * --config or --data is given and it is there; NULL: none. */
int invocation_read(struct invocation *in, int argc, char **argv, const struct command_option *flags,
                    const char *config_file);
void invocation_release(struct invocation *in);

static inline bool invocation_has(const struct invocation *in, const char *flag) {
    return options_flag(&in->arguments, flag);
}

static inline const char *invocation_value(const struct invocation *in, const char *flag, const char *fallback) {
    return options_text(&in->arguments, flag, fallback);
}

#endif
