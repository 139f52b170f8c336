/* test_boot.c -- the kernel's boot id, as a file and as systemd writes it. */
#include "common/boot.h"

#include "common/buf.h"
#include "common/file.h"
#include "tests/check.h"

static void is(const char *text, const char *wanted) {
    char id[BOOT_ID_SIZE];
    boot_id_normalise(text, id);
    CHECK_STRING(id, wanted);
}

int main(void) {
    static const char id[] = "0a1b2c3d-4e5f-6071-8293-a4b5c6d7e8f9";
    is("0a1b2c3d-4e5f-6071-8293-a4b5c6d7e8f9\n", id);
    is("0a1b2c3d4e5f60718293a4b5c6d7e8f9", id); /* %b of a systemd unit */
    is("0A1B2C3D4E5F60718293A4B5C6D7E8F9", id);
    is("", "");
    is("\n", "");
    is("%b", ""); /* where nobody replaced it */
    is("0a1b2c3d4e5f60718293a4b5c6d7e8f", "");
    is("0a1b2c3d4e5f60718293a4b5c6d7e8f90", "");
    is("0a1b2c3d4e5f60718293a4b5c6d7e8fx", "");

    char own[BOOT_ID_SIZE];
    struct buf text;
    buf_init(&text, 256);
    setenv("UNBAKED_BOOT_ID", "0a1b2c3d4e5f60718293a4b5c6d7e8f9", 1);
    boot_id(own);
    if (file_read("/proc/sys/kernel/random/boot_id", &text, NULL) == STATUS_OK)
        CHECK(strncmp(own, buf_text(&text), 36) == 0); /* the kernel knows best */
    else
        CHECK_STRING(own, id);
    buf_release(&text);
    return check_result();
}
