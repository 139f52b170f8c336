/* deliver.c -- see deliver.h. TLS is GnuTLS, which libmicrohttpd has brought along anyway. */
#include "server/worker/deliver.h"

#include <arpa/inet.h>
#include <errno.h>
#include <gnutls/crypto.h>
#include <gnutls/gnutls.h>
#include <netdb.h>
#include <stdio.h>
#include <string.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#include "common/base64.h"
#include "common/buf.h"
#include "common/clock.h"
#include "common/log.h"
#include "common/mem.h"
#include "common/protocol.h"
#include "common/url.h"
#include "server/worker/progress.h"
#include "server/worker/sandbox.h"
#include "server/worker/tasks.h"

#define PATIENCE_SEC 10 /* for each step; the daemon limits the whole */

static bool is_public_v4(uint32_t a) {
    static const struct {
        uint32_t network;
        int bits;
    } special[] = {
        {0x00000000, 8},  {0x0a000000, 8},  {0x64400000, 10}, {0x7f000000, 8},  {0xa9fe0000, 16},
        {0xac100000, 12}, {0xc0000000, 24}, {0xc0000200, 24}, {0xc0586300, 24}, {0xc0a80000, 16},
        {0xc6120000, 15}, {0xc6336400, 24}, {0xcb007100, 24}, {0xe0000000, 4},  {0xf0000000, 4},
    };
    for (size_t i = 0; i < sizeof special / sizeof *special; i++)
        if ((a ^ special[i].network) >> (32 - special[i].bits) == 0)
            return false;
    return true;
}

static bool is_public_v6(const uint8_t a[16]) {
    static const uint8_t mapped[12] = {[10] = 0xff, [11] = 0xff}, translated[12] = {0, 0x64, 0xff, 0x9b};
    uint32_t last = (uint32_t)a[12] << 24 | (uint32_t)a[13] << 16 | (uint32_t)a[14] << 8 | a[15];
    if (memcmp(a, mapped, 12) == 0 || memcmp(a, translated, 12) == 0)
        return is_public_v4(last);
    bool is_documentation = a[0] == 0x20 && a[1] == 0x01 && a[2] == 0x0d && a[3] == 0xb8;
    bool is_tunnel = (a[0] == 0x20 && a[1] == 0x02) || (a[0] == 0x20 && a[1] == 0x01 && a[2] == 0 && a[3] == 0);
    return a[0] >> 5 == 1 && !is_documentation && !is_tunnel; /* 2000::/3 is the allocated global unicast space */
}

bool deliver_is_public(const struct sockaddr *address) {
    if (address->sa_family == AF_INET)
        return is_public_v4(ntohl(((const struct sockaddr_in *)(const void *)address)->sin_addr.s_addr));
    if (address->sa_family == AF_INET6)
        return is_public_v6(((const struct sockaddr_in6 *)(const void *)address)->sin6_addr.s6_addr);
    return false;
}

/* The signing key of a secret; it lies in `key` or in the secret itself. */
static size_t key_of(const char *secret, unsigned char key[WEBHOOK_KEY_MAX], const void **bytes) {
    size_t prefix = strlen(WEBHOOK_SECRET_PREFIX), size;
    const char *base64 = secret + prefix;
    *bytes = key;
    if (strncmp(secret, WEBHOOK_SECRET_PREFIX, prefix) == 0 &&
        base64_decode(base64, strlen(base64), key, WEBHOOK_KEY_MAX, &size) && size >= WEBHOOK_KEY_MIN)
        return size;
    *bytes = secret;
    return strlen(secret);
}

void deliver_sign(const char *secret, const char *id, long long timestamp, const char *body, char signature[64]) {
    unsigned char mac[32];
    gnutls_datum_t raw = {.data = mac, .size = sizeof mac}, text = {0};
    unsigned char decoded[WEBHOOK_KEY_MAX];
    const void *key;
    size_t key_size = key_of(secret, decoded, &key);
    char *signed_text = mem_printf("%s.%lld.%s", id, timestamp, body);
    gnutls_hmac_fast(GNUTLS_MAC_SHA256, key, key_size, signed_text, strlen(signed_text), mac);
    gnutls_base64_encode2(&raw, &text);
    snprintf(signature, 64, "v1,%.*s", (int)text.size, (const char *)text.data);
    gnutls_free(text.data);
    mem_free(signed_text);
}

int deliver_status(const char *line) {
    bool is_http = strncmp(line, "HTTP/1.0 ", 9) == 0 || strncmp(line, "HTTP/1.1 ", 9) == 0;
    const char *code = line + 9;
    if (!is_http || strspn(code, "0123456789") != 3 || code[0] == '0' || !strchr(" \r\n", code[3]))
        return 0;
    return (code[0] - '0') * 100 + (code[1] - '0') * 10 + (code[2] - '0');
}

/* Connects to the first address of the host that accepts; -1 with the reason. */
static int call(const struct url *url, bool may_be_private, struct error *err) {
    struct addrinfo hints = {.ai_socktype = SOCK_STREAM, .ai_flags = AI_NUMERICSERV}, *found;
    struct timeval patience = {.tv_sec = PATIENCE_SEC};
    int failed = getaddrinfo(url->host, url->port, &hints, &found), fd = -1;
    if (failed) {
        error_set(err, STATUS_UNAVAILABLE, "%s: %s", url->host, gai_strerror(failed));
        return -1;
    }
    for (const struct addrinfo *at = found; at && fd < 0; at = at->ai_next) {
        if (!may_be_private && !deliver_is_public(at->ai_addr)) {
            error_set(err, STATUS_INPUT, "%s has an address of a private network", url->host);
            error_hint(err, "the option webhook_private lets such addresses be called");
            continue;
        }
        fd = socket(at->ai_family, SOCK_STREAM | SOCK_CLOEXEC, 0);
        if (fd < 0) {
            error_set_errno(err, errno, "cannot make a socket");
            continue;
        }
        setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience);
        setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
        if (connect(fd, at->ai_addr, at->ai_addrlen) != 0) {
            error_set_errno(err, errno == EINPROGRESS ? ETIMEDOUT : errno, "cannot reach %s port %s", url->host,
                            url->port);
            err->status = STATUS_UNAVAILABLE;
            close(fd);
            fd = -1;
        }
    }
    freeaddrinfo(found);
    return fd;
}

