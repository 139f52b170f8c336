/* job_status.c -- see job_status.h. */
#include "server/executor/job_status.h"

#include <stdlib.h>
#include <string.h>

#include "common/mem.h"

/* How alive a job is in that state. */
static int liveliness(enum site_state state) {
    return state == SITE_RUNNING ? 3 : state == SITE_WAITING ? 2 : state == SITE_UNKNOWN ? 1 : 0;
}

static int compare(const void *a, const void *b) {
    const struct job_status *left = a, *right = b;
    int order = strcmp(left->name, right->name);
    return order ? order : liveliness(right->state) - liveliness(left->state);
}

bool job_status_parse(struct job_status_list *listing, const struct site *site, const char *text) {
    size_t room = 0, lines = 0, good = 0;
    *listing = (struct job_status_list){0};
    for (const char *at = text; *at;) {
        struct line_parts parts;
        size_t length = strcspn(at, "\n");
        bool is_good = pattern_match(site->status_line, at, length, &parts);
        lines += strspn(at, " \t\r") < length;
        good += is_good;
        at += length + (at[length] == '\n');
        if (!is_good || strncmp(parts.name, NAME_PREFIX, sizeof NAME_PREFIX - 1) != 0)
            continue;
        if (listing->count == room) {
            room = room ? 2 * room : 64;
            listing->job = mem_realloc_array(listing->job, room, sizeof *listing->job);
        }
        struct job_status *job = &listing->job[listing->count++];
        *job = (struct job_status){.state = site_state_of(site, parts.state)};
        memcpy(job->name, parts.name, sizeof job->name);
        memcpy(job->id, parts.id, sizeof job->id);
        memcpy(job->reason, parts.reason, sizeof job->reason);
    }
    if (listing->count > 0)
        qsort(listing->job, listing->count, sizeof *listing->job, compare);
    return lines == 0 || good > 0;
}

void job_status_release(struct job_status_list *listing) {
    mem_free(listing->job);
    *listing = (struct job_status_list){0};
}

const struct job_status *job_status_find(const struct job_status_list *listing, const char *name) {
    size_t low = 0, high = listing->count;
    while (low < high) { /* the first that is not before `name` */
        size_t middle = (low + high) / 2;
        if (strcmp(listing->job[middle].name, name) < 0)
            low = middle + 1;
        else
            high = middle;
    }
    return low < listing->count && strcmp(listing->job[low].name, name) == 0 ? &listing->job[low] : NULL;
}
