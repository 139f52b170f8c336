/* base64.h: the vectors of RFC 4648, section 10, both ways; what is no base64. */
#include "common/base64.h"

#include <string.h>

#include "tests/check.h"

static void check_vectors(void) {
    static const struct {
        const char *text, *bytes;
    } vectors[] = {{"", ""},
                   {"Zg==", "f"},
                   {"Zm8=", "fo"},
                   {"Zm9v", "foo"},
                   {"Zm9vYg==", "foob"},
                   {"Zm9vYmE=", "fooba"},
                   {"Zm9vYmFy", "foobar"},
                   {"+/+/", "\xfb\xff\xbf"}};
    for (size_t i = 0; i < sizeof vectors / sizeof *vectors; i++) {
        char bytes[8];
        size_t used, length = strlen(vectors[i].bytes);
        CHECK(base64_decode(vectors[i].text, strlen(vectors[i].text), bytes, sizeof bytes, &used));
        CHECK_THAT(used == length && memcmp(bytes, vectors[i].bytes, used) == 0, "%s", vectors[i].text);
        struct buf text;
        buf_init(&text, 64);
        base64_append(&text, vectors[i].bytes, length);
        CHECK_THAT(strcmp(buf_text(&text), vectors[i].text) == 0, "%s: %s", vectors[i].text, buf_text(&text));
        buf_release(&text);
    }
}

static void check_broken(void) {
    static const char *const bad[] = {
        "Z", "Zg", "Zg=", "Zg===", "====", "Z===", "Zm9v!A==", "Zm=v", "Zm9vYmFyZm9v", "-_-_"};
    char bytes[8];
    size_t used;
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        CHECK_THAT(!base64_decode(bad[i], strlen(bad[i]), bytes, sizeof bytes, &used), "%s", bad[i]);
}

int main(void) {
    check_vectors();
    check_broken();
    return check_result();
}