/* Reads a part of the reply; 0 or less at its end. With TLS 1.3 a record may hold only session tickets:
 * GNUTLS_E_AGAIN, which a timeout also gives. */
static ssize_t receive(int fd, gnutls_session_t tls, char *to, size_t length) {
    double until = clock_sec() + PATIENCE_SEC;
    ssize_t n;
    if (!tls)
        return recv(fd, to, length, 0);
    do
        n = gnutls_record_recv(tls, to, length);
    while (n < 0 && !gnutls_error_is_fatal((int)n) && clock_sec() < until);
    return n;
}

/* Sends the request and reads the status line of the reply, over a plain socket or TLS. */
static enum status talk(int fd, gnutls_session_t tls, const struct buf *request, int *code, struct error *err) {
    char line[64] = "";
    size_t sent = 0, got = 0;
    while (sent < request->length) {
        const char *at = request->data + sent;
        ssize_t n = tls ? gnutls_record_send(tls, at, request->length - sent)
                        : send(fd, at, request->length - sent, MSG_NOSIGNAL);
        if (n <= 0)
            return error_set(err, STATUS_UNAVAILABLE, "the connection broke while the message was sent");
        sent += (size_t)n;
    }
    while (got < sizeof line - 1 && !memchr(line, '\n', got)) {
        ssize_t n = receive(fd, tls, line + got, sizeof line - 1 - got);
        if (n <= 0)
            break;
        got += (size_t)n;
    }
    *code = deliver_status(line);
    if (*code == 0)
        return error_set(err, STATUS_UNAVAILABLE, "there was no reply");
    return STATUS_OK;
}

static enum status talk_tls(int fd, const char *host, const struct buf *request, int *code, struct error *err) {
    gnutls_session_t session = NULL;
    gnutls_certificate_credentials_t trust = NULL;
    unsigned char address[16];
    bool is_address = inet_pton(AF_INET, host, address) == 1 || inet_pton(AF_INET6, host, address) == 1;
    enum status status = STATUS_OK;
    int failed = gnutls_certificate_allocate_credentials(&trust);
    if (failed >= 0)
        failed = gnutls_certificate_set_x509_system_trust(trust);
    if (failed >= 0)
        failed = gnutls_init(&session, GNUTLS_CLIENT);
    if (failed >= 0)
        failed = gnutls_set_default_priority(session);
    if (failed >= 0)
        failed = gnutls_credentials_set(session, GNUTLS_CRD_CERTIFICATE, trust);
    if (failed >= 0 && !is_address)
        failed = gnutls_server_name_set(session, GNUTLS_NAME_DNS, host, strlen(host));
    if (failed >= 0) {
        gnutls_session_set_verify_cert(session, host, 0);
        gnutls_transport_set_int(session, fd);
        gnutls_handshake_set_timeout(session, PATIENCE_SEC * 1000);
        do
            failed = gnutls_handshake(session);
        while (failed < 0 && !gnutls_error_is_fatal(failed));
    }
    status = failed < 0 ? error_set(err, STATUS_UNAVAILABLE, "TLS with %s: %s", host, gnutls_strerror(failed))
                        : talk(fd, session, request, code, err);
    if (session)
        gnutls_deinit(session);
    if (trust)
        gnutls_certificate_free_credentials(trust);
    return status;
}

enum status task_deliver(const struct order *order, struct progress *progress, struct error *err) {
    struct url url;
    struct buf request;
    char signature[64];
    long long now = (long long)time(NULL);
    int code = 0;
    enum status status = url_parse(order->url, &url, err);
    if (status != STATUS_OK)
        return status;
    deliver_sign(order->secret, order->message_id, now, order->body, signature);
    bool is_v6 = strchr(url.host, ':') != NULL;
    buf_init(&request, 1 << 20);
    buf_printf(&request,
               "POST %s%s HTTP/1.1\r\nHost: %s%s%s:%s\r\nUser-Agent: unbaked/" UNBAKE_VERSION "\r\n"
               "Connection: close\r\nContent-Type: " MIME_JSON "\r\nContent-Length: %zu\r\n"
               "webhook-id: %s\r\nwebhook-timestamp: %lld\r\nwebhook-signature: %s\r\n\r\n%s",
               *url.target == '/' ? "" : "/", url.target, is_v6 ? "[" : "", url.host, is_v6 ? "]" : "", url.port,
               strlen(order->body), order->message_id, now, signature, order->body);
    int fd = call(&url, order->allow_private, err);
    if (fd >= 0 && order->sandbox && !sandbox_keep_connection())
        log_warning("sandbox: this system cannot keep the process to its connection (seccomp)");
    if (fd < 0)
        status = err->status;
    else
        status = url.is_tls ? talk_tls(fd, url.host, &request, &code, err) : talk(fd, NULL, &request, &code, err);
    if (code > 0)
        progress_metric(progress, "status", 0, code); /* for the daemon, which does not talk to the receiver itself */
    if (status == STATUS_OK && (code < 200 || code > 299))
        status = error_set(err, STATUS_UNAVAILABLE, "%s answered %d", url.host, code);
    if (fd >= 0)
        close(fd);
    buf_release(&request);
    return status;
}
