/* test_deliver.c -- which addresses a webhook may call, its URLs, its signature, what an answer says. */
#include <arpa/inet.h>

#include "common/url.h"
#include "server/worker/deliver.h"
#include "tests/check.h"

static bool is_public(const char *text) {
    struct sockaddr_in v4 = {.sin_family = AF_INET};
    struct sockaddr_in6 v6 = {.sin6_family = AF_INET6};
    if (inet_pton(AF_INET, text, &v4.sin_addr) == 1)
        return deliver_is_public((struct sockaddr *)&v4);
    CHECK(inet_pton(AF_INET6, text, &v6.sin6_addr) == 1);
    return deliver_is_public((struct sockaddr *)&v6);
}

static void check_addresses(void) {
    static const char *const private[] = {"0.0.0.0",
                                          "10.1.2.3",
                                          "100.64.0.1",
                                          "127.0.0.1",
                                          "127.255.255.254",
                                          "169.254.169.254",
                                          "172.16.0.1",
                                          "172.31.255.255",
                                          "192.0.0.8",
                                          "192.0.2.1",
                                          "192.168.1.1",
                                          "198.18.0.1",
                                          "198.51.100.7",
                                          "203.0.113.9",
                                          "224.0.0.1",
                                          "255.255.255.255",
                                          "::",
                                          "::1",
                                          "fe80::1",
                                          "fc00::1",
                                          "fd12:3456::1",
                                          "ff02::1",
                                          "2001:db8::1",
                                          "::ffff:127.0.0.1",
                                          "::ffff:10.0.0.1",
                                          "64:ff9b::7f00:1",
                                          "2002:7f00:1::",
                                          "2001::1"};
    static const char *const public[] = {"1.1.1.1",         "8.8.8.8",        "100.63.255.255",  "100.128.0.1",
                                         "172.15.0.1",      "172.32.0.1",     "192.167.1.1",     "223.255.255.255",
                                         "2606:4700::1111", "::ffff:8.8.8.8", "64:ff9b::808:808"};
    for (size_t i = 0; i < sizeof private / sizeof *private; i++)
        CHECK_THAT(!is_public(private[i]), "%s", private[i]);
    for (size_t i = 0; i < sizeof public / sizeof *public; i++)
        CHECK_THAT(is_public(public[i]), "%s", public[i]);
}

static void check_urls(void) {
    struct url url;
    struct error err;
    CHECK(url_parse("https://example.org", &url, &err) == STATUS_OK && url.is_tls);
    CHECK_STRING(url.host, "example.org");
    CHECK_STRING(url.port, "443");
    CHECK_STRING(url.target, "");
    CHECK(url_parse("http://[::1]:8080/a/b?c=d", &url, &err) == STATUS_OK && !url.is_tls);
    CHECK_STRING(url.host, "::1");
    CHECK_STRING(url.port, "8080");
    CHECK_STRING(url.target, "/a/b?c=d");
    static const char *const bad[] = {"",
                                      "ftp://x/",
                                      "file:///etc/passwd",
                                      "http://",
                                      "http:///x",
                                      "http://user@x/",
                                      "http://u:p@x/",
                                      "http://x:0/",
                                      "http://x:65536/",
                                      "http://x:12345678/",
                                      "http://x:y/",
                                      "http://x y/",
                                      "http://x/\r\nHost: y",
                                      "http://x/#f",
                                      "http://[::1/",
                                      "http://[x]/",
                                      "http://x\\y/",
                                      "HTTP://x/",
                                      "http://x:/",
                                      "http://[::1]x/"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        CHECK_THAT(url_parse(bad[i], &url, &err) == STATUS_INPUT, "%s", bad[i]);
}

static void check_statuses(void) {
    CHECK(deliver_status("HTTP/1.1 200 OK\r\n") == 200);
    CHECK(deliver_status("HTTP/1.0 404 Not Found\n") == 404);
    CHECK(deliver_status("HTTP/1.1 204\r\n") == 204);
    CHECK(deliver_status("HTTP/1.1 503") == 503);
    static const char *const no_status[] = {"",
                                            "HTTP/1.1",
                                            "HTTP/1.1 ",
                                            "HTTP/1.1 20",
                                            "HTTP/1.1 -20 OK",
                                            "HTTP/1.1 2000 OK",
                                            "HTTP/1.1 099 OK",
                                            "HTTP/1.1 200OK",
                                            "HTTP/1.1  200 OK",
                                            "HTTP/1.2 200 OK",
                                            "HTTP/2 200",
                                            "http/1.1 200 OK",
                                            "ICY 200 OK"};
    for (size_t i = 0; i < sizeof no_status / sizeof *no_status; i++)
        CHECK_THAT(deliver_status(no_status[i]) == 0, "%s", no_status[i]);
}

static void check_signatures(void) {
    /* From: printf %s 'msg_1.1700000000.{}' | openssl dgst -sha256 -hmac a-secret-of-mine -binary | base64 */
    char signature[64];
    deliver_sign("a-secret-of-mine", "msg_1", 1700000000, "{}", signature);
    CHECK_STRING(signature, "v1,Xd/6c2MVkryC92SeVVR7LM8BbjruK54ef+m7qacFtVY=");
    /* The reference library's own: standardwebhooks, libraries/python/tests/test_webhooks.py, test_sign_function. */
    deliver_sign("whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw", "msg_p5jXN8AQM9LWM0D4loKWxJek", 1614265330,
                 "{\"test\": 2432232314}", signature);
    CHECK_STRING(signature, "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE=");
    /* What is no base64, or of too few bytes, is the key as it stands:
     * printf %s 'msg_1.1700000000.{}' | openssl dgst -sha256 -hmac 'whsec_not base64' -binary | base64 */
    deliver_sign("whsec_not base64", "msg_1", 1700000000, "{}", signature);
    CHECK_STRING(signature, "v1,koCIHAY4tYn2iV1PPmIh7AOgu8PKTu6e3Xbx4gtT1/U=");
    deliver_sign("whsec_c2hvcnQ=", "msg_1", 1700000000, "{}", signature);
    CHECK_STRING(signature, "v1,bFx7oQp2f0M93cVABJzGWZmxzNeel7tgrb2RxeE+jmo=");
}

int main(void) {
    check_addresses();
    check_urls();
    check_statuses();
    check_signatures();
    return check_result();
}
