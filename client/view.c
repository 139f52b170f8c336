/* view.c -- see view.h. */
#include "client/view.h"

#include <math.h>
#include <string.h>

#include "client/client.h"
#include "common/protocol.h"

void view_init(struct client_view *v, int64_t job) { *v = (struct client_view){.job = job, .eta_sec = -1.0}; }

static void copy(char *to, size_t size, const cJSON *data, const char *key) {
    if (cJSON_GetObjectItemCaseSensitive(data, key))
        snprintf(to, size, "%s", member_text(data, key));
}

static void take_state(struct client_view *v, const cJSON *data) {
    /* An event that changes the state omits an absent reason or request. */
    v->wanted[0] = v->reason[0] = '\0';
    copy(v->state, sizeof v->state, data, "state");
    copy(v->wanted, sizeof v->wanted, data, "wanted");
    copy(v->stage, sizeof v->stage, data, "stage");
    copy(v->reason, sizeof v->reason, data, "reason");
    if (strcmp(v->wanted, "run") == 0)
        v->wanted[0] = '\0';
    double progress = member_number(data, "progress", -1.0);
    if (progress >= 0.0) {
        v->done = progress;
        v->total = 1.0;
    }
    v->eta_sec = member_number(data, "eta_sec", -1.0);
}

static void take_progress(struct client_view *v, const cJSON *data) {
    copy(v->stage, sizeof v->stage, data, "stage");
    v->done = member_number(data, "done", 0.0);
    v->total = member_number(data, "total", 0.0);
    v->eta_sec = member_number(data, "eta_sec", -1.0);
}

static void take_metric(struct client_view *v, const cJSON *data) {
    const char *series = member_text(data, "series");
    double value = member_number(data, "value", (double)NAN);
    if (!*series || !isfinite(value))
        return;
    size_t at = 0;
    while (at < v->metric_count && strcmp(v->metric[at].series, series) != 0)
        at++;
    if (at == v->metric_count) {
        if (v->metric_count < VIEW_METRICS) {
            v->metric_count++;
        } else {
            at = 0;
            for (size_t i = 1; i < VIEW_METRICS; i++)
                if (v->metric[i].order < v->metric[at].order)
                    at = i;
        }
        snprintf(v->metric[at].series, sizeof v->metric[at].series, "%s", series);
    }
    v->metric[at].value = value;
    v->metric[at].order = ++v->reports;
}

void view_event(struct client_view *v, const char *type, const cJSON *data) {
    v->attempt = (int)member_whole(data, "attempt", v->attempt);
    if (strcmp(type, EVENT_STATE) == 0)
        take_state(v, data);
    else if (strcmp(type, EVENT_PROGRESS) == 0)
        take_progress(v, data);
    else if (strcmp(type, EVENT_METRIC) == 0)
        take_metric(v, data);
}

bool view_is_over(const struct client_view *v) {
    return strcmp(v->state, JOB_STATE_SUCCEEDED) == 0 || strcmp(v->state, JOB_STATE_FAILED) == 0 ||
           strcmp(v->state, JOB_STATE_CANCELLED) == 0;
}

double view_fraction(const struct client_view *v) {
    return v->total > 0.0 ? fmin(fmax(v->done / v->total, 0.0), 1.0) : 0.0;
}

enum colour state_colour(const char *state) {
    if (strcmp(state, JOB_STATE_SUCCEEDED) == 0 || strcmp(state, SCENE_STATE_READY) == 0)
        return COLOUR_GREEN;
    if (strcmp(state, JOB_STATE_FAILED) == 0 || strcmp(state, SCENE_STATE_REJECTED) == 0)
        return COLOUR_RED;
    return strcmp(state, JOB_STATE_PAUSED) == 0 ? COLOUR_YELLOW : COLOUR_NONE;
}

static void put_numbers(const struct client_view *v, double age_sec, struct buf *out) {
    for (size_t i = 0; i < v->metric_count; i++) {
        char figure[24];
        format_figure(figure, v->metric[i].value);
        buf_puts(out, "  ");
        terminal_clean(out, v->metric[i].series);
        buf_printf(out, " %s", figure);
    }
    if (v->eta_sec > age_sec) { /* an expired estimate is not shown */
        char left[16];
        format_duration(left, v->eta_sec - age_sec);
        buf_printf(out, "  ETA %s", left);
    }
}

void view_line(const struct client_view *v, const struct terminal *t, size_t columns, bool with_bar, double age_sec,
               struct buf *out) {
    bool running = strcmp(v->state, JOB_STATE_RUNNING) == 0;
    buf_printf(out, "job %lld  ", (long long)v->job);
    enum colour colour = state_colour(v->state);
    buf_puts(out, colour ? terminal_colour(t, colour) : "");
    terminal_clean(out, running && *v->stage ? v->stage : v->state);
    buf_puts(out, colour ? terminal_colour(t, COLOUR_NONE) : "");
    if (running) {
        struct buf numbers;
        buf_init(&numbers, 1024);
        put_numbers(v, age_sec, &numbers);
        if (strcmp(v->wanted, "pause") == 0)
            buf_puts(&numbers, "  (pausing)");
        else if (strcmp(v->wanted, "cancel") == 0)
            buf_puts(&numbers, "  (being cancelled)");
        size_t used = text_columns(buf_text(out)) + text_columns(buf_text(&numbers)) + 8;
        size_t bar = columns > used + 10 ? columns - used : 0;
        buf_puts(out, "  ");
        if (with_bar && bar) {
            format_bar(out, bar < 40 ? bar : 40, view_fraction(v), t->unicode);
            buf_puts(out, " ");
        }
        buf_printf(out, "%3.0f%%", floor(100.0 * view_fraction(v) + 1e-9));
        buf_puts(out, buf_text(&numbers));
        buf_release(&numbers);
    } else if (*v->reason) {
        buf_puts(out, ": ");
        terminal_clean(out, v->reason);
    }
    text_cut(out, columns);
}
