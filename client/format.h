/* format.h -- in which form the commands that list or show something print it: --format, -o. */
#ifndef UNBAKE_CLIENT_FORMAT_H
#define UNBAKE_CLIENT_FORMAT_H

#include "common/options.h"

#define FORMAT_OPTION                                                                                                  \
    { "format", 'o', OPTION_TEXT, "FORMAT", "text (for people), json, or jsonl: one object a line" }

enum client_format {
    FORMAT_TEXT,
    FORMAT_JSON, /* one document on one line; keys are kept from version to version */
    FORMAT_JSONL /* an array's items, a line each; an object as FORMAT_JSON */
};

/* What --format and --json of the command line ask for. STATUS_INPUT: an unknown word, or both, which differ. */
enum status format_read(const struct options *o, enum client_format *format, struct error *err);
/* What words ask for that could not be parsed; for the errors of such a command line. */
enum client_format format_guess(int argc, char *const *argv);

extern const char *const format_names[]; /* by enum client_format; ends with NULL */

#endif
