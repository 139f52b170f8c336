/* test_picture_record.c -- which pictures are done by what attempts have recorded, and records that become one. */
#include "server/data/picture_record.h"

#include <string.h>
#include <unistd.h>

#include "common/buf.h"
#include "common/file.h"
#include "common/mem.h"
#include "common/output_names.h"
#include "tests/check.h"

#define DIGEST "aa"
#define LINE(picture, digest, name, bytes)                                                                             \
    "{\"picture\":" picture ",\"digest\":\"" digest "\",\"files\":[{\"name\":\"" name "\",\"bytes\":" bytes "}]}\n"

static struct error err;
static char *dir;

#define OK(call) CHECK_THAT((call) == STATUS_OK, "%s", err.message)

static char *path_of(int attempt, const char *name) {
    return mem_printf("%s/jobs/7/attempt-%d/out/%s", dir, attempt, name);
}

static void put(int attempt, const char *name, const char *text) {
    char *path = path_of(attempt, name), *folder = mem_strndup(path, (size_t)(strrchr(path, '/') - path));
    OK(file_make_dirs(folder, &err));
    OK(file_replace(path, text, strlen(text), &err));
    mem_free(folder);
    mem_free(path);
}

static int64_t done(int64_t first, int64_t count) {
    static const int attempts[] = {1, 2, 3}; /* the third has recorded nothing */
    int64_t number = -1;
    OK(picture_record_done(dir, 7, attempts, 3, DIGEST, first, count, &number, &err));
    return number;
}

static void check_done(void) {
    put(1, OUTPUT_RECORD,
        LINE("10", DIGEST, "10.png", "3") LINE("12", DIGEST, "12.png", "3") LINE("13", "bb", "13.png", "3"));
    put(2, OUTPUT_RECORD,
        LINE("11", DIGEST, "11.png", "3") "nonsense\n" LINE("14", DIGEST, "../../x", "3")
            LINE("-1e300", DIGEST, "10.png", "3") "{\"picture\":15,\"digest\":\"" DIGEST "\"}\n"
                                                  "{\"picture\":16,\"digest\":\"" DIGEST "\",\"fi");
    put(1, "10.png", "abc");
    put(1, "12.png", "abc");
    put(1, "13.png", "abc");
    CHECK(done(10, 5) == 1); /* the file of 11 is not there */
    put(1, "11.png", "abc");
    CHECK(done(10, 5) == 1); /* nor where it was recorded */
    put(2, "11.png", "ab");
    CHECK(done(10, 5) == 1); /* nor of its size */
    put(2, "11.png", "abc");
    CHECK(done(10, 5) == 3); /* 13 is of another render */
    CHECK(done(10, 2) == 2 && done(12, 1) == 1 && done(13, 9) == 0 && done(14, 1) == 0 && done(15, 2) == 0);
}

static void check_move(void) {
    char *one = path_of(1, OUTPUT_RECORD), *two = path_of(2, OUTPUT_RECORD), *to = path_of(3, OUTPUT_RECORD);
    struct buf text;
    put(3, "other", "");
    OK(picture_record_move(one, to, &err));
    OK(picture_record_move(one, to, &err)); /* it has gone */
    OK(picture_record_move(two, to, &err));
    CHECK(access(one, F_OK) != 0 && access(two, F_OK) != 0);
    put(1, OUTPUT_RECORD, LINE("1", DIGEST, "1.png", "1"));
    OK(picture_record_move(one, to, &err));
    buf_init(&text, 100000);
    OK(file_read(to, &text, &err));
    CHECK(strstr(buf_text(&text), "{\"picture\":10,") == buf_text(&text));
    CHECK(strstr(buf_text(&text), "\"fi\n{\"picture\":1,")); /* a line that was cut off does not swallow the next */
    buf_release(&text);
    mem_free(to);
    mem_free(two);
    mem_free(one);
}

int main(void) {
    dir = mem_printf("%s/unbake-test-record-XXXXXX", check_fast_dir());
    if (!mkdtemp(dir))
        return 1;
    check_done();
    check_move();
    OK(file_remove_tree(dir, &err));
    mem_free(dir);
    return check_result();
}
