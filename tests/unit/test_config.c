/* Options: the table, the documented file, faults all at once, addresses. */
#include "server/config.h"

#include <fcntl.h>

#include "common/mem.h"
#include "server/invocation.h"
#include "tests/check.h"

static char *write_file(const char *text) {
    char *path = mem_strdup("/tmp/test_config.XXXXXX");
    int fd = mkstemp(path);
    if (fd < 0 || write(fd, text, strlen(text)) != (ssize_t)strlen(text))
        CHECK_SKIP("cannot write to /tmp");
    close(fd);
    return path;
}

/* Reads `text` as a file; the problems, without the file's name, are the caller's. */
static char *problems_of(struct config *c, const char *text) {
    struct buf problems;
    struct error err;
    buf_init(&problems, 65536);
    char *path = write_file(text);
    CHECK(config_read(c, path, &problems, &err) == STATUS_OK);
    unlink(path);
    struct buf plain;
    buf_init(&plain, 65536);
    for (const char *at = buf_text(&problems); *at;) {
        if (strncmp(at, path, strlen(path)) == 0)
            at += strlen(path);
        buf_append(&plain, at++, 1);
    }
    mem_free(path);
    buf_release(&problems);
    char *result = mem_strdup(buf_text(&plain));
    buf_release(&plain);
    return result;
}

/* Defaults lie in their ranges: setting each again gives no problem. */
static void check_defaults(void) {
    size_t count;
    const struct config_option *table = config_table(&count);
    struct config c;
    struct buf problems;
    buf_init(&problems, 65536);
    config_init(&c);
    for (size_t i = 0; i < count; i++)
        config_set(&c, table[i].name, table[i].default_text, "default", &problems);
    config_check(&c, &problems);
    CHECK_STRING(buf_text(&problems), "");
    CHECK(c.max_attempts == 3 && c.sandbox && c.keepalive_sec == 15);
    config_release(&c);
    buf_release(&problems);
}

/* config/unbaked.conf has each option of the table once, in its order, with its default, and the
 * comment above it gives unit and range. */
static void check_documented(void) {
    size_t count;
    const struct config_option *table = config_table(&count);
    FILE *file = fopen("config/unbaked.conf", "r");
    char line[256], comment[4096] = "", wanted[256], value[128];
    size_t next = 0;
    CHECK(file != NULL);
    while (file && fgets(line, sizeof line, file)) {
        line[strcspn(line, "\n")] = '\0';
        if (line[0] == '#') {
            snprintf(comment + strlen(comment), sizeof comment - strlen(comment), "%s ", line + 1);
            continue;
        }
        if (line[0] != '\0') {
            const struct config_option *o = &table[next < count ? next : 0];
            snprintf(wanted, sizeof wanted, "%s =%s%s", o->name, *o->default_text ? " " : "", o->default_text);
            CHECK_STRING(line, wanted);
            if (o->type == CONFIG_INT || o->type == CONFIG_REAL) {
                snprintf(value, sizeof value, "(%s, %.15g to %.15g", o->unit, o->minimum, o->maximum);
                /* The comment may break the range over two lines. */
                char *high = strrchr(value, ' ');
                CHECK_THAT(strstr(comment, high + 1), "%s: its comment has no \"%s\"", o->name, high + 1);
                *high = '\0';
                CHECK_THAT(strstr(comment, value), "%s: its comment has no \"%s\"", o->name, value);
            } else if (o->type == CONFIG_BOOL) {
                CHECK_THAT(strstr(comment, "yes or no"), "%s: its comment has no \"yes or no\"", o->name);
            }
            next++;
        }
        comment[0] = '\0';
    }
    CHECK_THAT(next == count, "%zu of %zu options are documented", next, count);
    if (file)
        fclose(file);
    struct config c;
    struct buf problems;
    struct error err;
    config_init(&c);
    buf_init(&problems, 4096);
    CHECK(config_read(&c, "config/unbaked.conf", &problems, &err) == STATUS_OK);
    CHECK_STRING(buf_text(&problems), "");
    buf_release(&problems);
    config_release(&c);
}

