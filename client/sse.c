/* sse.c -- see sse.h. */
#include "client/sse.h"

#include <stdio.h>
#include <string.h>

void sse_init(struct sse *s, sse_each *each, void *user) {
    *s = (struct sse){.each = each, .user = user};
    buf_init(&s->line, SSE_EVENT_MAX);
    buf_init(&s->data, SSE_EVENT_MAX);
}

void sse_release(struct sse *s) {
    buf_release(&s->line);
    buf_release(&s->data);
}

void sse_restart(struct sse *s) {
    buf_clear(&s->line);
    buf_clear(&s->data);
    s->type[0] = '\0';
    s->after_cr = false;
    s->begun = false;
    memcpy(s->pending_id, s->last_id, sizeof s->pending_id);
}

/* A blank line ends an event. An event without data is dropped, as the standard says. */
static bool dispatch(struct sse *s) {
    memcpy(s->last_id, s->pending_id, sizeof s->last_id);
    bool go_on = true;
    if (s->data.length > 0) {
        s->data.data[--s->data.length] = '\0'; /* the LF after the last data line */
        go_on = s->each(s->user, s->type[0] ? s->type : "message", buf_text(&s->data), s->last_id);
    }
    buf_clear(&s->data);
    s->type[0] = '\0';
    return go_on;
}

static bool field(struct sse *s, const char *name, const char *value) {
    if (strcmp(name, "data") == 0)
        return buf_puts(&s->data, value) && buf_append(&s->data, "\n", 1);
    if (strcmp(name, "event") == 0)
        snprintf(s->type, sizeof s->type, "%s", value);
    else if (strcmp(name, "id") == 0 && strlen(value) < sizeof s->pending_id)
        snprintf(s->pending_id, sizeof s->pending_id, "%s", value);
    return true; /* unknown fields are ignored, as the standard says; "retry" too: pauses grow by themselves */
}

static bool end_of_line(struct sse *s) {
    char *line = s->line.data;
    bool go_on = true;
    if (s->line.length == 0) {
        go_on = dispatch(s);
    } else if (line[0] != ':') { /* a colon begins a comment: the keep-alive */
        char *colon = strchr(line, ':');
        const char *value = "";
        if (colon) {
            *colon = '\0';
            value = colon[1] == ' ' ? colon + 2 : colon + 1;
        }
        go_on = field(s, line, value);
    }
    buf_clear(&s->line);
    return go_on;
}

bool sse_feed(struct sse *s, const char *bytes, size_t length) {
    static const char mark[] = "\xEF\xBB\xBF";
    for (size_t i = 0; i < length;) {
        if (s->after_cr && bytes[i] == '\n') {
            s->after_cr = false;
            i++;
            continue;
        }
        s->after_cr = false;
        size_t run = i;
        while (run < length && bytes[run] != '\n' && bytes[run] != '\r')
            run++;
        if (!buf_append(&s->line, bytes + i, run - i))
            return false;
        if (run == length)
            return true;
        if (!s->begun && s->line.length >= 3 && memcmp(s->line.data, mark, 3) == 0)
            buf_consume(&s->line, 3);
        s->begun = true;
        s->after_cr = bytes[run] == '\r';
        if (!end_of_line(s))
            return false;
        i = run + 1;
    }
    return true;
}
