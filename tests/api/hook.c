/* hook -- what webhooks call, for shell tests: prints its port, then one line of JSON a message:
 * {"path", "id", "timestamp", "signature", "good", "body"}, where `good` says whether the signature
 * is that of the secret in argv[1]. Answers with the statuses in argv[2], argv[3], ...; 200 after. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "server/worker/deliver.h"
#include "tests/chaos/daemon.h"

static void field(const char *text, const char *name, char value[128]) {
    const char *at = strcasestr(text, name);
    value[0] = '\0';
    if (at)
        sscanf(at + strlen(name), ": %127[^\r\n]", value);
}

int main(int argc, char **argv) {
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof at;
    int listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (argc < 2 || bind(listener, (struct sockaddr *)&at, size) != 0 || listen(listener, 16) != 0 ||
        getsockname(listener, (struct sockaddr *)&at, &size) != 0)
        return 1;
    printf("%d\n", ntohs(at.sin_port));
    fflush(stdout);
    for (int count = 0;; count++) {
        char text[16384] = "", path[128] = "", id[128], stamp[128], given[128], wanted[64];
        size_t length = 0;
        int fd = accept(listener, NULL, NULL);
        for (;;) {
            char *gap = strstr(text, "\r\n\r\n"), announced[128];
            field(text, "Content-Length", announced);
            if (gap && length >= (size_t)(gap + 4 - text) + strtoul(announced, NULL, 10))
                break;
            ssize_t got = recv(fd, text + length, sizeof text - 1 - length, 0);
            if (got <= 0)
                break;
            length += (size_t)got;
            text[length] = '\0';
        }
        const char *gap = strstr(text, "\r\n\r\n");
        sscanf(text, "POST %127s", path);
        field(text, "Webhook-Id", id);
        field(text, "Webhook-Timestamp", stamp);
        field(text, "Webhook-Signature", given);
        deliver_sign(argv[1], id, strtoll(stamp, NULL, 10), gap ? gap + 4 : "", wanted);
        printf("{\"path\":\"%s\",\"id\":\"%s\",\"timestamp\":%s,\"signature\":\"%s\",\"good\":%s,\"body\":%s}\n", path,
               id, stamp[0] ? stamp : "0", given, strcmp(given, wanted) == 0 ? "true" : "false",
               gap ? gap + 4 : "null");
        fflush(stdout);
        char reply[128];
        snprintf(reply, sizeof reply, "HTTP/1.1 %s Here\r\nLocation: http://127.0.0.1:1/\r\nContent-Length: 0\r\n\r\n",
                 count + 2 < argc ? argv[count + 2] : "200");
        http_send(fd, reply, strlen(reply));
        close(fd);
    }
}
