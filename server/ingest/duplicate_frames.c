/* duplicate_frames.c -- see duplicate_frames.h. */
#include "server/ingest/duplicate_frames.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "common/mem.h"

#define SAME_POSE                                                                                                      \
    1e-6 /* of a rotation's elements and, relative, of positions: rounding of decimals in single precision */

static int by_file(const void *a, const void *b) {
    const struct frame *x = *(struct frame *const *)a, *y = *(struct frame *const *)b;
    int order = strcmp(x->file, y->file);
    return order ? order : (x->number > y->number) - (x->number < y->number);
}

static bool is_same_pose(const struct exact_pose *a, const struct exact_pose *b) {
    for (int i = 0; i < 3; i++) {
        double at = a->translation[i];
        if (!(fabs(at - b->translation[i]) <= SAME_POSE * fmax(1.0, fabs(at))))
            return false;
        for (int j = 0; j < 3; j++)
            if (!(fabs(a->rotation[i][j] - b->rotation[i][j]) <= SAME_POSE))
                return false;
    }
    return true;
}

/* Frees the frames that are marked and closes the gaps. */
static void drop(struct frames *t, const bool *is_dropped) {
    size_t kept = 0;
    for (size_t i = 0; i < t->frame_count; i++) {
        if (is_dropped[i])
            frame_release(&t->frame[i]);
        else
            t->frame[kept++] = t->frame[i];
    }
    t->frame_count = kept;
}

void duplicate_frames_remove(struct frames *t, const char *name, struct findings *f) {
    struct frame **sorted = mem_array(t->frame_count + 1, sizeof *sorted);
    bool *is_dropped = mem_calloc(t->frame_count + 1, sizeof *is_dropped);
    size_t count = 0;
    const struct frame *again = NULL;
    for (size_t i = 0; i < t->frame_count; i++)
        sorted[i] = &t->frame[i];
    if (t->frame_count > 1)
        qsort(sorted, t->frame_count, sizeof *sorted, by_file);
    for (size_t i = 1, first = 0; i < t->frame_count; i++) {
        struct frame *kept = sorted[first], *own = sorted[i];
        if (strcmp(own->file, kept->file) != 0) {
            first = i;
        } else if (is_same_pose(&own->world_from_camera, &kept->world_from_camera)) {
            kept->is_test = kept->is_test && own->is_test;
            is_dropped[own - t->frame] = true;
            again = again ? again : own;
            count++;
        } else {
            findings_problem(f, name, "frames[%zu] and frames[%zu] both name %s, with different poses", kept->number,
                             own->number, own->file);
        }
    }
    if (count > 0)
        findings_warning(
            f,
            "%s: %zu frames name a photograph that another one names with the same pose, %s for one: each is used once",
            name, count, again->file);
    drop(t, is_dropped);
    mem_free(is_dropped);
    mem_free(sorted);
}
