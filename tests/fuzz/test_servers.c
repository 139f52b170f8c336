/* test_servers.c -- the client's configuration of servers: whatever it holds, what is read has names that are found,
 * and URLs. */
#include "client/servers.h"

#include <sys/stat.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    struct servers s;
    struct error err;
    const struct server_entry *entry;
    const char *url;
    setenv("XDG_CONFIG_HOME", fuzz_folder(), 1);
    char *dir = file_join(fuzz_folder(), "unbake"), *path = file_join(dir, "config");
    mkdir(dir, 0700);
    umask(077);
    fuzz_write(path, data, size);
    if (servers_read(&s, &err) == STATUS_OK) {
        for (size_t i = 0; i < s.count; i++) {
            MUST(servers_find(&s, s.entry[i].name, &url, &entry, &err) == STATUS_OK);
            MUST(entry == &s.entry[i] && strcmp(url, s.entry[i].url) == 0 && *url);
        }
        if (servers_find(&s, NULL, &url, &entry, &err) != STATUS_OK)
            MUST(s.chosen && err.message[0]);
    } else {
        MUST(err.message[0]);
    }
    servers_release(&s);
    mem_free(path);
    mem_free(dir);
    return 0;
}

void fuzz_seeds(struct seeds *s) {
    s->mutants = 2000;
    seeds_text(s,
               "server = lab # mine\n\n[lab]\nurl = http://a\nca = ~/a.pem\ntoken_file = lab.token\n[b]\nurl=unix:/x");
    seeds_text(s, "[\n]\n[]\n=\n#\n[a] # x\r\nurl = \thttp://a \r\n");
}
