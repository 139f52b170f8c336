/* test_http_disk.c -- a disk that fails, or lies, while the daemon serves: what it says, what it holds on to, and that
 * it goes on once the disk is well. */
#include "server/data/collector.h"
#include "server/data/trash.h"
#include "server/http/space.h"
#include "tests/api/rig.h"
#include "tests/system_faults.h"

#define LARGE ((size_t)66 << 20) /* more than is received without a commit */
#define TUS "Tus-Resumable: 1.0.0\r\n"

static struct rig rig;
static struct error err;
static char *reserve; /* path */

static int ask(const char *method, const char *path, const char *fields, struct buf *reply) {
    char *text = mem_printf("%s %s HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n%s\r\n", method, path, fields);
    int status = rig_ask(&rig, text, strlen(text), reply);
    mem_free(text);
    return status;
}

static void check_answer(const char *method, const char *path, const char *fields, int wanted, const char *word) {
    struct buf reply;
    int status = ask(method, path, fields, &reply);
    CHECK_THAT(status == wanted && strstr(buf_text(&reply), word), "%s %s: %d, not %d with \"%s\": %s", method, path,
               status, wanted, word, buf_text(&reply));
    buf_release(&reply);
}

/* --- what is read back ------------------------------------------------------------------------------ */

static void check_probe(void) {
    char *trash = file_join(rig.dir, "trash"), **names;
    size_t count;
    check_answer("GET", "/readyz", "", 200, "ready");
    system_break(" lie ", 0);
    check_answer("GET", "/readyz", "", 503, "what is read back differs");
    system_mend();
    check_answer("GET", "/readyz", "", 200, "ready");
    rig_must(file_list(trash, &names, &count, &err), &err, "file_list");
    CHECK_THAT(count == 0, "%s is left", names[0]);
    file_free_names(names, count);
    mem_free(trash);
}

/* --- the reserve ------------------------------------------------------------------------------------ */

/* Where it is not known how much room there is, the reserve is not made, and nothing is said to fail for that. */
static void check_reserve(void) {
    faults_behind = true;
    system_break(" statvfs ", EIO);
    for (int is_well = 0; is_well < 2; is_well++) {
        int64_t job = rig_job(&rig);
        char *path = mem_printf("/v1/jobs/%lld", (long long)job);
        rig_must(store_job_cancel(rig.store, job, &err), &err, "store_job_cancel");
        unlink(reserve);
        check_answer("DELETE", path, "", 204, "");
        trash_wait(rig.api->folder.trash);
        CHECK((access(reserve, F_OK) == 0) == is_well);
        system_mend();
        mem_free(path);
    }
}

/* --- the collector ---------------------------------------------------------------------------------- */

static bool is_there(int64_t job) {
    struct job row;
    enum status status = store_job_get(rig.store, job, &row, &err);
    job_release(&row);
    return status == STATUS_OK;
}

/* It looks again and again, though it cannot at first. */
static void check_collector(void) {
    struct collector *collector = NULL;
    int64_t job = rig_job(&rig);
    rig_must(store_job_cancel(rig.store, job, &err), &err, "store_job_cancel");
    rig_must(store_retention_set_periods(rig.store, 0, 1, 3600000, &err), &err, "store_retention_set_periods");
    system_break(" pthread_create ", EAGAIN);
    CHECK(collector_start(&collector, &rig.api->collector_config, 0.01, &err) == STATUS_IO && collector == NULL);
    CHECK_THAT(strstr(err.message, "cannot start the thread"), "%s", err.message);
    system_mend();

    usleep(2000);
    sql_break();
    rig_must(collector_start(&collector, &rig.api->collector_config, 0.01, &err), &err, "collector_start");
    usleep(100000);
    sql_mend();
    for (int i = 0; i < 3000 && is_there(job); i++)
        usleep(10000);
    CHECK(!is_there(job));
    collector_stop(collector);
    rig_must(store_retention_set_periods(rig.store, 0, 0, 3600000, &err), &err, "store_retention_set_periods");
}

/* --- a large upload --------------------------------------------------------------------------------- */

/* All of the upload in one request; the reply. */
static int send_all(const char *id, struct buf *reply) {
    char *head = mem_printf("PATCH /v1/uploads/%s HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n" TUS
                            "Content-Type: application/offset+octet-stream\r\nUpload-Offset: 0\r\n"
                            "Content-Length: %zu\r\n\r\n",
                            id, LARGE);
    static const char zeros[1 << 20];
    int fd = rig_connect(&rig);
    buf_init(reply, 1 << 20);
    rig_send(fd, head, strlen(head));
    for (size_t sent = 0; sent < LARGE; sent += sizeof zeros)
        rig_send(fd, zeros, sizeof zeros);
    rig_receive(fd, reply, "\r\n\r\n");
    close(fd);
    mem_free(head);
    return rig_status(reply);
}

/* What is received is committed now and then. Where that fails the client is told in the middle, and of what was
 * received only what is on disk counts. */
static void check_large(void) {
    struct buf reply;
    char id[33] = "", *length = mem_printf(TUS "Upload-Length: %zu\r\n", LARGE), path[64];
    rig.api->config.max_upload_bytes = LARGE;
    CHECK(ask("POST", "/v1/uploads", length, &reply) == 201);
    const char *location = strstr(buf_text(&reply), "\r\nLocation: /v1/uploads/");
    CHECK(location && sscanf(location + 24, "%32[0-9a-f]", id) == 1);
    buf_release(&reply);
    snprintf(path, sizeof path, "/v1/uploads/%s", id);
    system_break(" fdatasync ", EIO);
    int status = send_all(id, &reply);
    system_mend();
    CHECK_THAT(status == 500, "%d: %s", status, buf_text(&reply));
    buf_release(&reply);
    check_answer("HEAD", path, TUS, 200, "Upload-Offset: 0\r\n");
    status = send_all(id, &reply);
    CHECK_THAT(status == 204 && strstr(buf_text(&reply), "Link: </v1/scenes/"), "%d: %s", status, buf_text(&reply));
    buf_release(&reply);
    mem_free(length);
}

int main(void) {
    rig_start(&rig, &rig_patient, 60);
    log_set_level(LOG_ERROR);
    reserve = file_join(rig.dir, "reserve");
    check_probe();
    check_reserve();
    check_collector();
    check_large();
    mem_free(reserve);
    rig_stop(&rig);
    return check_result();
}
