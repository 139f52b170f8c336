/* test_log.c -- the three forms of a line, with what could break out of each. */
#include "common/log.h"

#include <fcntl.h>

#include "common/json.h"
#include "common/mem.h"
#include "tests/check.h"

/* What the call writes to stderr; the caller's. */
static char *caught(void (*write_it)(void)) {
    char path[] = "/tmp/test_log.XXXXXX", text[32768] = "";
    int to = mkstemp(path), saved = dup(STDERR_FILENO);
    if (to < 0 || saved < 0)
        CHECK_SKIP("cannot write to /tmp");
    unlink(path);
    dup2(to, STDERR_FILENO);
    write_it();
    dup2(saved, STDERR_FILENO);
    ssize_t got = pread(to, text, sizeof text - 1, 0);
    text[got > 0 ? got : 0] = '\0';
    close(to);
    close(saved);
    return mem_strdup(text);
}

static void write_nasty(void) {
    const struct log_field fields[] = {{"path", "/a b\"c\\\n{\xff}", false},
                                       {"status", "404", true},
                                       {"user", NULL, false},
                                       {"word", "plain", false},
                                       {"name", "a\u202Eb", false}};
    log_fields(LOG_WARNING, fields, 5, "it \"says\"\nlevel=error \x1b[31m");
}

static void write_long(void) {
    static char text[5000]; /* of what takes most room: soft hyphens, and quotes */
    for (size_t i = 0; i + 1 < sizeof text; i++)
        text[i] = i > 4000 ? '"' : "\xC2\xAD"[i % 2];
    struct log_field fields[LOG_FIELDS_MAX];
    for (size_t i = 0; i < LOG_FIELDS_MAX; i++)
        fields[i] = (struct log_field){"a_key_of_thirty_characters_abc", text, false};
    log_fields(LOG_ERROR, fields, LOG_FIELDS_MAX, "%s", text);
}

static void check_one_line(const char *text) {
    const char *end = strchr(text, '\n');
    CHECK(end && end[1] == '\0');
}

int main(void) {
    char *text = caught(write_nasty);
    check_one_line(text);
    CHECK(strstr(
        text,
        "Z warning: it \"says\"?level=error ?[31m path=\"/a b\\\"c\\\\?{?}\" status=404 word=plain name=a<U+202E>b\n"));
    mem_free(text);

    log_set_format(LOG_LOGFMT);
    text = caught(write_nasty);
    check_one_line(text);
    CHECK(strncmp(text, "time=2", 6) == 0);
    CHECK(strstr(text,
                 "Z level=warning msg=\"it \\\"says\\\"?level=error ?[31m\" path=\"/a b\\\"c\\\\?{?}\" status=404"));
    mem_free(text);

    log_set_format(LOG_JSON);
    void (*const both[])(void) = {write_nasty, write_long};
    for (size_t i = 0; i < 2; i++) {
        cJSON *value = NULL;
        struct error err = {0};
        text = caught(both[i]);
        check_one_line(text);
        /* The long one has one key several times, which json_parse refuses. */
        value = i == 0 ? NULL : cJSON_Parse(text);
        if (i == 0)
            CHECK_THAT(json_parse(text, strlen(text), "the line", &value, &err) == STATUS_OK, "%s", err.message);
        CHECK(value && cJSON_IsString(cJSON_GetObjectItem(value, "time")));
        if (i == 0) {
            CHECK(cJSON_GetObjectItem(value, "status")->valuedouble == 404);
            CHECK_STRING(cJSON_GetStringValue(cJSON_GetObjectItem(value, "msg")), "it \"says\"?level=error ?[31m");
        }
        cJSON_Delete(value);
        mem_free(text);
    }
    log_set_level(LOG_ERROR);
    text = caught(write_nasty);
    CHECK_STRING(text, "");
    mem_free(text);
    enum log_format format;
    CHECK(log_format_parse("logfmt", &format) && format == LOG_LOGFMT && !log_format_parse("xml", &format));
    return check_result();
}
