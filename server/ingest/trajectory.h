/* trajectory.h -- reads poses as plain text, as in data sets of scanned rooms, into struct transforms. Two layouts of
 * 4 x 4 camera-to-world matrices with COLMAP's axes:
 *
 *   NICE-SLAM's Replica   traj.txt, a matrix per line, row-major; cam_params.json; photographs
 *                         results/frame000000.jpg ...
 *   ScanNet               pose/N.txt, a matrix each; intrinsic/intrinsic_color.txt; photographs color/N.jpg
 *
 * Pixel centres are at integers in both, so the principal point is shifted by half a pixel to ours. Non-finite poses
 * (ScanNet: tracking lost) are left out. */
#ifndef UNBAKE_INGEST_TRAJECTORY_H
#define UNBAKE_INGEST_TRAJECTORY_H

#include "common/error.h"
#include "server/ingest/findings.h"
#include "server/ingest/transforms.h"

/* "traj.txt" or "pose", whichever exists in the folder; NULL: neither. Static storage. */
const char *trajectory_find(const char *root);

/* Reads it. Faults become problems in *f; other statuses than STATUS_OK are failures of the machine. *t is the
 * caller's (transforms_release) in any case. */
enum status trajectory_read(const char *root, const char *found, struct transforms *t, struct findings *f,
                            struct error *err);

/* Parses a traj.txt in memory for photographs with this lens. STATUS_INPUT with the line. */
enum status trajectory_parse(const void *data, size_t size, const char *name, const struct lens *lens,
                             struct transforms *t, struct findings *f, struct error *err);

#endif
