/* test_crowd.c -- how many connections an address may have, and who is not bound by that. */
#include "server/http/crowd.h"

#include "tests/check.h"

static struct address at(const char *text) {
    struct address a;
    CHECK_THAT(address_parse(text, strlen(text), &a), "%s", text);
    return a;
}

static enum crowd_answer enter(struct crowd *c, const char *text) {
    struct address a = at(text);
    return crowd_enter(c, &a);
}

static void leave(struct crowd *c, const char *text) {
    struct address a = at(text);
    crowd_leave(c, &a);
}

int main(void) {
    struct proxies proxies;
    struct error err;
    CHECK(proxies_parse(&proxies, "10.0.0.7", "X-Forwarded-For", &err) == STATUS_OK);
    struct crowd *c = crowd_new(20, 3, &proxies); /* two of which are kept for loopback */
    for (int i = 0; i < 3; i++)
        CHECK(enter(c, "192.0.2.1") == CROWD_OK);
    CHECK(enter(c, "192.0.2.1") == CROWD_ADDRESS_FULL);
    leave(c, "192.0.2.1");
    CHECK(enter(c, "192.0.2.1") == CROWD_OK);
    /* A /64 is one address. */
    CHECK(enter(c, "2001:db8::1") == CROWD_OK && enter(c, "2001:db8::2") == CROWD_OK && enter(c, "2001:db8::3") == CROWD_OK);
    CHECK(enter(c, "2001:db8::4") == CROWD_ADDRESS_FULL && enter(c, "2001:db8:0:1::4") == CROWD_OK);
    /* Seven so far. A proxy stands for many, loopback is the machine's own. */
    for (int i = 0; i < 11; i++)
        CHECK(enter(c, i % 2 ? "10.0.0.7" : "127.0.0.1") == CROWD_OK);
    CHECK(enter(c, "192.0.2.9") == CROWD_FULL && enter(c, "10.0.0.7") == CROWD_OK);
    CHECK(enter(c, "::1") == CROWD_OK && enter(c, "127.9.9.9") == CROWD_OK);
    leave(c, "::1"), leave(c, "127.9.9.9"), leave(c, "10.0.0.7"), leave(c, "127.0.0.1");
    CHECK(enter(c, "192.0.2.9") == CROWD_OK && enter(c, "192.0.2.10") == CROWD_FULL);
    crowd_free(c);

    c = crowd_new(1000, 0, NULL);
    for (int i = 0; i < 900; i++)
        CHECK(enter(c, "192.0.2.1") == CROWD_OK);
    for (int i = 0; i < 900; i++)
        leave(c, "192.0.2.1");
    leave(c, "192.0.2.1"); /* who was not counted */
    CHECK(enter(c, "192.0.2.1") == CROWD_OK);
    crowd_free(c);
    return check_result();
}
