/* test_address.c -- where requests come from, with proxies that are trusted and words that are not; and the throttle on
 * wrong tokens that goes by it. */
#include "server/net/address.h"

#include <arpa/inet.h>
#include <netinet/in.h>

#include "common/mem.h"
#include "server/http/auth_throttle.h"
#include "tests/check.h"

static struct address at(const char *text) {
    struct address a = {{0}};
    CHECK_THAT(address_parse(text, strlen(text), &a), "%s", text);
    return a;
}

static void check_texts(void) {
    static const struct {
        const char *text, *shown; /* NULL: refused */
    } cases[] = {
        {"10.1.2.3", "10.1.2.3"},
        {"10.1.2.3:80", "10.1.2.3"},
        {"::ffff:10.1.2.3", "10.1.2.3"},
        {"2001:DB8::1", "2001:db8::1"},
        {"[2001:db8::1]", "2001:db8::1"},
        {"[2001:db8::1]:443", "2001:db8::1"},
        {"", NULL},
        {"unknown", NULL},
        {"_hidden", NULL},
        {"10.1.2", NULL},
        {"10.1.2.300", NULL},
        {"[::1", NULL},
        {"[::1]x", NULL},
        {"[]", NULL},
        {"1.2.3.4 ", NULL},
        {"[10.1.2.3]x:1", NULL},
        {"0000:0000:0000:0000:0000:0000:0000:0000:0000:0000:0000", NULL},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct address a;
        char shown[ADDRESS_TEXT_SIZE] = "";
        bool is_good = address_parse(cases[i].text, strlen(cases[i].text), &a);
        CHECK_THAT(is_good == (cases[i].shown != NULL), "%s", cases[i].text);
        if (!is_good || !cases[i].shown)
            continue;
        address_text(&a, shown);
        CHECK_STRING(shown, cases[i].shown);
    }
    struct sockaddr_in v4 = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(0x0a010203)};
    struct sockaddr_in6 v6 = {.sin6_family = AF_INET6, .sin6_addr = IN6ADDR_LOOPBACK_INIT};
    struct address four = address_of_socket((const struct sockaddr *)&v4), same = at("10.1.2.3"),
                   six = address_of_socket((const struct sockaddr *)&v6), one = at("::1");
    CHECK(memcmp(&four, &same, sizeof four) == 0 && memcmp(&six, &one, sizeof six) == 0);
}

static void check_nets(void) {
    static const char *const bad[] = {"10.0.0.0/33", "::1/129", "10.0.0.0/",   "10.0.0.0/x",  "10.0.0.0/-1",
                                      "/8",          "lab",     "10.0.0.1:80", "1.2.3.4/0008"};
    struct proxies p;
    struct error err;
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        CHECK_THAT(proxies_parse(&p, bad[i], "Forwarded", &err) == STATUS_INPUT && strstr(err.message, bad[i]), "%s",
                   bad[i]);
    CHECK(proxies_parse(&p, "", "X-Real-IP", &err) == STATUS_INPUT && strstr(err.message, "X-Real-IP"));
    CHECK(proxies_parse(&p, " 10.0.0.0/9,::1\t192.168.7.4, 2001:db8::/33", "x-forwarded-for", &err) == STATUS_OK);
    CHECK(p.count == 4 && strcmp(p.field, "X-Forwarded-For") == 0);
    static const struct {
        const char *text;
        bool is_trusted;
    } cases[] = {
        {"10.127.255.255", true},
        {"10.128.0.0", false},
        {"11.0.0.0", false},
        {"::1", true},
        {"::2", false},
        {"192.168.7.4", true},
        {"192.168.7.5", false},
        {"2001:db8:7fff::1", true},
        {"2001:db8:8000::1", false},
        {"::10.0.0.1", false},
        {"::ffff:10.0.0.1", true},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct address a = at(cases[i].text);
        CHECK_THAT(proxies_trust(&p, &a) == cases[i].is_trusted, "%s", cases[i].text);
    }
    CHECK(proxies_parse(&p, "0.0.0.0/0", "Forwarded", &err) == STATUS_OK);
    struct address four = at("8.8.8.8"), six = at("2001:db8::1");
    CHECK(proxies_trust(&p, &four) && !proxies_trust(&p, &six));
}

/* The address of a request from `peer` whose fields of that name are `values`, one after the other. */
static void check_request(const char *field, const char *peer, const char *const *values, const char *wanted) {
    struct field fields[4];
    struct request r = {.fields = fields};
    struct proxies p;
    struct error err;
    char shown[ADDRESS_TEXT_SIZE];
    CHECK(proxies_parse(&p, "10.0.0.0/8 ::1", field, &err) == STATUS_OK);
    for (; values[r.field_count]; r.field_count++) {
        fields[r.field_count].name = mem_strdup(r.field_count % 2 ? "x-forwarded-for" : "X-Forwarded-For");
        if (strcmp(field, "Forwarded") == 0)
            memcpy(fields[r.field_count].name, "Forwarded", 10);
        fields[r.field_count].value = mem_strdup(values[r.field_count]);
    }
    struct address from = at(peer), a = address_of_request(r.fields, r.field_count, &from, &p);
    address_text(&a, shown);
    CHECK_THAT(strcmp(shown, wanted) == 0, "%s: %s", values[0] ? values[0] : "(none)", shown);
    for (size_t i = 0; i < r.field_count; i++) {
        mem_free(fields[i].name);
        mem_free(fields[i].value);
    }
}
#define REQUEST(field, peer, wanted, ...) check_request(field, peer, (const char *const[]){__VA_ARGS__, NULL}, wanted)

