/* test_connection_counts.c -- how many connections an address may have, and who is not bound by that. */
#include "server/net/connection_counts.h"

#include "tests/check.h"

static struct address at(const char *text) {
    struct address a;
    CHECK_THAT(address_parse(text, strlen(text), &a), "%s", text);
    return a;
}

static enum connection_answer enter(struct connection_counts *c, const char *text) {
    struct address a = at(text);
    return connection_counts_enter(c, &a);
}

static void leave(struct connection_counts *c, const char *text) {
    struct address a = at(text);
    connection_counts_leave(c, &a);
}

int main(void) {
    struct proxies proxies;
    struct error err;
    CHECK(proxies_parse(&proxies, "10.0.0.7", "X-Forwarded-For", &err) == STATUS_OK);
    struct connection_counts *c = connection_counts_new(20, 3, &proxies); /* two of which are kept for loopback */
    for (int i = 0; i < 3; i++)
        CHECK(enter(c, "192.0.2.1") == CONNECTION_OK);
    CHECK(enter(c, "192.0.2.1") == CONNECTION_ADDRESS_FULL);
    leave(c, "192.0.2.1");
    CHECK(enter(c, "192.0.2.1") == CONNECTION_OK);
    /* A /64 is one address. */
    CHECK(enter(c, "2001:db8::1") == CONNECTION_OK && enter(c, "2001:db8::2") == CONNECTION_OK &&
          enter(c, "2001:db8::3") == CONNECTION_OK);
    CHECK(enter(c, "2001:db8::4") == CONNECTION_ADDRESS_FULL && enter(c, "2001:db8:0:1::4") == CONNECTION_OK);
    /* Seven so far. A proxy stands for many, loopback is the machine's own. */
    for (int i = 0; i < 11; i++)
        CHECK(enter(c, i % 2 ? "10.0.0.7" : "127.0.0.1") == CONNECTION_OK);
    CHECK(enter(c, "192.0.2.9") == CONNECTION_FULL && enter(c, "10.0.0.7") == CONNECTION_OK);
    CHECK(enter(c, "::1") == CONNECTION_OK && enter(c, "127.9.9.9") == CONNECTION_OK);
    leave(c, "::1"), leave(c, "127.9.9.9"), leave(c, "10.0.0.7"), leave(c, "127.0.0.1");
    CHECK(enter(c, "192.0.2.9") == CONNECTION_OK && enter(c, "192.0.2.10") == CONNECTION_FULL);
    connection_counts_free(c);

    c = connection_counts_new(1000, 0, NULL);
    for (int i = 0; i < 900; i++)
        CHECK(enter(c, "192.0.2.1") == CONNECTION_OK);
    for (int i = 0; i < 900; i++)
        leave(c, "192.0.2.1");
    leave(c, "192.0.2.1"); /* who was not counted */
    CHECK(enter(c, "192.0.2.1") == CONNECTION_OK);
    connection_counts_free(c);
    return check_result();
}
