/* credentials.h -- the tokens that `unbake login` keeps: one a server, in a file that nobody else
 * can read.
 *
 *   $XDG_CONFIG_HOME/unbake/tokens, else ~/.config/unbake/tokens, mode 0600: lines "URL TOKEN"
 */
#ifndef UNBAKE_CLIENT_CREDENTIALS_H
#define UNBAKE_CLIENT_CREDENTIALS_H

#include "common/error.h"

/* The token for that server, NULL without one; the caller's (mem_free). STATUS_IO, with what to do
 * about it, when others can read the file: it is then not used. */
enum status credentials_find(const char *server, char **token, struct error *err);
/* Keeps the token (NULL: forgets it) in place of the one that was there. */
enum status credentials_keep(const char *server, const char *token, struct error *err);
/* Where they are kept; the caller's (mem_free). NULL where there is no home. */
char *credentials_path(void);

#endif
