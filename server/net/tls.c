/* tls.c -- see tls.h. */
#include "server/net/tls.h"

#include <gnutls/abstract.h>
#include <gnutls/gnutls.h>
#include <gnutls/x509.h>
#include <stdatomic.h>
#include <time.h>

#include "common/file.h"
#include "common/mem.h"

#define CHAIN_MAX 16                     /* certificates */
#define FILE_MAX_BYTES ((size_t)1 << 20) /* of a PEM file */

/* A certificate and key as read once. Handshakes may still use an older pair, so all are kept until the end; each
 * SIGHUP adds one. */
struct pair {
    gnutls_pcert_st chain[CHAIN_MAX];
    unsigned count;
    gnutls_privkey_t key;
    struct pair *older;
};

struct tls {
    char *certificate_file, *key_file; /* owned */
    _Atomic(struct pair *) newest;
};

static _Atomic(struct tls *) current; /* libmicrohttpd's callback has no user pointer */

static enum status failed(int code, const char *file, struct error *err) {
    return error_set(err, STATUS_INPUT, "%s: %s", file, gnutls_strerror(code));
}

static enum status read_file(const char *path, gnutls_datum_t *datum, struct buf *text, struct error *err) {
    buf_init(text, FILE_MAX_BYTES);
    enum status status = file_read(path, text, err);
    *datum = (gnutls_datum_t){.data = (unsigned char *)text->data, .size = (unsigned)text->length};
    if (status == STATUS_OK && text->length == 0)
        status = error_set(err, STATUS_INPUT, "%s is empty", path);
    return status;
}

/* GnuTLS checks that key and certificate belong together only when it makes credentials of them. */
static enum status check_match(const struct tls *tls, const gnutls_datum_t *chain, const gnutls_datum_t *key,
                               struct error *err) {
    gnutls_certificate_credentials_t credentials;
    int code = gnutls_certificate_allocate_credentials(&credentials);
    if (code != 0)
        return failed(code, tls->certificate_file, err);
    code = gnutls_certificate_set_x509_key_mem(credentials, chain, key, GNUTLS_X509_FMT_PEM);
    gnutls_certificate_free_credentials(credentials);
    if (code >= 0)
        return STATUS_OK;
    error_set(err, STATUS_INPUT, "%s and %s: %s", tls->certificate_file, tls->key_file, gnutls_strerror(code));
    return error_hint(err,
                      "both are PEM: a certificate, then its chain; and the private key that belongs to it, without "
                      "a passphrase");
}

static void free_pair(struct pair *pair) {
    for (unsigned i = 0; i < pair->count; i++)
        gnutls_pcert_deinit(&pair->chain[i]);
    if (pair->key)
        gnutls_privkey_deinit(pair->key);
    mem_free(pair);
}

static enum status parse(const struct tls *tls, struct pair *pair, const gnutls_datum_t *chain,
                         const gnutls_datum_t *key, struct error *err) {
    enum status status = check_match(tls, chain, key, err);
    if (status != STATUS_OK)
        return status;
    unsigned count = CHAIN_MAX;
    int code = gnutls_pcert_list_import_x509_raw(pair->chain, &count, chain, GNUTLS_X509_FMT_PEM,
                                                 GNUTLS_X509_CRT_LIST_IMPORT_FAIL_IF_EXCEED);
    if (code == GNUTLS_E_SHORT_MEMORY_BUFFER)
        return error_set(err, STATUS_INPUT, "%s has more than %d certificates", tls->certificate_file, CHAIN_MAX);
    if (code < 0)
        return failed(code, tls->certificate_file, err);
    pair->count = count;
    code = gnutls_privkey_init(&pair->key);
    if (code == 0)
        code = gnutls_privkey_import_x509_raw(pair->key, key, GNUTLS_X509_FMT_PEM, NULL, 0);
    return code == 0 ? STATUS_OK : failed(code, tls->key_file, err);
}

enum status tls_reload(struct tls *tls, struct error *err) {
    struct buf chain_text, key_text;
    gnutls_datum_t chain, key;
    struct pair *pair = mem_calloc(1, sizeof *pair);
    buf_init(&key_text, FILE_MAX_BYTES);
    enum status status = read_file(tls->certificate_file, &chain, &chain_text, err);
    if (status == STATUS_OK)
        status = read_file(tls->key_file, &key, &key_text, err);
    if (status == STATUS_OK)
        status = parse(tls, pair, &chain, &key, err);
    buf_release(&chain_text);
    buf_release(&key_text);
    if (status != STATUS_OK) {
        free_pair(pair);
        return status;
    }
    pair->older = atomic_load(&tls->newest);
    atomic_store(&tls->newest, pair);
    return STATUS_OK;
}

enum status tls_new(struct tls **out, const char *certificate_file, const char *key_file, struct error *err) {
    struct tls *tls = mem_calloc(1, sizeof *tls);
    tls->certificate_file = mem_strdup(certificate_file);
    tls->key_file = mem_strdup(key_file);
    enum status status = tls_reload(tls, err);
    if (status != STATUS_OK) {
        tls_free(tls);
        return status;
    }
    atomic_store(&current, tls);
    *out = tls;
    return STATUS_OK;
}

void tls_free(struct tls *tls) {
    if (!tls)
        return;
    struct tls *mine = tls;
    atomic_compare_exchange_strong(&current, &mine, NULL);
    for (struct pair *pair = atomic_load(&tls->newest), *older; pair; pair = older) {
        older = pair->older;
        free_pair(pair);
    }
    mem_free(tls->certificate_file);
    mem_free(tls->key_file);
    mem_free(tls);
}

static int give_certificate(gnutls_session_t session, const gnutls_datum_t *authorities, int authority_count,
                            const gnutls_pk_algorithm_t *algorithms, int algorithm_count, gnutls_pcert_st **chain,
                            unsigned *count, gnutls_privkey_t *key) {
    (void)session, (void)authorities, (void)authority_count, (void)algorithms, (void)algorithm_count;
    struct tls *tls = atomic_load(&current);
    if (!tls)
        return -1;
    struct pair *pair = atomic_load(&tls->newest);
    *chain = pair->chain;
    *count = pair->count;
    *key = pair->key;
    return 0;
}

void *tls_certificate_callback(void) { return (void *)give_certificate; }

void tls_send(void *session, const void *data, size_t length) {
    /* A few hundred bytes fit into the socket's buffer unless the client does not read. */
    (void)!gnutls_record_send(session, data, length);
}

enum status tls_days_left(const char *certificate_file, double *days, struct error *err) {
    struct buf text;
    gnutls_datum_t datum;
    gnutls_x509_crt_t certificate;
    enum status status = read_file(certificate_file, &datum, &text, err);
    if (status == STATUS_OK) {
        int code = gnutls_x509_crt_init(&certificate);
        if (code == 0) {
            code = gnutls_x509_crt_import(certificate, &datum, GNUTLS_X509_FMT_PEM);
            if (code == 0)
                *days = difftime(gnutls_x509_crt_get_expiration_time(certificate), time(NULL)) / 86400;
            gnutls_x509_crt_deinit(certificate);
        }
        if (code != 0)
            status = failed(code, certificate_file, err);
    }
    buf_release(&text);
    return status;
}

const char *tls_library_version(void) { return gnutls_check_version(NULL); }
