/* Event streams by the dozen: how many are admitted, none counted for ever, and a daemon that has to wait for none. */
#include <sys/resource.h>

#include "common/json.h"
#include "server/transport/exchange.h"
#include "tests/api/event_rig.h"

/* Streams that the clients have closed count until the daemon has seen that. */
static void await_streams(const struct rig *rig, int count) {
    char wanted[64];
    snprintf(wanted, sizeof wanted, "\nunbaked_event_streams %d\n", count);
    for (bool is_so = false; !is_so; usleep(5000)) {
        struct buf reply;
        CHECK(rig_get(rig, "/metrics", "", &reply) == 200);
        is_so = strstr(buf_text(&reply), wanted) != NULL;
        buf_release(&reply);
    }
}

/* The transport's own count, by which it waits for streams when it stops, falls to 0, too. */
static void check_none_open(const struct rig *rig) {
    size_t count = 1;
    for (int ms = 0; ms < 5000 && count != 0; ms++) {
        pthread_mutex_lock(&rig->listener->mutex);
        count = rig->listener->stream_count;
        pthread_mutex_unlock(&rig->listener->mutex);
        usleep(1000);
    }
    CHECK_THAT(count == 0, "%zd streams are counted as open", (ssize_t)count);
}

#define STREAM_MAX 60 /* as rig_start has it */

/* Of a burst exactly as many are admitted as there is room for, and those whose connections die before their first text
 * do not count for ever. */
static void check_burst(struct rig *rig) {
    enum { MORE = 30 };
    int fds[STREAM_MAX + MORE];
    struct error err;
    for (int round = 0; round < 3; round++) {
        bool is_cut = round == 1; /* reset by the client at once */
        int64_t job = rig_job(rig);
        int admitted = 0, refused = 0, attempt = rig_run_job(rig, job);
        char *text = mem_printf("GET /v1/jobs/%lld/events HTTP/1.1\r\nHost: localhost\r\n\r\n", (long long)job);
        await_streams(rig, 0);
        for (int i = 0; i < STREAM_MAX + MORE; i++)
            fds[i] = rig_connect(rig);
        for (int i = 0; i < STREAM_MAX + MORE; i++)
            rig_send(fds[i], text, strlen(text));
        for (int i = 0; i < STREAM_MAX + MORE; i++) {
            struct linger at_once = {.l_onoff = 1};
            struct buf reply;
            buf_init(&reply, 1 << 20);
            if (is_cut)
                setsockopt(fds[i], SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
            else
                rig_receive(fds[i], &reply, "\r\n\r\n");
            admitted += rig_status(&reply) == 200;
            refused += rig_status(&reply) == 503;
            buf_release(&reply);
            if (is_cut)
                close(fds[i]);
        }
        for (int i = 0; !is_cut && i < STREAM_MAX + MORE; i++)
            close(fds[i]);
        CHECK_THAT(is_cut || (admitted == STREAM_MAX && refused == MORE), "%d were admitted, %d refused", admitted,
                   refused);
        rig_must(store_job_succeed(rig->store, job, attempt, "", &err), &err,
                 "store_job_succeed"); /* ends its streams */
        mem_free(text);
    }
    await_streams(rig, 0);
    check_none_open(rig);
}

static double cpu_seconds(void) {
    struct rusage use;
    getrusage(RUSAGE_SELF, &use);
    return (double)(use.ru_utime.tv_sec + use.ru_stime.tv_sec) +
           1e-6 * (double)(use.ru_utime.tv_usec + use.ru_stime.tv_usec);
}

/* Many open streams: one event reaches all, silence costs nothing and brings keep-alives, one
 * too many is refused, a deleted job ends its streams, and stopping ends the others. */
static void check_many(struct rig *rig) {
    enum { COUNT = STREAM_MAX };
    int64_t job = rig_job(rig), doomed = rig_job(rig);
    int fds[COUNT];
    struct buf replies[COUNT], refusal;
    struct error err;
    await_streams(rig, 0);
    for (int i = 0; i < COUNT; i++) {
        buf_init(&replies[i], 1 << 20);
        fds[i] = open_stream(rig, i == 0 ? doomed : job, "", "");
        rig_receive(fds[i], &replies[i], "\"snapshot\":true");
    }
    char path[64];
    snprintf(path, sizeof path, "/v1/jobs/%lld/events", (long long)job);
    CHECK(rig_get(rig, path, "", &refusal) == 503);
    CHECK(strstr(buf_text(&refusal), "Retry-After: "));
    buf_release(&refusal);

    double before = cpu_seconds();
    for (int i = 1; i < COUNT; i++)
        rig_receive(fds[i], &replies[i], ": keepalive\n\n");
    CHECK_THAT(cpu_seconds() - before < 0.5, "%.3f s of processor time", cpu_seconds() - before);

    rig_run_job(rig, job);
    for (int i = 1; i < COUNT; i++) {
        rig_receive(fds[i], &replies[i], "\"state\":\"running\"");
        CHECK(strstr(buf_text(&replies[i]), "\"state\":\"running\""));
    }
    rig_must(store_job_delete(rig->store, doomed, &err), &err, "store_job_delete");
    rig_receive(fds[0], &replies[0], "\r\n0\r\n\r\n");
    CHECK(strstr(buf_text(&replies[0]), "\r\n0\r\n\r\n"));

    rig_stop(rig);
    for (int i = 0; i < COUNT; i++) {
        rig_receive(fds[i], &replies[i], NULL);
        CHECK_THAT(strstr(buf_text(&replies[i]), "\r\n0\r\n\r\n"), "stream %d was cut off", i);
        close(fds[i]);
        buf_release(&replies[i]);
    }
}

int main(void) {
    struct rig rig;
    rig_start(&rig, &rig_patient, 1);
    check_burst(&rig);
    check_many(&rig);
    return check_result();
}
