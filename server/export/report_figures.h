/* report_figures.h -- figures and settings of the report as tables, with names, units and what is good. */
#ifndef UNBAKE_EXPORT_REPORT_FIGURES_H
#define UNBAKE_EXPORT_REPORT_FIGURES_H

#include <stdbool.h>

#include "common/buf.h"
#include "common/json.h"

/* Of a held-out view, in a line: those that say most, or the others, in the order of the report. */
void report_view_figures(struct buf *out, const cJSON *view, bool main);

/* The section of all that is drawn nowhere else: plain values first, then a card for each object, whole-width tables of
 * lists of objects last. What is empty is left out. */
void report_figures(struct buf *out, const cJSON *report);

#endif
