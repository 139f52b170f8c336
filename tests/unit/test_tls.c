/* test_tls.c -- the daemon's certificate: what is no certificate is refused with its file's name, and connections
 * that begin meanwhile get the last one that was good. */
#include "server/net/tls.h"

#include <gnutls/abstract.h>
#include <gnutls/gnutls.h>
#include <gnutls/x509.h>
#include <time.h>

#include "common/file.h"
#include "common/mem.h"
#include "tests/check.h"

#define CHAIN 17 /* certificates: one more than are taken */

static char dir[] = "/tmp/unbake-test-tls-XXXXXX";
static char *certificate, *key;
static struct error err;

static void put(const char *path, const void *data, size_t length) {
    CHECK_THAT(file_replace(path, data, length, &err) == STATUS_OK, "%s", err.message);
}

/* A certificate of serial number `serial`, so many times over, and its key, for two days from now. */
static void make(unsigned char serial, int times) {
    gnutls_x509_privkey_t private;
    gnutls_x509_crt_t crt;
    gnutls_datum_t text;
    struct buf chain;
    buf_init(&chain, 1 << 20);
    CHECK(gnutls_x509_privkey_init(&private) == 0 && gnutls_x509_crt_init(&crt) == 0);
    CHECK(gnutls_x509_privkey_generate(private, GNUTLS_PK_ECDSA, GNUTLS_CURVE_TO_BITS(GNUTLS_ECC_CURVE_SECP256R1), 0) ==
          0);
    CHECK(gnutls_x509_crt_set_version(crt, 3) == 0 && gnutls_x509_crt_set_serial(crt, &serial, 1) == 0);
    CHECK(gnutls_x509_crt_set_dn(crt, "CN=lab.example.org", NULL) == 0);
    CHECK(gnutls_x509_crt_set_activation_time(crt, time(NULL) - 60) == 0);
    CHECK(gnutls_x509_crt_set_expiration_time(crt, time(NULL) + 2 * 86400) == 0);
    CHECK(gnutls_x509_crt_set_key(crt, private) == 0);
    CHECK(gnutls_x509_crt_sign2(crt, crt, private, GNUTLS_DIG_SHA256, 0) == 0);
    CHECK(gnutls_x509_crt_export2(crt, GNUTLS_X509_FMT_PEM, &text) == 0);
    for (int i = 0; i < times; i++)
        buf_append(&chain, text.data, text.size);
    put(certificate, chain.data, chain.length);
    gnutls_free(text.data);
    CHECK(gnutls_x509_privkey_export2(private, GNUTLS_X509_FMT_PEM, &text) == 0);
    put(key, text.data, text.size);
    gnutls_free(text.data);
    buf_release(&chain);
    gnutls_x509_crt_deinit(crt);
    gnutls_x509_privkey_deinit(private);
}

/* The serial number of what a connection would get; -1: nothing. */
static int serial_given(void) {
    gnutls_certificate_retrieve_function2 *give;
    gnutls_pcert_st *chain = NULL;
    gnutls_privkey_t private = NULL;
    gnutls_x509_crt_t crt;
    unsigned count = 0;
    unsigned char serial[32];
    size_t size = sizeof serial;
    *(void **)&give = tls_certificate_callback();
    if (give(NULL, NULL, 0, NULL, 0, &chain, &count, &private) != 0)
        return -1;
    CHECK(count == 1 && private != NULL);
    CHECK(gnutls_x509_crt_init(&crt) == 0);
    CHECK(gnutls_x509_crt_import(crt, &chain->cert, GNUTLS_X509_FMT_DER) == 0);
    CHECK(gnutls_x509_crt_get_serial(crt, serial, &size) == 0);
    gnutls_x509_crt_deinit(crt);
    return size == 1 ? serial[0] : -2;
}

/* At a start, and when it is read again: refused, with `word` and the name of the file at fault. */
static void check_refused(struct tls *tls, enum status wanted, const char *file, const char *word) {
    struct tls *other = NULL;
    for (int is_new = 0; is_new < 2; is_new++) {
        enum status status = is_new ? tls_new(&other, certificate, key, &err) : tls_reload(tls, &err);
        CHECK_THAT(status == wanted && err.status == wanted, "%s: %s", word, status_name(status));
        CHECK_THAT(strstr(err.message, file) && strstr(err.message, word), "%s", err.message);
        CHECK_THAT(serial_given() == 1, "%s: connections get certificate %d", word, serial_given());
    }
}

