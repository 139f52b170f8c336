/* report_curve.h -- a series of the report as a figure with an SVG curve. */
#ifndef UNBAKE_EXPORT_REPORT_CURVE_H
#define UNBAKE_EXPORT_REPORT_CURVE_H

#include "common/buf.h"
#include "common/json.h"

/* Appends the figure of series [[step, value], ...]; its caption says the last value, or that there is none. */
void report_curve(struct buf *out, const char *name, const cJSON *series);

#endif