static void check_faults(void) {
    struct config c;
    config_init(&c);
    char *found = problems_of(&c, "max_runing = 2\n# fine\nthreads=x\n  max_attempts = 0 # low\n\n"
                                  "sandbox = maybe\nkeepalive_sec\nqueue_limit = 2.5\nqueue_limit = 7\n"
                                  "entirely_else = 1\r\nhead_timeout_sec = nan\nmax_running = 3\n");
    CHECK_STRING(found, ":1: unknown option \"max_runing\"; did you mean max_running?\n"
                        ":3: threads must be a whole number from 0 to 1024 threads, not \"x\"\n"
                        ":4: max_attempts must be a whole number from 1 to 100 attempts, not \"0\"\n"
                        ":6: sandbox must be yes or no, not \"maybe\"\n"
                        ":7: \"keepalive_sec\" is not of the form name = value\n"
                        ":8: queue_limit must be a whole number from 1 to 1000000 jobs, not \"2.5\"\n"
                        ":9: queue_limit is given twice\n"
                        ":10: unknown option \"entirely_else\"\n"
                        ":11: head_timeout_sec must be a number from 1 to 600 s, not \"nan\"\n");
    CHECK(c.max_running == 3 && c.queue_limit == 1000);
    mem_free(found);
    struct buf problems;
    struct error err;
    buf_init(&problems, 4096);
    CHECK(config_read(&c, "/nonexistent/unbaked.conf", &problems, &err) == STATUS_NOT_FOUND);
    config_set(&c, "max_streams", "1000", "flag", &problems);
    config_set(&c, "log_level", "loud", "flag", &problems);
    config_set(&c, "listen", "0.0.0.0", "flag", &problems);
    config_set(&c, "access", "all", "flag", &problems);
    config_set(&c, "tls_key", "key.pem", "flag", &problems);
    config_set(&c, "trusted_proxies", "::1 lab", "flag", &problems);
    config_check(&c, &problems);
    CHECK(strstr(buf_text(&problems), "flag: max_streams (1000) must be less than max_connections (1000)"));
    CHECK(strstr(buf_text(&problems), "flag: log_level must be"));
    CHECK(strstr(buf_text(&problems), "flag: listen must be like"));
    CHECK(strstr(buf_text(&problems), "flag: access must be auto, tokens or open, not \"all\""));
    CHECK(strstr(buf_text(&problems), "flag: tls_certificate and tls_key go together"));
    CHECK(strstr(buf_text(&problems), "flag: trusted_proxies must be addresses like"));
    buf_release(&problems);
    config_release(&c);
}

/* Each problem names the line of the file, also one that is found when all is read; of two options that do not go
 * together, the line of one. */
static void check_lines(void) {
    struct config c;
    config_init(&c);
    char *path = write_file(
        "# a comment\nlisten = here\n\nmax_connections = 9\naccess = all\nlog_level = loud\nlog_format = xml\n"
        "data_dir =\ntls_certificate = a.pem\nproxy_field = Via\nmax_runing = 1\n");
    struct buf problems;
    struct error err;
    buf_init(&problems, 65536);
    CHECK(config_read(&c, path, &problems, &err) == STATUS_OK);
    config_check(&c, &problems);
    static const char *const wanted[] = {":2: listen",          ":4: max_streams",  ":5: access",
                                         ":6: log_level",       ":7: log_format",   ":8: data_dir",
                                         ":9: tls_certificate", ":10: proxy_field", ":11: unknown option"};
    size_t lines = 0;
    for (size_t i = 0; i < sizeof wanted / sizeof *wanted; i++) {
        char *start = mem_printf("%s%s", path, wanted[i]);
        CHECK_THAT(strstr(buf_text(&problems), start), "%s is not in: %s", start, buf_text(&problems));
        mem_free(start);
    }
    for (const char *at = buf_text(&problems); *at; at++)
        lines += *at == '\n';
    CHECK_THAT(lines == sizeof wanted / sizeof *wanted, "%s", buf_text(&problems));
    unlink(path);
    mem_free(path);
    buf_release(&problems);
    config_release(&c);
}

