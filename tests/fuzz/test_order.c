/* test_order.c -- job.json, as a worker reads it. */
#include <sys/stat.h>

#include "common/file.h"
#include "common/mem.h"
#include "server/worker/order.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    struct order order;
    struct error err = {.message = ""};
    char *path = file_join(fuzz_folder(), "job.json");
    fuzz_write(path, data, size);
    if (order_read(&order, fuzz_folder(), &err) == STATUS_OK) {
        MUST(order.kind && order.scene_id);
        if (strcmp(order.kind, "reconstruct") == 0)
            MUST(order.scene[0] && order.name && cJSON_IsObject(order.settings));
        if (strcmp(order.kind, "deliver") == 0)
            MUST(order.url && order.secret && order.body && order.message_id);
    } else {
        MUST(err.status == STATUS_INTERNAL && err.message[0] != '\0');
    }
    order_release(&order);
    mem_free(path);
    return 0;
}

void fuzz_seeds(struct seeds *s) {
    s->mutants = 3000;
    seeds_text(
        s, "{\"kind\":\"reconstruct\",\"scene\":\"/x\",\"scene_id\":\"00\",\"settings\":{\"seed\":7},\"name\":\"n\","
           "\"job_id\":17,\"attempt\":2,\"thread_count\":4,\"memory_bytes\":1e9,\"sandbox\":true,"
           "\"checkpoint_interval_sec\":60,\"reduced\":\"texture_size\"}");
    seeds_text(s, "{\"kind\":\"check\",\"scene_id\":\"00\",\"thread_count\":4,\"memory_bytes\":0,\"sandbox\":false}");
    seeds_text(s,
               "{\"kind\":\"deliver\",\"url\":\"https://a/\",\"secret\":\"s\",\"body\":\"{}\",\"message_id\":\"msg_7\","
               "\"allow_private\":false,\"sandbox\":true}");
}
