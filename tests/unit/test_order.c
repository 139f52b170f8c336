/* test_order.c -- what the daemon orders of a worker: each member that is wrong is a defect of ours, and is named. */
#include "server/worker/order.h"

#include "common/file.h"
#include "common/mem.h"
#include "tests/check.h"

static struct error err;
static char dir[] = "/tmp/unbake-test-order-XXXXXX";

static enum status read_text(const char *text, struct order *order) {
    char *path = file_join(dir, "job.json");
    CHECK(file_replace(path, text, strlen(text), &err) == STATUS_OK);
    mem_free(path);
    err = (struct error){0};
    return order_read(order, dir, &err);
}

#define COMMON "\"scene_id\":\"x\",\"thread_count\":2,\"memory_bytes\":1000,\"sandbox\":false"
#define RECONSTRUCT                                                                                                      \
    "\"kind\":\"reconstruct\",\"scene\":\"/s\",\"name\":\"n\",\"job_id\":7,\"attempt\":3,\"checkpoint_interval_sec\":5," \
    "\"settings\":{}"
#define DELIVER                                                                                                        \
    "\"kind\":\"deliver\",\"url\":\"http://x/\",\"secret\":\"s\",\"body\":\"b\",\"message_id\":\"m\",\"allow_private\":true"

static void check_good(void) {
    struct order o;
    CHECK(read_text("{" RECONSTRUCT "," COMMON "}", &o) == STATUS_OK);
    CHECK(o.thread_count == 2 && o.memory_bytes == 1000 && !o.sandbox && o.job_id == 7 && o.attempt == 3);
    CHECK(o.checkpoint_interval_sec == 5 && cJSON_IsObject(o.settings) && !*o.reduced);
    CHECK_STRING(o.scene, "/s");
    order_release(&o);
    CHECK(read_text("{" DELIVER "," COMMON "}", &o) == STATUS_OK);
    CHECK(o.allow_private && strcmp(o.message_id, "m") == 0 && strcmp(o.body, "b") == 0);
    order_release(&o);
    CHECK(read_text("{\"kind\":\"check\"}", &o) == STATUS_OK);
    CHECK(o.thread_count == 1 && o.memory_bytes == 0 && o.sandbox);
    order_release(&o);
}

/* The order with that member set so. */
static void check_bad(const char *member, const char *value, const char *rest) {
    struct order o;
    cJSON *json = cJSON_Parse(rest);
    cJSON_DeleteItemFromObjectCaseSensitive(json, member);
    cJSON_AddRawToObject(json, member, value);
    char *text = json_text(json);
    CHECK_THAT(read_text(text, &o) == STATUS_INTERNAL && err.status == STATUS_INTERNAL, "%s", text);
    CHECK_THAT(strstr(err.message, "job.json: ") && strstr(err.message, member), "%s: %s", text, err.message);
    order_release(&o);
    cJSON_Delete(json);
    mem_free(text);
}

int main(void) {
    struct order o;
    if (!mkdtemp(dir))
        return 1;
    check_good();
    static const char *const texts[] = {"kind", "scene_id", "scene", "name", "reduced"};
    static const char *const numbers[] = {"thread_count", "memory_bytes", "job_id", "attempt",
                                          "checkpoint_interval_sec"};
    static const char *const message[] = {"url", "secret", "body", "message_id", "allow_private"};
    for (size_t i = 0; i < 5; i++) {
        check_bad(texts[i], "7", "{" RECONSTRUCT "," COMMON "}");
        check_bad(numbers[i], "\"7\"", "{" RECONSTRUCT "," COMMON "}");
        check_bad(message[i], "7", "{" DELIVER "," COMMON "}");
    }
    for (size_t i = 0; i < 4; i++) {
        check_bad(numbers[i], "-1", "{" RECONSTRUCT "," COMMON "}");
        check_bad(numbers[i], "1.5", "{" RECONSTRUCT "," COMMON "}");
        check_bad(numbers[i], "1e300", "{" RECONSTRUCT "," COMMON "}");
    }
    check_bad("sandbox", "\"no\"", "{" RECONSTRUCT "," COMMON "}");
    check_bad("settings", "[]", "{" RECONSTRUCT "," COMMON "}");
    check_bad("scene", "\"\"", "{" RECONSTRUCT "," COMMON "}");
    CHECK(read_text("{", &o) == STATUS_INTERNAL);
    order_release(&o);
    CHECK(file_remove_tree(dir, &err) == STATUS_OK);
    CHECK(order_read(&o, dir, &err) == STATUS_NOT_FOUND);
    order_release(&o);
    return check_result();
}
