/* meter.c -- see meter.h. */
#include "client/meter.h"

#include <math.h>

#include "common/clock.h"

#define SMOOTHING_SEC 4.0 /* time constant of the smoothed rate */
#define MEASURE_SEC 0.25  /* shorter intervals are too noisy */
#define REDRAW_SEC 0.1    /* between two drawings of the line on a terminal */
#define BAR_COLUMNS 24    /* width of the bar */

void meter_begin(struct meter *m, struct terminal *terminal, const char *label, double done, double total) {
    double now = clock_sec();
    *m = (struct meter){.terminal = terminal,
                        .label = label,
                        .total = total,
                        .done = done,
                        .rate = -1.0,
                        .measured_at = now,
                        .measured_done = done};
    m->drawn_at = terminal && terminal->live ? now - REDRAW_SEC : now;
}

void meter_measure(struct meter *m, double now, double done) {
    m->done = done;
    double span = now - m->measured_at;
    if (span < MEASURE_SEC)
        return;
    double rate = fmax(done - m->measured_done, 0.0) / span;
    if (m->rate < 0.0)
        m->rate = rate;
    else
        m->rate += (rate - m->rate) * (1.0 - exp(-span / SMOOTHING_SEC));
    m->measured_at = now;
    m->measured_done = done;
}

void meter_text(const struct meter *m, struct buf *out, size_t columns, bool unicode) {
    char done[16], total[16], rate[16], left[16];
    format_bytes(done, m->done);
    format_bytes(total, m->total);
    format_bytes(rate, m->rate);
    struct buf tail;
    buf_init(&tail, 256);
    if (m->total > 0.0)
        buf_printf(&tail, " %3.0f%%  %s of %s", floor(100.0 * fmin(m->done / m->total, 1.0)), done, total);
    else
        buf_printf(&tail, "  %s", done);
    if (m->rate > 0.0) {
        buf_printf(&tail, "  %s/s", rate);
        format_duration(left, (m->total - m->done) / m->rate);
        if (m->total > 0.0)
            buf_printf(&tail, "  ETA %s", left);
    }
    terminal_clean(out, m->label);
    if (m->total > 0.0 && text_columns(m->label) + tail.length + BAR_COLUMNS + 2 <= columns) {
        buf_puts(out, "  ");
        format_bar(out, BAR_COLUMNS, m->done / m->total, unicode);
    }
    buf_puts(out, buf_text(&tail));
    text_cut(out, columns);
    buf_release(&tail);
}

void meter_update(struct meter *m, double done) {
    double now = clock_sec();
    meter_measure(m, now, done);
    struct terminal *t = m->terminal;
    if (!t || now - m->drawn_at < (t->live ? REDRAW_SEC : METER_PLAIN_SEC))
        return;
    m->drawn_at = now;
    struct buf text;
    buf_init(&text, 1024);
    meter_text(m, &text, t->live ? terminal_width(t) - 1 : 200, t->unicode && t->live);
    if (t->live)
        terminal_draw(t, buf_text(&text));
    else
        fprintf(t->out, "%s\n", buf_text(&text));
    buf_release(&text);
}

void meter_end(struct meter *m) {
    if (m->terminal)
        terminal_clear(m->terminal);
}
