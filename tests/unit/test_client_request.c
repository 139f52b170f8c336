/* The real client against a server that follows a script: broken connections, replies that are lost or cut,
 * refusals, a user who does not wait. What it fetches and sends: test_client_transfer.c. */
#include "tests/unit/client_script.h"

/* --- tries --------------------------------------------------------------------------------- */

static void test_tries(void) {
    struct script s = {0};
    /* What reads is tried again. */
    add_reply(&s, "503 Busy", "Retry-After: 0\r\n", "{\"detail\":\"starting\"}", "GET /v1/jobs?limit=20 ", NULL, NULL);
    add_step(&s, "", "GET /v1/jobs?limit=20 ", NULL, NULL);
    add_step(&s, "HTTP/1.1 200 OK\r\nContent-Length: 90\r\n\r\n{", NULL, NULL, NULL);
    add_reply(&s, "200 OK", "", "{\"items\":[],\"next\":null}", "GET /v1/jobs?limit=20 ", "User-Agent: unbake/", NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "list --json"), 0);
    CHECK_STRING(out_text, "[]\n");
    script_end(&s, "tries");

    /* What acts is not, once the server may have got it... */
    add_step(&s, "", "POST /v1/jobs/5/cancel ", "Content-Length: 0", NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "cancel 5"), 5);
    script_end(&s, "act once");

    /* ... but for a reply that says it was not taken. */
    add_reply(&s, "503 Busy", "Retry-After: 0\r\n", "{}", "POST /v1/jobs/5/cancel ", NULL, NULL);
    add_reply(&s, "202 Accepted", "", "{\"state\":\"cancelled\",\"wanted\":\"run\"}", "POST", NULL, NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "cancel 5"), 0);
    CHECK_STRING(out_text, "job 5 is cancelled\n");
    script_end(&s, "act after 503");
}

static void test_pages(void) {
    struct script s = {0};
    add_reply(&s, "200 OK", "", "{\"items\":[{\"id\":3},{\"id\":2}],\"next\":\"a b&\"}",
              "GET /v1/jobs?state=failed&limit=3 ", NULL, NULL);
    add_reply(&s, "200 OK", "", "{\"items\":[{\"id\":1}],\"next\":\"more\"}",
              "GET /v1/jobs?state=failed&limit=1&cursor=a%20b%26 ", NULL, NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "list -q --state failed --limit 3"), 0);
    CHECK_STRING(out_text, "3\n2\n1\n");
    script_end(&s, "pages");
}

static void test_refusals(void) {
    static const struct {
        const char *code, *body;
        int exit_status;
        const char *said;
    } t[] = {
        {"404 Not Found", "{\"detail\":\"there is no job 5\"}", 3, "unbake: there is no job 5\n"},
        {"409 Conflict", "{\"detail\":\"job 5 has ended\",\"hint\":\"retry it\"}", 6, "  hint: retry it\n"},
        {"412 Stale", "{\"detail\":\"changed\"}", 6, "changed"},
        {"422 Invalid",
         "{\"detail\":\"2 faults\",\"invalid_params\":[{\"name\":\"settings.a\",\"reason\":\"no\",\"hint\":\"b?\"},"
         "{\"name\":\"labels\",\"reason\":\"\\u001b[31m\"}]}",
         4, "  settings.a: no (b?)\n  labels: ?[31m\n"},
        {"429 Full", "{\"detail\":\"the queue is full\"}", 4, "the queue is full"},
        {"500 Oops", "{\"detail\":\"a defect\"}", 4, "a defect"},
        {"507 Full", "{\"detail\":\"no room\"}", 4, "no room"},
        {"418 Teapot", "short", 4, "answered 418"},
        {"200 OK", "{\"cut", 5, "does not answer in JSON"},
    };
    for (size_t i = 0; i < sizeof t / sizeof *t; i++) {
        struct script s = {0};
        add_reply(&s, t[i].code, "", t[i].body, "POST /v1/jobs/5/retry ", NULL, NULL);
        script_start(&s);
        CHECK_EXIT(client(&s, "retry 5"), t[i].exit_status);
        CHECK_PART(err_text, t[i].said);
        CHECK_STRING(out_text, "");
        script_end(&s, t[i].code);
    }
}

/* --- watch --------------------------------------------------------------------------------- */

#define STREAM "HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\nConnection: close\r\n\r\n"
#define SNAPSHOT STREAM "id: 5\nevent: state\ndata: {\"id\":7,\"state\":\"running\",\"snapshot\":true}\n\n"

