/* test_progress.c -- the lines of a worker: whole, short enough, valid; and nobody to hear them. */
#include "server/worker/progress.h"

#include <fcntl.h>
#include <signal.h>

#include "common/mem.h"
#include "tests/check.h"

/* Reads one line from the pipe as JSON; the caller's. */
static cJSON *hear(int fd) {
    static char line[PROGRESS_LINE_MAX + 1];
    size_t length = 0;
    while (length < PROGRESS_LINE_MAX && read(fd, line + length, 1) == 1 && line[length] != '\n')
        length++;
    cJSON *value = NULL;
    struct error err;
    CHECK(length < PROGRESS_LINE_MAX);
    CHECK_THAT(json_parse(line, length, "line", &value, &err) == STATUS_OK, "%s", err.message);
    return value;
}

static const char *text(const cJSON *object, const char *key) {
    const char *value = "";
    struct error err;
    CHECK(json_string(object, key, "line", "", &value, &err) == STATUS_OK);
    return value;
}

static double number(const cJSON *object, const char *key) {
    double value = 0.0;
    struct error err;
    CHECK(json_number(object, key, "line", -77.0, &value, &err) == STATUS_OK);
    return value;
}

static void test_lines(struct progress *p, int fd) {
    cJSON *line;
    progress_stage(p, "refine");
    line = hear(fd);
    CHECK_STRING(text(line, "type"), "stage");
    CHECK_STRING(text(line, "stage"), "refine");
    cJSON_Delete(line);

    progress_step(p, "refine", 3, 10, INFINITY); /* no number in JSON: unknown */
    line = hear(fd);
    CHECK_STRING(text(line, "type"), "progress");
    CHECK(number(line, "done") == 3 && number(line, "total") == 10);
    CHECK(number(line, "eta_sec") == -77.0);
    cJSON_Delete(line);

    progress_metric(p, "loss", 120, 0.5);
    line = hear(fd);
    CHECK(number(line, "step") == 120 && number(line, "value") == 0.5);
    cJSON_Delete(line);

    progress_file(p, "output", "a.exr", 1ull << 40, "abc", "image/x-exr");
    line = hear(fd);
    CHECK_STRING(text(line, "type"), "output");
    CHECK(number(line, "bytes") == 1099511627776.0);
    cJSON_Delete(line);

    progress_problem(p, "a\nb\".png", "is \"odd\"", NULL);
    line = hear(fd);
    CHECK_STRING(text(line, "file"), "a\nb\".png");
    CHECK_STRING(text(line, "hint"), "");
    cJSON_Delete(line);
}

/* A message too long for a line is cut, also where every byte is written as six, and never inside a
 * character. */
static void test_long_message(struct progress *p, int fd) {
    char *large = mem_alloc(100001);
    memset(large, 1, 100000);
    large[100000] = '\0';
    progress_log(p, "info", large);
    cJSON_Delete(hear(fd));
    for (size_t i = 0; i + 2 < 100000; i += 2)
        memcpy(large + i, "\xc3\xa9", 2);
    large[0] = 'x';
    large[1] = 'y';
    memmove(large + 1, large + 2, 99000);
    progress_end(p, STATUS_IO, large, "");
    cJSON *line = hear(fd);
    CHECK_STRING(text(line, "status"), "io");
    size_t length = strlen(text(line, "message"));
    CHECK(length > 1000 && (length - 1) % 2 == 0);
    CHECK_STRING(text(line, "message") + length - 6, " [cut]");
    cJSON_Delete(line);
    mem_free(large);
}

int main(void) {
    int ends[2];
    CHECK(pipe(ends) == 0);
    CHECK(fcntl(ends[1], F_SETPIPE_SZ, 1 << 20) > 0);
    struct progress p = {.fd = ends[1]};
    test_lines(&p, ends[0]);
    test_long_message(&p, ends[0]);

    /* Nobody listens any more: no signal, no waiting, no more tries. */
    signal(SIGPIPE, SIG_IGN);
    close(ends[0]);
    progress_stage(&p, "report");
    CHECK(p.fd == -1);
    progress_stage(&p, "report");
    close(ends[1]);
    return check_result();
}
