/* test_url.c -- the URL of a webhook, and whether the address in it is a public one. */
#include "common/url.h"

#include <arpa/inet.h>
#include <netinet/in.h>

#include "server/worker/deliver.h"
#include "tests/fuzz/fuzz.h"

static void look_at_address(const struct url *url) {
    struct sockaddr_in v4 = {.sin_family = AF_INET};
    struct sockaddr_in6 v6 = {.sin6_family = AF_INET6};
    if (inet_pton(AF_INET, url->host, &v4.sin_addr) == 1) {
        uint32_t number = ntohl(v4.sin_addr.s_addr);
        bool is_public = deliver_is_public((const struct sockaddr *)&v4);
        MUST(!is_public || (number >> 24 != 127 && number >> 24 != 10 && number >> 16 != 0xc0a8));
        v6.sin6_addr = (struct in6_addr){.s6_addr = {[10] = 0xff, [11] = 0xff}};
        memcpy(v6.sin6_addr.s6_addr + 12, &v4.sin_addr, 4);
        MUST(deliver_is_public((const struct sockaddr *)&v6) == is_public);
    } else if (inet_pton(AF_INET6, url->host, &v6.sin6_addr) == 1) {
        bool is_public = deliver_is_public((const struct sockaddr *)&v6);
        MUST(!is_public || !(IN6_IS_ADDR_LOOPBACK(&v6.sin6_addr) || IN6_IS_ADDR_LINKLOCAL(&v6.sin6_addr) ||
                             IN6_IS_ADDR_MULTICAST(&v6.sin6_addr)));
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    struct url url;
    struct error err = {.message = ""};
    char *text = fuzz_text(data, size);
    if (url_parse(text, &url, &err) == STATUS_OK) {
        MUST(strlen(text) <= URL_MAX_BYTES);
        MUST(url.host[0] != '\0' && memchr(url.host, '\0', sizeof url.host));
        MUST(strtol(url.port, NULL, 10) >= 1 && strtol(url.port, NULL, 10) <= 65535);
        MUST(url.target >= text && url.target <= text + strlen(text));
        for (const char *at = text; *at; at++) /* it becomes part of a request's head */
            MUST((unsigned char)*at > 0x20 && (unsigned char)*at < 0x7f);
        look_at_address(&url);
    } else {
        MUST(err.status == STATUS_INPUT && err.message[0] != '\0');
    }
    free(text);
    return 0;
}

void fuzz_seeds(struct seeds *s) {
    static const char *const texts[] = {
        "https://lab.example.org/hook?a=b", "http://127.0.0.1:8080", "http://[::ffff:10.0.0.1]:80/x", "https://a",
        "http://user:pass@host/",           "https://host/#f",       "http://192.168.1.1:99999/"};
    s->mutants = 20000;
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++)
        seeds_text(s, texts[i]);
}
