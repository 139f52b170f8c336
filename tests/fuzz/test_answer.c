/* test_answer.c -- the first line of what a webhook's receiver answers: its status, or none. */
#include "server/worker/deliver.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    char *text = fuzz_text(data, size), wanted[16];
    int status = deliver_status(text);
    MUST(status == 0 || (status >= 100 && status <= 999));
    if (status != 0) {
        snprintf(wanted, sizeof wanted, "HTTP/1.%c %d", text[7] == '0' ? '0' : '1', status);
        MUST(strncmp(text, wanted, strlen(wanted)) == 0);
        MUST(text[12] == '\0' || text[12] == ' ' || text[12] == '\r' || text[12] == '\n');
    }
    free(text);
    return 0;
}

void fuzz_seeds(struct seeds *s) {
    static const char *const texts[] = {"HTTP/1.1 200 OK\r\n", "HTTP/1.0 404 Not Found\n",
                                        "HTTP/1.1 204\r\n",    "HTTP/1.1 500",
                                        "HTTP/1.1 -20 OK\r\n", "HTTP/1.1 2000 OK\r\n",
                                        "HTTP/1.1 20",         "HTTP/1.2 200 OK\r\n",
                                        "HTTP/2 200\r\n",      "HTTP/1.1  200 OK\r\n",
                                        "HTTP/1.1 099 X\r\n",  "ICY 200 OK\r\n",
                                        "HTTP/1.1 200OK\r\n",  ""};
    s->mutants = 20000;
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++)
        seeds_text(s, texts[i]);
}
