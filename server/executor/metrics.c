/* metrics.c -- see metrics.h. */
#include "server/executor/metrics.h"

#include <stddef.h>

#include "server/executor/sites.h"

static const struct figure {
    const char *name, *type, *help;
    size_t offset;
    double scale;
} figures[] = {
#define FIGURE(member, name, type, help, scale)                                                                        \
    { name, type, help, offsetof(struct remote_figures, member), scale }
    FIGURE(waiting, "executor_waiting", "gauge", "Attempts that wait in the site's queue.", 1.0),
    FIGURE(running, "executor_running", "gauge", "Attempts that run there.", 1.0),
    FIGURE(claimed, "executor_wait_seconds_count", "counter", "Attempts that have waited there and began.", 1.0),
    FIGURE(waited_ms, "executor_wait_seconds_sum", "counter", "How long these waited.", 1e-3),
    FIGURE(submissions, "executor_submissions_total", "counter", "Submit commands.", 1.0),
    FIGURE(queries, "executor_queries_total", "counter", "Status commands, each for all attempts.", 1.0),
    FIGURE(cancels, "executor_cancels_total", "counter", "Cancel commands.", 1.0),
    FIGURE(faults, "executor_command_faults_total", "counter", "Commands that failed, or said nothing.", 1.0),
    FIGURE(lost, "executor_lost_total", "counter", "Attempts that were lost there.", 1.0),
    FIGURE(preempted, "executor_preempted_total", "counter", "Attempts that were pre-empted there.", 1.0),
    FIGURE(refused, "executor_refused_total", "counter", "Attempts that were not taken there.", 1.0),
};

void executor_metrics(const void *user, struct buf *b) {
    const struct sites *s = user;
    size_t count = 0;
    for (size_t k = 0; k < s->count; k++)
        count += s->place[k].remote != NULL;
    for (size_t i = 0; i < sizeof figures / sizeof *figures && count > 0; i++) {
        const struct figure *f = &figures[i];
        buf_printf(b, "# HELP unbaked_%s %s\n# TYPE unbaked_%s %s\n", f->name, f->help, f->name, f->type);
        for (size_t k = 0; k < s->count; k++) {
            if (!s->place[k].remote)
                continue;
            const char *at = (const char *)remote_figures(s->place[k].remote) + f->offset;
            unsigned long long value = atomic_load((const atomic_ullong *)(const void *)at);
            buf_printf(b, "unbaked_%s{executor=\"%s\"} %.17g\n", f->name, s->place[k].site.name,
                       (double)value * f->scale);
        }
    }
}
