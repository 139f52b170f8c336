/* test_formats_failures.c -- an export whose files cannot be written, or hold too much. */
#include <signal.h>
#include <sys/resource.h>

#include "server/export/sink.h"
#include "tests/unit/formats_rig.h"

static bool is_there(const char *dir, const char *name) {
    char *path = file_join(dir, name);
    bool there = access(path, F_OK) == 0;
    mem_free(path);
    return there;
}

/* What cannot be written whole leaves nothing, neither under its name nor under another. */
static void test_failures(const char *dir, const struct export_input *in, const struct parts *parts) {
    struct error err;
    struct sink out;
    struct rlimit limit, small = {4096, 4096};
    char *path = file_join(dir, "short"), *part = file_join(dir, "short.part");
    CHECK(sink_open(&out, path, 10, &err) == STATUS_OK);
    sink_u64(&out, 1);
    sink_u32(&out, 1);
    CHECK(sink_close(&out, STATUS_OK, &err) == STATUS_LIMIT && strstr(err.message, "10 bytes"));
    CHECK(sink_open(&out, path, 0, &err) == STATUS_OK);
    sink_copy(&out, "/dev/null", 1);
    CHECK(sink_close(&out, STATUS_OK, &err) == STATUS_IO);
    CHECK(sink_open(&out, path, 0, &err) == STATUS_OK);
    error_set(&err, STATUS_CANCELLED, "before");
    CHECK(sink_close(&out, STATUS_CANCELLED, &err) == STATUS_CANCELLED && strcmp(err.message, "before") == 0);
    CHECK(access(path, F_OK) != 0 && access(part, F_OK) != 0);
    mem_free(part);
    mem_free(path);

    CHECK(getrlimit(RLIMIT_FSIZE, &limit) == 0);
    small.rlim_max = limit.rlim_max;
    signal(SIGXFSZ, SIG_IGN);
    CHECK(setrlimit(RLIMIT_FSIZE, &small) == 0);
    for (size_t f = 0; f < FORMATS_COUNT; f++) {
        char *name = mem_printf("%s.part", formats[f].name);
        path = file_join(dir, formats[f].name);
        unlink(path);
        bool fits = strcmp(formats[f].name, "scene.mtl") == 0;
        CHECK_THAT((formats[f].write(dir, in, parts, &err) == STATUS_OK) == fits, "%s", formats[f].name);
        CHECK(is_there(dir, formats[f].name) == fits && !is_there(dir, name));
        mem_free(path);
        mem_free(name);
    }
    CHECK(setrlimit(RLIMIT_FSIZE, &limit) == 0);
}

/* A mesh of more segments than a file of objects may have. */
static void test_limit(void) {
    enum { COUNT = PARTS_MAX + 1 };
    struct error err = {0};
    struct parts parts;
    struct mesh mesh = {.triangle_count = COUNT};
    struct segments segments = {.count = COUNT};
    segments.of_triangle = mem_array(COUNT, sizeof *segments.of_triangle);
    for (uint32_t t = 0; t < COUNT; t++)
        segments.of_triangle[t] = t;
    CHECK(parts_make(&parts, &mesh, &segments, NULL, &err) == STATUS_LIMIT);
    CHECK(strstr(err.message, "16385") && strstr(err.message, "16384"));
    mem_free(segments.of_triangle);
}

int main(void) {
    struct formats_rig r;
    formats_rig_open(&r);
    test_failures(r.dir, &r.in, &r.parts);
    test_limit();
    formats_rig_close(&r);
    return check_result();
}
