/* Request targets: what is decoded, what is refused. */
#include "server/net/target.h"

#include "common/mem.h"
#include "common/url.h"
#include "tests/check.h"

static void accept_path(const char *raw, size_t count, const char *rest) {
    struct target t;
    struct error err;
    CHECK_THAT(target_parse(&t, raw, &err) == STATUS_OK, "%s: %s", raw, err.message);
    CHECK_THAT(t.segment_count == count, "%s has %zu parts", raw, t.segment_count);
    char *joined = target_rest(&t, 0);
    CHECK_STRING(joined ? joined : "", rest);
    mem_free(joined);
    target_release(&t);
}

static void refuse(const char *raw) {
    struct target t;
    struct error err;
    CHECK_THAT(target_parse(&t, raw, &err) == STATUS_INPUT, "%s was taken", raw);
    target_release(&t);
}

static void check_paths(void) {
    accept_path("/", 0, "");
    accept_path("/v1/jobs", 2, "v1/jobs");
    accept_path("/v1/jobs/7/outputs/preview/base_color.png", 6, "v1/jobs/7/outputs/preview/base_color.png");
    accept_path("/v1/jobs/7/outputs/preview%2Fbase_color.png", 5, "v1/jobs/7/outputs/preview/base_color.png");
    accept_path("/a%20b/%C3%A4?x", 2, "a b/\xC3\xA4");
    accept_path("/...", 1, "...");
    accept_path("/a+b", 1, "a+b");
    accept_path("http://localhost/v1/jobs", 2, "v1/jobs");
    accept_path("HTTPS://[::1]:8443", 0, "");
}

static void check_refused(void) {
    static const char *const bad[] = {
        "",
        "*",
        "v1",
        "ftp://localhost/v1",
        "http:/v1",
        "http:",
        "http://localhost#a",
        "http://localhost//v1",
        "//",
        "//evil.org/",
        "/v1//jobs",
        "/v1/jobs/",
        "/..",
        "/a/../b",
        "/a/./b",
        "/a/%2e%2e/b",
        "/a%2f..%2fb",
        "/a%2F",
        "/%2fa",
        "/a%2f%2fb",
        "/a%00b",
        "/a%0ab",
        "/a%7fb",
        "/a%",
        "/a%2",
        "/a%zz",
        "/%%41",
        "/a#b",
        "/1/2/3/4/5/6/7/8/9/10/11/12/13/14/15/16/17",
        "/a%ff",
        "/a%c3",
        "/a?x=%ff",
        "/\xC3\xA4",
        "/a b",
        "/a\033b",
        "/a?x=%0",
        "/a?x=%00",
        "/a?x=1&x=2",
        "/a?x&x",
        "/a?a=&b=&c=&d=&e=&f=&g=&h=&i=&j=&k=&l=&m=&n=&o=&p=&q=",
    };
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        refuse(bad[i]);
}

static void check_queries(void) {
    struct target t;
    CHECK(target_parse(&t, "/a?name=my+room%21&empty=&flag&x=%3D%26", NULL) == STATUS_OK);
    CHECK_STRING(target_query(&t, "name"), "my room!");
    CHECK_STRING(target_query(&t, "empty"), "");
    CHECK_STRING(target_query(&t, "flag"), "");
    CHECK_STRING(target_query(&t, "x"), "=&");
    CHECK(target_query(&t, "nam") == NULL);
    CHECK_STRING(t.path, "/a");
    target_release(&t);

    /* The absolute form, without a path too. */
    CHECK(target_parse(&t, "http://lab.example.org:80?name=x", NULL) == STATUS_OK);
    CHECK_STRING(t.authority, "lab.example.org:80");
    CHECK_STRING(t.path, "/");
    CHECK_STRING(target_query(&t, "name"), "x");
    target_release(&t);
}

static void check_encoded(void) {
    struct buf text;
    buf_init(&text, 100);
    url_encode(&text, "a b/\xC3\xA4~", true);
    CHECK_STRING(buf_text(&text), "a%20b/%C3%A4~");
    buf_clear(&text);
    url_encode(&text, "a/b", false);
    CHECK_STRING(buf_text(&text), "a%2Fb");
    buf_release(&text);
}

int main(void) {
    check_paths();
    check_refused();
    check_queries();
    check_encoded();
    return check_result();
}
