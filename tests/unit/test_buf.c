/* buf.h: the cap holds, the text is always terminated. */
#include "common/buf.h"

#include "common/mem.h"
#include "tests/check.h"

int main(void) {
    struct buf b;
    buf_init(&b, 10);
    CHECK_STRING(buf_text(&b), "");
    CHECK(buf_puts(&b, "hello"));
    CHECK(buf_printf(&b, "%d", 12345));
    CHECK_STRING(buf_text(&b), "hello12345");
    CHECK(!buf_puts(&b, "x") && b.overflowed);
    CHECK_STRING(buf_text(&b), "hello12345");
    buf_consume(&b, 5);
    CHECK_STRING(buf_text(&b), "12345");
    char *text = buf_detach(&b);
    CHECK_STRING(text, "12345");
    mem_free(text);
    CHECK(b.length == 0 && b.limit == 10);
    buf_release(&b);
    return check_result();
}
