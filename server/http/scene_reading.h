/* scene_reading.h -- how a scene is to be read (common/reading.h), as it comes over HTTP: in the query of an upload, in
 * the metadata of one in parts, in a PATCH. */
#ifndef UNBAKE_HTTP_SCENE_READING_H
#define UNBAKE_HTTP_SCENE_READING_H

#include "server/transport/message.h"

/* The text of the object, checked and as short as can be, with defaults left out, as the store keeps it; the caller's.
 * NULL, with its faults in params, as "reading.axes". JSON null stands for the default. */
char *scene_reading_text(const cJSON *value, cJSON *params);
/* The same of a text of JSON, `what` in messages; NULL with *err. */
char *scene_reading_parse(const char *text, size_t length, const char *what, struct error *err);

/* The query's `reading`; NULL where there is none, or with *refusal. */
char *scene_reading_query(const struct request *r, struct response **refusal);

#endif