static void check_days(enum status wanted, const char *word) {
    double days = 77.0;
    CHECK(tls_days_left(certificate, &days, &err) == wanted && days == 77.0);
    CHECK_THAT(strstr(err.message, certificate) && strstr(err.message, word), "%s", err.message);
}

/* What is offered: TLS 1.2 and 1.3, each suite with forward secrecy and without SHA-1, and no signature with it. */
static void check_suites(void) {
    gnutls_priority_t priorities;
    const char *fault = NULL;
    CHECK_THAT(gnutls_priority_init(&priorities, TLS_PRIORITIES, &fault) == 0, "%s", fault ? fault : "");
    size_t of_12 = 0, of_13 = 0;
    unsigned number;
    for (unsigned i = 0;
         gnutls_priority_get_cipher_suite_index(priorities, i, &number) != GNUTLS_E_REQUESTED_DATA_NOT_AVAILABLE; i++) {
        unsigned char id[2];
        gnutls_kx_algorithm_t kx;
        gnutls_cipher_algorithm_t cipher;
        gnutls_mac_algorithm_t mac;
        gnutls_protocol_t version;
        const char *name = gnutls_cipher_suite_info(number, id, &kx, &cipher, &mac, &version);
        if (!name)
            continue;
        of_13 += id[0] == 0x13;
        of_12 += id[0] != 0x13;
        CHECK_THAT(id[0] == 0x13 || kx == GNUTLS_KX_ECDHE_RSA || kx == GNUTLS_KX_ECDHE_ECDSA || kx == GNUTLS_KX_DHE_RSA,
                   "%s", name);
        CHECK_THAT(mac != GNUTLS_MAC_SHA1 && !strstr(name, "SHA1"), "%s", name);
    }
    CHECK_THAT(of_12 > 5 && of_13 >= 3, "%zu and %zu suites", of_12, of_13);
    const unsigned *list;
    int count = gnutls_priority_protocol_list(priorities, &list);
    for (int i = 0; i < count; i++)
        CHECK(list[i] == GNUTLS_TLS1_2 || list[i] == GNUTLS_TLS1_3);
    count = gnutls_priority_sign_list(priorities, &list);
    CHECK(count > 5);
    for (int i = 0; i < count; i++)
        CHECK_THAT(gnutls_sign_get_hash_algorithm((gnutls_sign_algorithm_t)list[i]) != GNUTLS_DIG_SHA1, "%s",
                   gnutls_sign_get_name((gnutls_sign_algorithm_t)list[i]));
    gnutls_priority_deinit(priorities);
}

int main(void) {
    struct tls *tls;
    double days = 0.0;
    if (!mkdtemp(dir))
        return 1;
    check_suites();
    certificate = file_join(dir, "cert.pem");
    key = file_join(dir, "key.pem");
    CHECK(serial_given() == -1);
    CHECK(tls_new(&tls, certificate, key, &err) == STATUS_NOT_FOUND && strstr(err.message, certificate));
    make(1, 1);
    CHECK_THAT(tls_new(&tls, certificate, key, &err) == STATUS_OK, "%s", err.message);
    CHECK(serial_given() == 1);
    CHECK(tls_days_left(certificate, &days, &err) == STATUS_OK);
    CHECK_NEAR(days, 2.0, 0.01);

    unlink(key);
    check_refused(tls, STATUS_NOT_FOUND, key, "cannot open");
    put(key, "", 0);
    check_refused(tls, STATUS_INPUT, key, "is empty");
    put(key, "a key\n", 6);
    check_refused(tls, STATUS_INPUT, key, "and");
    CHECK(strstr(err.hint, "private key"));
    make(2, CHAIN);
    check_refused(tls, STATUS_INPUT, certificate, "more than 16 certificates");
    unlink(certificate);
    check_refused(tls, STATUS_NOT_FOUND, certificate, "cannot open");
    check_days(STATUS_NOT_FOUND, "cannot open");
    put(certificate, "", 0);
    check_refused(tls, STATUS_INPUT, certificate, "is empty");
    check_days(STATUS_INPUT, "is empty");
    put(certificate, "nonsense\n", 9);
    check_days(STATUS_INPUT, ": ");

    make(3, 1);
    CHECK_THAT(tls_reload(tls, &err) == STATUS_OK, "%s", err.message);
    CHECK(serial_given() == 3);
    tls_free(tls);
    CHECK(serial_given() == -1);
    mem_free(certificate);
    mem_free(key);
    CHECK(file_remove_tree(dir, &err) == STATUS_OK);
    return check_result();
}