static void check_addresses(void) {
    static const struct {
        const char *text, *address;
        int port; /* -1: refused */
        bool is_public;
    } cases[] = {
        {"127.0.0.1:7117", "127.0.0.1", 7117, false},
        {"127.8.9.1:0", "127.8.9.1", 0, false},
        {"localhost:80", "127.0.0.1", 80, false},
        {"[::1]:65535", "::1", 65535, false},
        {"0.0.0.0:80", "0.0.0.0", 80, true},
        {"[::]:80", "::", 80, true},
        {"192.168.1.1:80", "192.168.1.1", 80, true},
        {"[::ffff:127.0.0.1]:80", "::ffff:127.0.0.1", 80, true}, /* not known for loopback */
        {"::1:80", "", -1, false},
        {"127.0.0.1", "", -1, false},
        {"127.0.0.1:65536", "", -1, false},
        {"127.0.0.1:-1", "", -1, false},
        {":80", "", -1, false},
        {"127.1:80", "", -1, false},
        {"127.0.0.1.evil.org:80", "", -1, false},
        {"[127.0.0.1]:80", "", -1, false},
        {"", "", -1, false},
        {"127.0.0.1:8 ", "", -1, false},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char address[CONFIG_ADDRESS_SIZE];
        uint16_t port = 1;
        bool is_loopback = false;
        struct error err;
        enum status status = config_address(cases[i].text, address, &port, &is_loopback, &err);
        if (cases[i].port < 0) {
            CHECK_THAT(status == STATUS_INPUT, "%s", cases[i].text);
        } else {
            CHECK_THAT(status == STATUS_OK && port == cases[i].port && is_loopback != cases[i].is_public, "%s",
                       cases[i].text);
            CHECK_STRING(address, cases[i].address);
        }
    }
}

/* What cannot be read, or is no text, is refused as a whole. */
static void check_files(void) {
    struct config c;
    struct buf problems;
    struct error err;
    char *path = write_file("");
    config_init(&c);
    buf_init(&problems, 65536);
    CHECK(config_read(&c, path, &problems, &err) == STATUS_OK);
    int fd = open(path, O_WRONLY | O_CLOEXEC);
    CHECK(write(fd, "threads = 3\n\0", 13) == 13);
    close(fd);
    CHECK(config_read(&c, path, &problems, &err) == STATUS_INPUT && strstr(err.message, ":2: is not a text file"));
    unlink(path);
    CHECK(config_read(&c, path, &problems, &err) == STATUS_NOT_FOUND && strstr(err.message, path));
    CHECK(problems.length == 0 && c.threads == 0);
    buf_release(&problems);
    config_release(&c);
    mem_free(path);
}

/* The file that commands read where they are told of none: it need not be there, but must be good. */
static void check_default_file(void) {
    static const struct command_option flags[] = {INVOCATION_FLAGS, {0}};
    char *good = write_file("threads = 3\n"), *bad = write_file("threads = many\n");
    const struct {
        const char *file, *option;
        int code, threads;
    } cases[] = {{good, NULL, -1, 3},
                 {bad, NULL, EXIT_USAGE, 0},
                 {"/", NULL, EXIT_USAGE, 0},
                 {"/", "--data=x", -1, 0},
                 {"/nowhere/unbaked.conf", NULL, -1, 0},
                 {NULL, NULL, -1, 0}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char *option = cases[i].option ? mem_strdup(cases[i].option) : NULL, *argv[] = {"unbaked", option, NULL};
        struct invocation in;
        CHECK_THAT(invocation_read(&in, option ? 2 : 1, argv, flags, cases[i].file) == cases[i].code, "%s",
                   cases[i].file);
        CHECK(in.config.threads == cases[i].threads);
        invocation_release(&in);
        mem_free(option);
    }
    unlink(good);
    unlink(bad);
    mem_free(good);
    mem_free(bad);
}

int main(void) {
    check_defaults();
    check_documented();
    check_faults();
    check_lines();
    check_addresses();
    check_files();
    check_default_file();
    return check_result();
}
