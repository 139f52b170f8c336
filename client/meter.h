/* meter.h -- the progress of bytes: a bar, a rate and a time left, for an upload, a download or
 * the reading of a folder. Live terminals get a line redrawn in place; anything else a line
 * every METER_PLAIN_SEC and nothing for what is done sooner. */
#ifndef UNBAKE_CLIENT_METER_H
#define UNBAKE_CLIENT_METER_H

#include "client/terminal.h"

#define METER_PLAIN_SEC 10.0 /* between two lines where none can be redrawn */

struct meter {
    struct terminal *terminal; /* borrowed; NULL: draw nothing */
    const char *label;         /* borrowed */
    double total;              /* bytes; 0: unknown */
    double done;
    double rate;                       /* bytes a second, smoothed; negative before the first figure */
    double measured_at, measured_done; /* at the last update of the rate */
    double drawn_at;
};

/* `done` bytes are there already (a resumed download) and do not count for the rate. */
void meter_begin(struct meter *m, struct terminal *terminal, const char *label, double done, double total);
void meter_update(struct meter *m, double done);
void meter_end(struct meter *m); /* clears the line */

/* The parts of it, for callers with their own clock: */
void meter_measure(struct meter *m, double now, double done);
void meter_text(const struct meter *m, struct buf *out, size_t columns, bool unicode);

#endif
