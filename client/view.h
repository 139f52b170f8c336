/* view.h -- what a job's events add up to, and the line that shows it. */
#ifndef UNBAKE_CLIENT_VIEW_H
#define UNBAKE_CLIENT_VIEW_H

#include <stdbool.h>
#include <stdint.h>

#include "client/terminal.h"
#include "common/json.h"

#define VIEW_METRICS 3

struct view_metric {
    char series[32];
    double value;
    uint64_t order; /* of its last report; the oldest gives way to a new series */
};

struct client_view {
    int64_t job;
    char state[16];
    char wanted[16]; /* "pause" or "cancel" while that is asked for and not done; else "" */
    char stage[48];
    double done, total; /* of the stage; total 0: unknown */
    double eta_sec;     /* when it was reported; negative: unknown */
    int attempt;
    char reason[512]; /* "" if none */
    struct view_metric metric[VIEW_METRICS];
    size_t metric_count;
    uint64_t reports;
};

void view_init(struct client_view *v, int64_t job);
/* Takes an event in (common/protocol.h names the types; others are ignored). */
void view_event(struct client_view *v, const char *type, const cJSON *data);
bool view_is_over(const struct client_view *v);

/* 0..1. */
double view_fraction(const struct client_view *v);
/* The line: state or stage, bar if `columns` leave room for one, numbers, time left.
 * `age_sec` is how long ago the last progress came. */
void view_line(const struct client_view *v, const struct terminal *t, size_t columns, bool with_bar, double age_sec,
               struct buf *out);

enum colour state_colour(const char *state);

#endif
