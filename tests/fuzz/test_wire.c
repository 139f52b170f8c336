/* test_wire.c -- bytes on a connection, through libmicrohttpd and server/transport to the reply: what
 * test_request.c leaves out. The daemon's HTTP side runs on threads of its own; after every few
 * inputs it must still answer a good request. */
#include "tests/api/rig.h"
#include "tests/fuzz/fuzz.h"

#define REPLY_MAX ((size_t)1 << 22)
#define GOOD_EVERY 64

static struct rig rig;

static void stop(void) { rig_stop(&rig); }

static void start(void) {
    snprintf(rig.dir, sizeof rig.dir, "%s", fuzz_folder());
    rig_open(&rig, &rig_patient, 15, 200, 60);
    log_set_level(LOG_ERROR);
    rig_job(&rig);
    atexit(stop);
}

/* Sends the bytes and no more; an event stream never ends, so the reply is not waited for long. The
 * connection is reset, or the ports of a minute's connections would run out. */
static void ask(const void *data, size_t size, struct buf *reply) {
    const struct linger at_once = {.l_onoff = 1};
    struct timeval patience = {.tv_usec = 20000};
    int fd = rig_connect(&rig);
    setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    setsockopt(fd, SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
    buf_init(reply, REPLY_MAX);
    rig_send(fd, data, size);
    shutdown(fd, SHUT_WR);
    rig_receive(fd, reply, NULL);
    close(fd);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static long count;
    struct buf reply;
    if (!rig.api)
        start();
    ask(data, size, &reply);
    const char *text = buf_text(&reply);
    MUST(reply.length < 9 || strncmp(text, "HTTP/1.1 ", 9) == 0 || strncmp(text, "HTTP/1.0 ", 9) == 0);
    MUST(strncmp(text, "HTTP/1.1 500", 12) != 0);
    buf_release(&reply);
    if (++count % GOOD_EVERY == 0) {
        MUST(rig_get(&rig, "/healthz", "", &reply) == 200);
        buf_release(&reply);
    }
    return 0;
}

#define HOST "Host: localhost\r\n"

void fuzz_seeds(struct seeds *s) {
    static const char *const requests[] = {
        "GET /healthz HTTP/1.1\r\n" HOST "\r\nGET /v1/jobs HTTP/1.1\r\n" HOST "\r\n",
        "HEAD /v1/jobs/1 HTTP/1.0\r\n\r\n",
        "POST /v1/jobs?dry_run=1 HTTP/1.1\r\n" HOST
        "Content-Type: application/json\r\nTransfer-Encoding: chunked\r\n\r\n"
        "5;a=b\r\n{\"nam\r\n7\r\ne\":\"x\"}\r\n0\r\nX: y\r\n\r\n",
        "POST /v1/jobs/1/cancel HTTP/1.1\r\n" HOST "Expect: 100-continue\r\nContent-Length: 3\r\n\r\nabc",
        "POST /v1/scenes HTTP/1.1\r\n" HOST "Content-Length: 5\r\nConnection: close\r\n\r\nabcde",
        "POST /v1/scenes HTTP/1.1\r\n" HOST
        "Content-Type: multipart/form-data; boundary=x\r\nContent-Length: 9\r\n\r\n--x\r\n\r\n--",
        "GET /v1/jobs/1/events HTTP/1.1\r\n" HOST "Last-Event-ID: 0\r\n\r\n",
        "GET /metrics HTTP/1.1\nHost: localhost\nX-A: a\n b\n\n",
        "OPTIONS * HTTP/1.1\r\n" HOST "Content-Length: 3\r\nContent-Length: 3\r\n\r\nabc",
        "PATCH /v1/uploads/00000000000000000000000000000000 HTTP/1.1\r\n" HOST
        "Tus-Resumable: 1.0.0\r\nUpload-Offset: 0\r\n"
        "Content-Type: application/offset+octet-stream\r\nContent-Length: 99999999\r\n\r\nabc",
    };
    s->mutants = 300;
    for (size_t i = 0; i < sizeof requests / sizeof *requests; i++)
        seeds_text(s, requests[i]);
}
