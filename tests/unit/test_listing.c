/* test_listing.c -- a folder that the disk lets us list in part only is an error wherever one is listed,
 * never a folder with fewer files in it. */
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <sys/stat.h>

#include "client/pack.h"
#include "common/file.h"
#include "common/mem.h"
#include "server/ingest/bundle.h"
#include "server/ingest/listing.h"
#include "tests/check.h"

static char dir[] = "/tmp/unbake-test-listing-XXXXXX";
static long left; /* entries that can still be read; negative: all */
static bool has_failed;

/* libc's, until the disk fails. */
struct dirent *readdir(DIR *folder) {
    static struct dirent *(*next)(DIR *);
    if (!next)
        *(void **)&next = dlsym(RTLD_NEXT, "readdir");
    if (left == 0) {
        errno = EIO;
        has_failed = true;
        return NULL;
    }
    left -= left > 0;
    return next(folder);
}

static void put(const char *name, const char *text) {
    char *path = file_join(dir, name);
    CHECK(file_replace(path, text, strlen(text), NULL) == STATUS_OK);
    mem_free(path);
}

static enum status list_bundle(struct error *err) {
    struct bundle_limits limits = bundle_default_limits();
    struct scene scene;
    cJSON *problems = cJSON_CreateArray();
    struct parallel *pool = parallel_new(1);
    enum status status = bundle_load(dir, NULL, &limits, pool, &scene, problems, err);
    CHECK_THAT(status == STATUS_INPUT || cJSON_GetArraySize(problems) == 0, "a problem is told");
    scene_release(&scene);
    parallel_free(pool);
    cJSON_Delete(problems);
    return status;
}

static enum status list_files(struct error *err) {
    struct listing l;
    enum status status = listing_read(&l, dir, err);
    CHECK(status != STATUS_OK || (l.count == 4 && l.folder_count == 3));
    listing_release(&l);
    return status;
}

static enum status list_upload(struct error *err) {
    struct pack *pack;
    enum status status = pack_open(&pack, dir, err);
    if (status == STATUS_OK)
        pack_close(pack);
    return status;
}

static enum status size_of_all(struct error *err) {
    uint64_t files, bytes;
    return file_tree_size(dir, &files, &bytes, err);
}

static enum status remove_all(struct error *err) { return file_remove_tree(dir, err); }

/* After each number of entries, until it needs no more. */
static void check_fails(const char *name, enum status (*list)(struct error *), enum status in_peace) {
    struct error err = {.message = ""};
    for (long n = 0; n < 100; n++) {
        left = n;
        has_failed = false;
        enum status status = list(&err);
        left = -1;
        CHECK_THAT(status == (has_failed ? STATUS_IO : in_peace), "%s, after %ld entries: %s: %s", name, n,
                   status_name(status), err.message);
        if (!has_failed)
            return;
    }
    CHECK_THAT(false, "%s lists for ever", name);
}

static void make_folder(const char *name) {
    char *path = file_join(dir, name);
    CHECK(mkdir(path, 0700) == 0);
    mem_free(path);
}

int main(void) {
    left = -1;
    if (!mkdtemp(dir))
        return 1;
    make_folder("pose");
    make_folder("intrinsic");
    put("pose/1.txt", "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1");
    put("pose/2.txt", "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1");
    put("intrinsic/intrinsic_color.txt", "7 0 4 0\n0 7 3 0\n0 0 1 0\n0 0 0 1\n");
    put("mesh.ply", "ply\n");
    check_fails("a scene", list_bundle, STATUS_INPUT);
    check_fails("its files", list_files, STATUS_OK);
    check_fails("an upload", list_upload, STATUS_OK);
    check_fails("the size", size_of_all, STATUS_OK);
    check_fails("removal", remove_all, STATUS_OK);
    return check_result();
}
