/* pose_track.h -- poses with times, for photographs that were taken in between. */
#ifndef UNBAKE_INGEST_SOURCE_POSE_TRACK_H
#define UNBAKE_INGEST_SOURCE_POSE_TRACK_H

#include <stdbool.h>
#include <stddef.h>

struct timed_pose {
    double time_sec;
    double q[4], t[3]; /* camera-to-world: w x y z, of any length, and the camera's centre */
};

struct pose_track {
    size_t count, capacity;
    struct timed_pose *pose; /* [count]; sorted after pose_track_sort; owned */
};

void pose_track_add(struct pose_track *track, const struct timed_pose *pose);
void pose_track_sort(struct pose_track *track);
void pose_track_release(struct pose_track *track);

/* Camera-to-world at a time: that of the pose before and the one behind, interpolated (positions linearly, rotations by
 * normalised quaternions). False when these are more than gap_sec apart, or the time is more than gap_sec / 2
 * outside. */
bool pose_track_at(const struct pose_track *track, double time_sec, double gap_sec, double m[3][4]);

#endif
