/* credentials.h -- the tokens that `unbake login` stores, one for each server: $XDG_CONFIG_HOME/unbake/tokens, else
 * ~/.config/unbake/tokens, mode 0600, lines "URL TOKEN". */
#ifndef UNBAKE_CLIENT_CREDENTIALS_H
#define UNBAKE_CLIENT_CREDENTIALS_H

#include "common/error.h"

/* The token for that server, NULL if there is none; the caller's (mem_free). STATUS_IO, with a hint, when others can
 * read the file; it is then not used. */
enum status credentials_find(const char *server, char **token, struct error *err);
/* Stores the token in place of an earlier one; NULL: removes it. */
enum status credentials_keep(const char *server, const char *token, struct error *err);
/* The token that a file of its own holds, with blanks around it at most; the caller's. STATUS_IO, with a hint, when
 * others can read the file; STATUS_INPUT when it holds no token. */
enum status credentials_read(const char *path, char **token, struct error *err);
/* Path of a file in $XDG_CONFIG_HOME/unbake, else ~/.config/unbake; the caller's (mem_free). NULL where no home folder
 * is known. */
char *credentials_folder_file(const char *name);

#endif
