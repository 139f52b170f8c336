/* bundle.h -- from what a user uploads to a scene. Runs in workers only, never in the daemon.
 *
 * A bundle is a folder with transforms.json (transforms.h), a COLMAP reconstruction (colmap.h) or
 * poses as text (trajectory.h), the photographs that they name and a mesh (mesh_file.h): the one that
 * its key `mesh` names; failing that the one of ply_file_path, if it has faces; failing that the only
 * PLY with faces at the top; failing that the only file there of another format that is read. */
#ifndef UNBAKE_INGEST_BUNDLE_H
#define UNBAKE_INGEST_BUNDLE_H

#include <stdint.h>

#include "common/error.h"
#include "common/json.h"
#include "common/parallel.h"
#include "server/scene/scene.h"

#define BUNDLE_TRANSFORMS "transforms.json"

struct bundle_limits {
    uint64_t file_count;     /* entries of an archive */
    uint64_t total_bytes;    /* unpacked */
    double ratio;            /* unpacked / packed */
    uint64_t photograph_pixels; /* per photograph */
    uint64_t triangles;
};

struct bundle_limits bundle_default_limits(void);

/* Unpacks an archive (zip, tar, tar.gz, tar.zst) into the new folder `dir`. Refuses absolute
 * paths, paths that climb out, links, devices, too much of anything; a single folder at the top
 * is stepped into by bundle_load. On failure nothing of `dir` is left; on success the caller
 * sees to it that what was unpacked reaches the disk. */
enum status bundle_unpack(const char *archive, const char *dir, const struct bundle_limits *limits,
                          struct error *err);

/* Reads the unpacked bundle: transforms.json, the mesh, every photograph. All problems that can
 * be found are: each is an object {"file", "reason"} (and "hint") appended to the array
 * `problems`; STATUS_INPUT if any, *err summing them up. Another status is a failure of the
 * machine. `transforms` names the file to read instead of transforms.json (NULL: that one). On
 * success the scene is the caller's (scene_release); otherwise it is empty. */
enum status bundle_load(const char *dir, const char *transforms, const struct bundle_limits *limits,
                        struct parallel *pool, struct scene *scene, cJSON *problems,
                        struct error *err);

#endif
