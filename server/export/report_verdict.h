/* report_verdict.h -- what the report says first, in words: what was found, how far held-out views are off, where the
 * result is weak and why. */
#ifndef UNBAKE_EXPORT_REPORT_VERDICT_H
#define UNBAKE_EXPORT_REPORT_VERDICT_H

#include "common/buf.h"
#include "common/json.h"

/* Appends it as a section of HTML; `report` is that of report.json, with its segments. What the report does not have
 * is not spoken of. */
void report_verdict(struct buf *out, const cJSON *report);

#endif
