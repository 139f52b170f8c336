/* test_admin.c -- what comes by the admin socket, and the names of users in it. */
#include "server/admin/admin_request.h"

#include <unistd.h>

#include "common/log.h"
#include "common/mem.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static struct store *store;
    cJSON *request = NULL;
    struct error err = {.message = ""};
    int fd = -1;
    log_set_level(LOG_ERROR);
    if (!store)
        MUST(store_open(&store, fuzz_folder(), NULL) == STATUS_OK);
    if (json_parse((const char *)data, size, "the request", &request, NULL) != STATUS_OK)
        return 0;
    cJSON *reply = cJSON_CreateObject();
    enum status status = admin_request_do(fuzz_folder(), store, request, reply, &fd, &err);
    MUST(status != STATUS_INTERNAL && status != STATUS_CORRUPT && status != STATUS_IO);
    MUST(status == STATUS_OK || err.message[0] != '\0');
    if (fd >= 0)
        close(fd);
    cJSON_Delete(reply);
    cJSON_Delete(request);
    return 0;
}

void fuzz_seeds(struct seeds *s) {
    s->mutants = 1000;
    seeds_text(s, "{\"command\":\"token-add\",\"name\":\"ada@lab.org\",\"role\":\"viewer\"}");
    seeds_text(s, "{\"command\":\"token-revoke\",\"which\":\"ada@lab.org\"}");
    seeds_text(s, "{\"command\":\"token-revoke\",\"which\":\"1\"}");
    seeds_text(s, "{\"command\":\"token-list\"}");
    seeds_text(s, "{\"command\":\"backup\"}");
}