static void test_watch(void) {
    struct script s = {0};
    add_step(&s,
             SNAPSHOT "id: 6\nevent: progress\ndata: {\"stage\":\"refine\",\"done\":1,\"total\":4}\n\n"
                      "id: 7\nevent: progress\ndata: {\"sta",
             "GET /v1/jobs/7/events ", "Accept: text/event-stream", "!Last-Event-ID");
    add_step(&s, "", "Last-Event-ID: 6\r\n", NULL, NULL);
    add_step(&s,
             STREAM "id: 6\nevent: state\ndata: {\"state\":\"running\",\"snapshot\":true}\n\n"
                    "id: 7\nevent: log\ndata: {\"level\":\"warning\",\"message\":\"dim\"}\n\n"
                    "id: 8\nevent: state\ndata: {\"state\":\"succeeded\"}\n\n",
             "Last-Event-ID: 6\r\n", NULL, NULL);
    add_reply(&s, "200 OK", "",
              "{\"id\":7,\"state\":\"succeeded\",\"started_at\":\"2024-01-01T00:00:00.000Z\","
              "\"finished_at\":\"2024-01-01T00:03:05.000Z\"}",
              "GET /v1/jobs/7 ", NULL, NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "watch 7"), 0);
    CHECK_STRING(out_text, "job 7  running    0%\njob 7  refine   25%\nwarning: dim\n"
                           "job 7 succeeded after 3m05s\nfetch its outputs with: unbake get 7\n");
    script_end(&s, "watch, cut");

    /* Reconnected after the end: 204. A failed job is exit status 1, with its reason. */
    add_step(&s, SNAPSHOT, NULL, NULL, NULL);
    add_step(&s, "HTTP/1.1 204 No Content\r\n\r\n", "Last-Event-ID: 5\r\n", NULL, NULL);
    add_reply(&s, "200 OK", "",
              "{\"id\":7,\"state\":\"failed\",\"reason\":\"bad input\",\"hint\":\"mend it\",\"scene\":\"ab\"}",
              "GET /v1/jobs/7 ", NULL, NULL);
    add_reply(&s, "200 OK", "", "{\"problems\":[{\"file\":\"a.png\",\"reason\":\"cut off\"}]}", "GET /v1/scenes/ab ",
              NULL, NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "watch 7"), 1);
    CHECK_PART(out_text, "job 7 failed: bad input\n  hint: mend it\n  a.png: cut off\n");
    script_end(&s, "watch, failed");

    /* JSON: each event a line, and the exit status. */
    add_step(&s, SNAPSHOT "id: 6\nevent: state\ndata: {\"state\":\"cancelled\"}\n\n", "Last-Event-ID: 0", NULL, NULL);
    add_reply(&s, "200 OK", "", "{\"id\":7,\"state\":\"cancelled\"}", "GET /v1/jobs/7 ", NULL, NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "watch 7 --json --all"), 1);
    CHECK_STRING(out_text,
                 "{\"id\":5,\"event\":\"state\",\"data\":{\"id\":7,\"state\":\"running\",\"snapshot\":true}}\n"
                 "{\"id\":6,\"event\":\"state\",\"data\":{\"state\":\"cancelled\"}}\n");
    script_end(&s, "watch, json");

    add_reply(&s, "404 Not Found", "", "{\"detail\":\"there is no job 7\"}", NULL, NULL, NULL);
    script_start(&s);
    CHECK_EXIT(client(&s, "watch 7"), 3);
    script_end(&s, "watch, unknown");
}

/* Nobody listens: what is tried ends, soon, with 5. */
static void test_unreachable(void) {
    struct script s = {0};
    script_start(&s);
    int port = s.port;
    script_end(&s, "unreachable");
    s.port = port;
    CHECK_EXIT(client(&s, "list --retry 0.3"), 5);
    CHECK_PART(err_text, "Connection refused");
    CHECK_EXIT(client(&s, "watch 7 --retry 0.3"), 5);
    CHECK_EXIT(client(&s, "version --json"), 0);
    CHECK_PART(out_text, "\"server\":null");
    CHECK_EXIT(client(&s, "settings --json --retry 0 -q"), 0);
    CHECK_PART(out_text, "texture_size");
}

/* Ctrl-C while watching: at once, with 130, and a word about the job. */
static void test_interrupted(void) {
    struct script s = {0};
    char byte, server[64], path[64];
    const char *build = getenv("UNBAKE_BUILD");
    char *program = mem_printf("%s/unbake", build ? build : "build");
    add_step(&s, HANG, "GET /v1/jobs/7/events ", NULL, NULL);
    script_start(&s);
    snprintf(server, sizeof server, "http://127.0.0.1:%d", s.port);
    snprintf(path, sizeof path, "%s/err", root);
    pid_t child = fork();
    if (child == 0) {
        if (!freopen(path, "w", stderr))
            _exit(99);
        execl(program, "unbake", "watch", "7", "--server", server, (char *)NULL);
        _exit(99);
    }
    CHECK(read(s.hanging[0], &byte, 1) == 1);
    CHECK(kill(child, SIGINT) == 0);
    int status = 0;
    CHECK(waitpid(child, &status, 0) == child);
    CHECK(WIFEXITED(status) && WEXITSTATUS(status) == 130);
    read_text(path, err_text, sizeof err_text);
    CHECK_PART(err_text, "job 7 continues");
    script_end(&s, "interrupted");
    mem_free(program);
}

int main(void) {
    if (!mkdtemp(root))
        return 1;
    test_tries();
    test_pages();
    test_refusals();
    test_watch();
    test_unreachable();
    test_interrupted();
    file_remove_tree(root, NULL);
    return check_result();
}
