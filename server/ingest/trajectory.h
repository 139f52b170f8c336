/* trajectory.h -- poses as plain text, as data sets of scanned rooms have them, into what
 * transforms.json would give. Two layouts, of 4 x 4 matrices from camera to world with COLMAP's axes:
 *
 *   NICE-SLAM's Replica   traj.txt, a matrix a line, row by row; cam_params.json; photographs
 *                         results/frame000000.jpg and on
 *   ScanNet               pose/N.txt, a matrix each; intrinsic/intrinsic_color.txt; photographs color/N.jpg
 *
 * Pixel centres are whole numbers in both, as their own programs read them, so the principal point is
 * moved by half a pixel to ours. Poses that are not finite (ScanNet: tracking was lost) are left out. */
#ifndef UNBAKE_INGEST_TRAJECTORY_H
#define UNBAKE_INGEST_TRAJECTORY_H

#include "common/error.h"
#include "server/ingest/findings.h"
#include "server/ingest/transforms.h"

/* "traj.txt" or "pose", whichever the folder has; NULL: neither. Static storage. */
const char *trajectory_find(const char *root);

/* Reads it. Faults become problems in *f; another status than STATUS_OK is a failure of the machine.
 * *t is the caller's (transforms_release) in any case. */
enum status trajectory_read(const char *root, const char *found, struct transforms *t, struct findings *f,
                            struct error *err);

/* A traj.txt from memory, of photographs with this lens. STATUS_INPUT with the line. */
enum status trajectory_parse(const void *data, size_t size, const char *name, const struct lens *lens,
                             struct transforms *t, struct findings *f, struct error *err);

#endif
