/* scene_files.h -- what a checked scene consists of, for another machine that needs it: its unpacked files with their
 * digests. Hashing takes a second a gigabyte, and many attempts ask for the same scene, so the list is kept beside
 * it. */
#ifndef UNBAKE_DATA_SCENE_FILES_H
#define UNBAKE_DATA_SCENE_FILES_H

#include "common/error.h"
#include "common/json.h"

/* [{"name":"images/001.png","bytes":123,"sha256":"…"}, …] by name; the caller's (cJSON_Delete). Of a file whose size
 * or time has changed since it was hashed, the digest is made anew. Thread-safe. */
enum status scene_files_list(const char *data_dir, const char *scene_id, cJSON **list, struct error *err);

#endif
