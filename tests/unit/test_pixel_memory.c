/* pixel_memory.h, photos.h: a job whose photographs do not fit their memory gives the same bytes as one whose do, says
 * what it takes of the disk, and says so where that has no room. */
#include "server/worker/pixel_memory.h"

#include <fcntl.h>

#include "common/sha256.h"
#include "server/ingest/bundle.h"
#include "tests/unit/tiny_scene.h"

#define MIB ((uint64_t)1 << 20)

static void check_budget(void) {
    struct order order = {.dir = dir, .photograph_memory_bytes = 100 * MIB, .memory_bytes = 50 * MIB};
    CHECK(pixel_memory_bytes(&order) == 100 * MIB);
    order.memory_step = 1; /* it ran out of memory */
    CHECK(pixel_memory_bytes(&order) == 50 * MIB);
    order = (struct order){.dir = dir, .memory_bytes = 512 * MIB};
    CHECK(pixel_memory_bytes(&order) == 256 * MIB);
    order.memory_step = 1;
    CHECK(pixel_memory_bytes(&order) == 128 * MIB);
    order.memory_step = 60;
    CHECK(pixel_memory_bytes(&order) == 64 * MIB);
    order.memory_bytes = 0;
    order.memory_step = 0;
    CHECK(pixel_memory_bytes(&order) >= 64 * MIB);
}

/* One line a file: its hash and its name. */
static void hash_outputs(const char *folder, struct buf *hashes) {
    char **names, hex[SHA256_HEX_SIZE];
    size_t count;
    OK(file_list(folder, &names, &count, &err));
    for (size_t i = 0; i < count; i++) {
        char *path = file_join(folder, names[i]);
        if (strcmp(names[i], "preview") == 0)
            hash_outputs(path, hashes);
        else if (strncmp(names[i], "report", 6) != 0) { /* has times in it */
            OK(sha256_of_file(path, hex, &err));
            buf_printf(hashes, "%s %s\n", hex, names[i]);
        }
        mem_free(path);
    }
    file_free_names(names, count);
}

/* From the beginning, with what it said in `said`. */
static enum status run(const struct order *with, struct buf *said, struct buf *hashes) {
    static const char *const former[] = {"checkpoint", "out"};
    char text[1 << 16], *path = file_join(dir, "said"), *out = file_join(dir, "out");
    for (size_t i = 0; i < sizeof former / sizeof *former; i++) {
        char *old = file_join(dir, former[i]);
        OK(file_remove_tree(old, &err));
        mem_free(old);
    }
    struct progress progress = {.fd = open(path, O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0600)};
    struct order order = *with;
    order.dir = dir;
    order.kind = "reconstruct";
    order.thread_count = 2;
    order.scene = scene;
    order.scene_id = "x";
    order.name = order.reduced = "";
    cJSON *settings = cJSON_Parse("{" TINY_SETTINGS "}");
    order.settings = settings;
    err = (struct error){0};
    enum status status = task_reconstruct(&order, &progress, &err);
    ssize_t length = pread(progress.fd, text, sizeof text - 1, 0);
    text[length > 0 ? length : 0] = '\0';
    buf_puts(said, text);
    if (status == STATUS_OK)
        hash_outputs(out, hashes);
    close(progress.fd);
    cJSON_Delete(settings);
    mem_free(out);
    mem_free(path);
    return status;
}

static void check_same(void) {
    struct buf said, fits, spilled;
    buf_init(&said, 1 << 20);
    buf_init(&fits, 1 << 20);
    buf_init(&spilled, 1 << 20);
    OK(run(&(struct order){0}, &said, &fits));
    CHECK(!strstr(buf_text(&said), "\"space\"") && !strstr(buf_text(&said), "photograph_memory_mib"));
    buf_clear(&said);
    OK(run(&(struct order){.photograph_memory_bytes = 1}, &said, &spilled));
    CHECK_THAT(strstr(buf_text(&said), "{\"type\":\"space\",\"bytes\":"), "%s", buf_text(&said));
    CHECK(strstr(buf_text(&said), "photograph_memory_mib") != NULL);
    CHECK(strchr(buf_text(&fits), '\n') != NULL);
    CHECK_STRING(buf_text(&spilled), buf_text(&fits));

    buf_clear(&said);
    struct order full = {.photograph_memory_bytes = 1, .keep_free_bytes = (uint64_t)1 << 52};
    CHECK(run(&full, &said, &spilled) == STATUS_NO_SPACE);
    CHECK_THAT(strstr(err.message, "the photographs do not fit the memory"), "%s", err.message);
    full = (struct order){.photograph_memory_bytes = 1, .disk_bytes = 1};
    CHECK(run(&full, &said, &spilled) == STATUS_NO_SPACE);
    CHECK_THAT(strstr(err.message, "what its owner may keep"), "%s", err.message);
    buf_release(&spilled);
    buf_release(&fits);
    buf_release(&said);
}

/* Photographs are decoded one at a time where there is no memory for two. */
static void check_gate(void) {
    struct scene loaded;
    struct bundle_limits limits = bundle_default_limits();
    struct parallel *pool = parallel_new(3);
    limits.decode_bytes = 1;
    OK(bundle_load(scene, NULL, &limits, pool, &loaded, NULL, &err));
    CHECK(loaded.photograph_count == 3);
    for (size_t i = 0; i < loaded.photograph_count; i++)
        CHECK(loaded.photograph[i].pixel && loaded.photograph[i].camera.width == 8);
    scene_release(&loaded);
    parallel_free(pool);
}

int main(void) {
    tiny_scene_make("pixels");
    check_budget();
    check_gate();
    check_same();
    tiny_scene_remove();
    return check_result();
}
