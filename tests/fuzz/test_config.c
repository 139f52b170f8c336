/* test_config.c -- the daemon's configuration file, and the address to listen on. */
#include "server/config.h"

#include "tests/fuzz/fuzz.h"

static void check_address(const char *listen) {
    char address[CONFIG_ADDRESS_SIZE];
    uint16_t port;
    bool is_loopback;
    struct error err = {.message = ""};
    if (config_address(listen, address, &port, &is_loopback, &err) == STATUS_OK)
        MUST(address[0] != '\0' && memchr(address, '\0', sizeof address));
    else
        MUST(err.message[0] != '\0');
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    struct config c;
    struct buf problems;
    size_t count;
    const struct config_option *table = config_table(&count);
    char path[256];
    snprintf(path, sizeof path, "%s/unbaked.conf", fuzz_folder());
    fuzz_write(path, data, size);
    buf_init(&problems, (size_t)64 << 20);
    config_init(&c);
    config_read(&c, path, &problems, NULL);
    config_check(&c, &problems);
    for (size_t i = 0; i < count; i++) {
        const char *member = (const char *)&c + table[i].offset;
        if (table[i].type == CONFIG_INT)
            MUST((double)*(const int64_t *)(const void *)member >= table[i].minimum &&
                 (double)*(const int64_t *)(const void *)member <= table[i].maximum);
        else if (table[i].type == CONFIG_REAL)
            MUST(*(const double *)(const void *)member >= table[i].minimum &&
                 *(const double *)(const void *)member <= table[i].maximum);
    }
    check_address(c.listen);
    config_release(&c);
    buf_release(&problems);
    char *text = fuzz_text(data, size);
    check_address(text);
    free(text);
    return 0;
}

void fuzz_seeds(struct seeds *s) {
    s->mutants = 3000;
    seeds_path(s, "config/unbaked.conf", "");
    seeds_text(s, "[::1]:7117");
    seeds_text(s, "listen = 0.0.0.0:0\naccess = open # all\nmax_running = 2\r\nsandbox=no\nlow_disk_mib = 1e2\n");
}
