/* report_curve.h -- a series of the report as a figure with an SVG curve. */
#ifndef UNBAKE_EXPORT_REPORT_CURVE_H
#define UNBAKE_EXPORT_REPORT_CURVE_H

#include <stdbool.h>

#include "common/buf.h"
#include "common/json.h"

/* Whether series [[step, value], ...] is a curve: two points at least, at different steps. */
bool report_curve_has(const cJSON *series);

/* Appends its figure; the caption says the last value. */
void report_curve(struct buf *out, const char *name, const cJSON *series);

#endif
