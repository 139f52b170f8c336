/* pose_track.c -- see pose_track.h. Between poses some hundredths of a second apart the normalised sum of quaternions
 * differs from the great arc by less than 1e-6. */
#include "server/ingest/source/pose_track.h"

#include <math.h>
#include <stdlib.h>

#include "common/mem.h"
#include "server/ingest/source/frame_list.h"

void pose_track_add(struct pose_track *track, const struct timed_pose *pose) {
    if (track->count == track->capacity) {
        track->capacity = track->capacity ? 2 * track->capacity : 256;
        track->pose = mem_realloc_array(track->pose, track->capacity, sizeof *track->pose);
    }
    track->pose[track->count++] = *pose;
}

static int by_time(const void *a, const void *b) {
    double x = ((const struct timed_pose *)a)->time_sec, y = ((const struct timed_pose *)b)->time_sec;
    return (x > y) - (x < y);
}

void pose_track_sort(struct pose_track *track) {
    if (track->count > 1)
        qsort(track->pose, track->count, sizeof *track->pose, by_time);
}

void pose_track_release(struct pose_track *track) {
    mem_free(track->pose);
    *track = (struct pose_track){0};
}

bool pose_track_at(const struct pose_track *track, double time_sec, double gap_sec, double m[3][4]) {
    size_t low = 0, high = track->count; /* the first pose at or behind the time */
    while (low < high) {
        size_t middle = low + (high - low) / 2;
        if (track->pose[middle].time_sec < time_sec)
            low = middle + 1;
        else
            high = middle;
    }
    if (track->count == 0)
        return false;
    const struct timed_pose *b = &track->pose[low < track->count ? low : low - 1],
                            *a = low > 0 ? &track->pose[low - 1] : b;
    double gap = b->time_sec - a->time_sec, share = gap > 0.0 ? (time_sec - a->time_sec) / gap : 0.0;
    if (gap > gap_sec || (gap <= 0.0 && fabs(time_sec - a->time_sec) > 0.5 * gap_sec))
        return false;
    double r[3][3], q[4], dot = 0.0;
    for (int i = 0; i < 4; i++)
        dot += a->q[i] * b->q[i];
    for (int i = 0; i < 4; i++)
        q[i] = (1.0 - share) * a->q[i] + (dot < 0.0 ? -share : share) * b->q[i];
    rotation_from_quaternion(q[0], q[1], q[2], q[3], r);
    for (int i = 0; i < 12; i++)
        m[i / 4][i % 4] = i % 4 < 3 ? r[i / 4][i % 4] : (1.0 - share) * a->t[i / 4] + share * b->t[i / 4];
    return true;
}
