/* bundle.h -- turns an upload into a scene. Runs in workers only, never in the daemon.
 *
 * A bundle is a folder with cameras of some source (source/sources.h), the photographs that they name, and a mesh,
 * which mesh_choice.h chooses. */
#ifndef UNBAKE_INGEST_BUNDLE_H
#define UNBAKE_INGEST_BUNDLE_H

#include <stdint.h>

#include "common/error.h"
#include "common/json.h"
#include "common/parallel.h"
#include "common/reading.h"
#include "server/scene/scene.h"

#define BUNDLE_TRANSFORMS "transforms.json"

struct bundle_limits {
    uint64_t file_count;        /* entries of an archive */
    uint64_t total_bytes;       /* unpacked */
    double ratio;               /* unpacked / packed */
    uint64_t photograph_pixels; /* per photograph */
    uint64_t triangles;
    /* What the photographs take; see struct photos_options. */
    uint64_t decode_bytes;
    struct spill *spill;
    uint64_t later_bytes;
    double kept_pixels;
};

struct bundle_limits bundle_default_limits(void);

/* Unpacks an archive (zip, tar, tar.gz, tar.zst) into the new folder `dir`. Refuses absolute paths, paths with "..",
 * links, devices, and anything over a limit. bundle_load accepts a single folder at the top. On failure `dir` is
 * removed; on success the caller makes the files durable. */
enum status bundle_unpack(const char *archive, const char *dir, const struct bundle_limits *limits, struct error *err);

/* The bundle's root: `dir`, or below it as long as a folder holds nothing but one folder; the caller's (mem_free). */
enum status bundle_root(const char *dir, char **root, struct error *err);

/* Reads an unpacked bundle: cameras, mesh, photographs. Collects as many problems as possible, each an object
 * {"file", "reason"} with an optional "hint", in the array `problems`; then returns STATUS_INPUT with a summary in
 * *err. Other statuses are failures of the machine. `reading` says how it is to be read (NULL: as the bundle says). The
 * scene is the caller's in any case (scene_release); unless STATUS_OK it has nothing but warnings. */
enum status bundle_load(const char *dir, const struct reading *reading, const struct bundle_limits *limits,
                        struct parallel *pool, struct scene *scene, cJSON *problems, struct error *err);

#endif
