/* view.h -- a job's state as accumulated from its events, and the line that shows it. */
#ifndef UNBAKE_CLIENT_VIEW_H
#define UNBAKE_CLIENT_VIEW_H

#include <stdbool.h>
#include <stdint.h>

#include "client/terminal.h"
#include "common/json.h"

#define VIEW_METRICS 3 /* series that are shown side by side */

struct view_metric {
    char series[32];
    double value;
    uint64_t order; /* of its last report; a new series replaces the oldest */
};

struct client_view {
    int64_t job;
    char state[16];
    char wanted[16]; /* "pause" or "cancel" while that is requested and not done; else "" */
    char stage[48];
    double done, total; /* of the stage; total 0: unknown */
    double eta_sec;     /* at the time of the report; negative: unknown */
    int attempt;
    char reason[512]; /* "" if none */
    struct view_metric metric[VIEW_METRICS];
    size_t metric_count;
    uint64_t reports;
};

void view_init(struct client_view *v, int64_t job);
/* Applies an event (types in common/protocol.h; others are ignored). */
void view_event(struct client_view *v, const char *type, const cJSON *data);
bool view_is_over(const struct client_view *v);

/* 0..1. */
double view_fraction(const struct client_view *v);
/* Formats the line: state or stage, a bar if `columns` leave room, numbers, time left. `age_sec`: time since the
 * last progress. */
void view_line(const struct client_view *v, const struct terminal *t, size_t columns, bool with_bar, double age_sec,
               struct buf *out);

enum colour state_colour(const char *state);

#endif
