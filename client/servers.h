/* servers.h -- servers that have names: $XDG_CONFIG_HOME/unbake/config, else ~/.config/unbake/config.
 *
 *      server = lab                     # taken where neither --server nor $UNBAKE_SERVER says another
 *
 *      [lab]
 *      url = https://unbake.lab.example.org
 *      ca = lab.pem                     # certificates to trust; optional
 *      token_file = lab.token           # a file with the token alone, mode 0600; optional
 *
 * A relative path begins where the file lies; "~/" is the home folder. The file holds no secrets, but says where tokens
 * are sent to: it is refused when others can write to it. */
#ifndef UNBAKE_CLIENT_SERVERS_H
#define UNBAKE_CLIENT_SERVERS_H

#include <stddef.h>

#include "common/error.h"
#include "common/options.h"

struct server_entry {
    char *name, *url, *ca, *token_file; /* NULL: not said (name and url are); owned */
};

struct servers {
    char *path;   /* of the file; NULL: no home folder is known */
    char *chosen; /* the name after `server =`; NULL: none */
    struct server_entry *entry;
    size_t count;
};

/* Reads the file; none at all is no error. STATUS_INPUT names the line. Release also after an error. */
enum status servers_read(struct servers *s, struct error *err);
void servers_release(struct servers *s);

/* What --server or $UNBAKE_SERVER says, a URL or a name; NULL: neither. */
const char *servers_word(const struct options *o);
/* What `word` means: a URL is itself (*entry NULL), a name its entry. NULL: the server of the file, else the default.
 * *url is borrowed from *s or `word`. STATUS_INPUT: no such name. */
enum status servers_find(const struct servers *s, const char *word, const char **url, const struct server_entry **entry,
                         struct error *err);

#endif
