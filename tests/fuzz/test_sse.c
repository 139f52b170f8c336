/* test_sse.c -- the client's event streams: cut anywhere, they give the same events, and the line
 * that is made of them drives no terminal. */
#include "client/sse.h"

#include "client/view.h"
#include "common/json.h"
#include "tests/fuzz/fuzz.h"

#define COLUMNS 60

struct listener {
    struct client_view view;
    struct terminal terminal;
    struct buf heard; /* what came, in words that can be compared */
};

static bool hear(void *user, const char *type, const char *data, const char *id) {
    struct listener *l = user;
    cJSON *value = NULL;
    struct buf line;
    MUST(strlen(id) < SSE_ID_MAX);
    buf_printf(&l->heard, "%s|%s|%s\n", type, data, id);
    if (json_parse(data, strlen(data), "event", &value, NULL) != STATUS_OK)
        return true;
    view_event(&l->view, type, value);
    buf_init(&line, 1 << 16);
    view_line(&l->view, &l->terminal, COLUMNS, true, 1.0, &line);
    MUST(text_columns(buf_text(&line)) <= COLUMNS);
    for (const char *at = buf_text(&line); *at; at++)
        MUST((unsigned char)*at >= 0x20 && *at != 0x7f);
    MUST(view_fraction(&l->view) >= 0.0 && view_fraction(&l->view) <= 1.0);
    buf_release(&line);
    cJSON_Delete(value);
    return true;
}

/* Feeds pieces of `step` bytes. */
static void listen(struct listener *l, const uint8_t *data, size_t size, size_t step) {
    struct sse s;
    *l = (struct listener){.terminal = {.out = stdout}};
    view_init(&l->view, 1);
    buf_init(&l->heard, 1 << 20);
    sse_init(&s, hear, l);
    for (size_t at = 0; at < size; at += step)
        MUST(sse_feed(&s, (const char *)data + at, size - at < step ? size - at : step));
    sse_restart(&s);
    sse_release(&s);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    struct listener whole, cut;
    if (size < 1)
        return 0;
    listen(&whole, data + 1, size - 1, size);
    listen(&cut, data + 1, size - 1, 1 + data[0] % 16);
    MUST(strcmp(buf_text(&whole.heard), buf_text(&cut.heard)) == 0);
    buf_release(&whole.heard);
    buf_release(&cut.heard);
    return 0;
}

void fuzz_seeds(struct seeds *s) {
    s->mutants = 10000;
    seeds_text(
        s, "\3\xEF\xBB\xBF: hello\nretry: 5\n\nid: 12\nevent: progress\r\ndata: {\"stage\": \"refine\", \"done\": 3,"
           " \"total\": 10, \"eta_sec\": 33.5}\r\n\r\nevent: metric\ndata: {\"series\": \"loss\",\n"
           "data: \"value\": 0.0123, \"step\": 9}\n\n");
    seeds_text(s, "\7event: state\rid: 7\rdata: {\"state\": \"running\", \"attempt\": 2, \"wanted\": \"pause\"}\r\r"
                  "event: state\rdata: {\"state\": \"failed\", \"reason\": \"out of \\u001b[31m memory\"}\r\r");
    seeds_text(s, "\1event: metric\ndata: {\"series\": \"a\", \"value\": 1e-300}\n\n"
                  "event: metric\ndata: {\"series\": \"b\", \"value\": 1e300}\n\n"
                  "event: metric\ndata: {\"series\": \"c\", \"value\": -0.5}\n\n"
                  "event: metric\ndata: {\"series\": \"d\", \"value\": 123456}\n\nid\ndata\n\n");
}
