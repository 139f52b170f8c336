/* retention.c -- see retention.h. */
#include "client/retention.h"

#include <math.h>
#include <string.h>
#include <time.h>

enum status retention_describe(const struct options *o, cJSON *body, struct error *err) {
    bool pin = options_flag(o, "pin"), unpin = options_flag(o, "unpin");
    if (pin && unpin)
        return error_set(err, STATUS_INPUT, "--pin and --unpin exclude each other");
    if (pin || unpin)
        json_add_bool(body, "pinned", pin);
    if (!options_text(o, "keep-days", NULL))
        return STATUS_OK;
    double days = options_seconds(o, "keep-days", 0.0);
    if (days > 36500.0)
        return error_set(err, STATUS_INPUT, "--keep-days must be at most 36500");
    char text[32];
    time_t at = time(NULL) + (time_t)(days * 86400.0);
    struct tm utc;
    gmtime_r(&at, &utc);
    strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &utc);
    json_add_string(body, "expires_at", days > 0.0 ? text : NULL);
    return STATUS_OK;
}

static bool is_pinned(const cJSON *thing) { return cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(thing, "pinned")); }

const char *retention_time(const cJSON *thing) {
    return is_pinned(thing) ? "never: pinned" : member_text(thing, "expires_at");
}

void retention_text(char out[16], const cJSON *thing) {
    double at = time_parse(member_text(thing, "expires_at"));
    out[0] = '\0';
    if (is_pinned(thing))
        strcpy(out, "pinned");
    else if (!isnan(at))
        format_duration(out, fmax(at - (double)time(NULL), 0.0));
}

void retention_disk(char out[16], const cJSON *thing) {
    double bytes = member_number(thing, "disk_bytes", -1.0);
    *out = '\0';
    if (bytes >= 0.0)
        format_bytes(out, bytes);
}

void retention_sentence(char out[40], const cJSON *thing) {
    char left[16];
    retention_text(left, thing);
    snprintf(out, 40, "%s%s",
             !*left             ? ""
             : is_pinned(thing) ? "kept for good"
                                : "removed in ",
             is_pinned(thing) ? "" : left);
}