static void check_requests(void) {
    const char *x = "X-Forwarded-For", *f = "Forwarded";
    REQUEST(x, "192.0.2.9", "192.0.2.9", "1.1.1.1"); /* anybody may say so */
    REQUEST(x, "10.0.0.1", "10.0.0.1", NULL);
    REQUEST(x, "10.0.0.1", "192.0.2.1", "192.0.2.1");
    REQUEST(x, "::1", "2001:db8::7", "2001:db8::7");
    REQUEST(x, "10.0.0.1", "192.0.2.1", "1.1.1.1, 192.0.2.1"); /* the client's own word is on the left */
    REQUEST(x, "10.0.0.1", "192.0.2.1", "1.1.1.1, 192.0.2.1 , 10.0.0.2");
    REQUEST(x, "10.0.0.1", "192.0.2.1", "1.1.1.1", "192.0.2.1, 10.3.0.2", "10.0.0.2"); /* fields are one list */
    REQUEST(x, "10.0.0.1", "10.0.0.3", "10.0.0.3, 10.0.0.2");                          /* a client within the network */
    REQUEST(x, "10.0.0.1", "10.0.0.1", "1.1.1.1, unknown");
    REQUEST(x, "10.0.0.1", "10.0.0.2", "1.1.1.1, , 10.0.0.2");
    REQUEST(x, "10.0.0.1", "10.0.0.1", "");
    REQUEST(f, "10.0.0.1", "192.0.2.1", "for=1.1.1.1, for=192.0.2.1;proto=https;by=10.0.0.1");
    REQUEST(f, "10.0.0.1", "2001:db8::7", "proto=http; For=\"[2001:db8::7]:4711\"");
    REQUEST(f, "10.0.0.1", "192.0.2.1", "for=1.1.1.1", "host=\"a,b;for=9.9.9.9\";for=192.0.2.1");
    REQUEST(f, "10.0.0.1", "10.0.0.1", "for=_gazonk");
    REQUEST(f, "10.0.0.1", "10.0.0.1", "proto=http");
    REQUEST(f, "10.0.0.1", "10.0.0.1", "for=\"");
    REQUEST(f, "10.0.0.1", "10.0.0.1", "\"");
}

/* --- the throttle --------------------------------------------------------------------------- */

static void check_brake(void) {
    struct auth_throttle *b = auth_throttle_new();
    struct address one = at("192.0.2.1"), other = at("192.0.2.2"), six = at("2001:db8::1"), near = at("2001:db8::2:1"),
                   far = at("2001:db8:0:1::1");
    bool is_first;
    int burst = (int)AUTH_THROTTLE_BURST;
    for (int i = 0; i < burst; i++)
        CHECK(auth_throttle_fail(b, &one, 100.0, &is_first) == 0.0 && !is_first);
    double wait_sec = auth_throttle_fail(b, &one, 100.0, &is_first);
    CHECK_NEAR(wait_sec, 1.0 / AUTH_THROTTLE_PER_SEC, 1e-9);
    CHECK(is_first);
    CHECK(auth_throttle_fail(b, &one, 100.1, &is_first) > 0.0 && !is_first);
    CHECK(auth_throttle_fail(b, &other, 100.0, &is_first) == 0.0);
    /* Refused ones take no room: it comes back for one, and is told once more. */
    CHECK(auth_throttle_fail(b, &one, 100.0 + 1.0 / AUTH_THROTTLE_PER_SEC, &is_first) == 0.0 && !is_first);
    CHECK(auth_throttle_fail(b, &one, 100.0 + 1.0 / AUTH_THROTTLE_PER_SEC, &is_first) > 0.0 && is_first);
    /* A clock that stands or goes back gives no room. */
    CHECK(auth_throttle_fail(b, &one, 50.0, &is_first) > 0.0);
    for (int i = 0; i < burst; i++)
        auth_throttle_fail(b, i % 2 ? &six : &near, 100.0, &is_first);
    CHECK(auth_throttle_fail(b, &near, 100.0, &is_first) > 0.0); /* one /64 */
    CHECK(auth_throttle_fail(b, &far, 100.0, &is_first) == 0.0);
    /* After a long time all is forgotten. */
    for (int i = 0; i < burst; i++)
        CHECK(auth_throttle_fail(b, &one, 10000.0, &is_first) == 0.0);
    auth_throttle_free(b);
}

/* Whoever has very many addresses does not free one that is throttled by using the others once each. */
static void check_flood(void) {
    struct auth_throttle *b = auth_throttle_new();
    struct address one = at("192.0.2.1"), many = at("2001:db8::");
    bool is_first;
    for (int i = 0; i <= (int)AUTH_THROTTLE_BURST; i++)
        auth_throttle_fail(b, &one, 1.0, &is_first);
    for (uint32_t i = 0; i < 100000; i++) {
        memcpy(many.bytes + 4, &i, sizeof i);
        CHECK(auth_throttle_fail(b, &many, 1.0, &is_first) == 0.0);
    }
    CHECK(auth_throttle_fail(b, &one, 1.0, &is_first) > 0.0);
    auth_throttle_free(b);
}

int main(void) {
    check_texts();
    check_nets();
    check_requests();
    check_brake();
    check_flood();
    return check_result();
}
