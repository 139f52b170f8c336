/* address.h -- where a request comes from: the address of the connection or, where that is a proxy's that the
 * configuration trusts, the address that the proxies name in X-Forwarded-For or Forwarded (RFC 7239).
 *
 * Whoever asks can write these fields: they are read from the right, where the trusted proxy next to us put what it
 * saw, and only as far as the addresses are trusted proxies'. */
#ifndef UNBAKE_NET_ADDRESS_H
#define UNBAKE_NET_ADDRESS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/socket.h>

#include "common/error.h"
#include "server/net/field.h"

#define ADDRESS_PROXIES_MAX 64 /* entries of trusted_proxies */
#define ADDRESS_TEXT_SIZE 46   /* INET6_ADDRSTRLEN */

/* In IPv6 form (IPv4 as ::ffff:a.b.c.d), network byte order; all 0 if unknown. */
struct address {
    uint8_t bytes[16];
};

/* Addresses of proxies; IPv4 prefixes lie in ::ffff:0:0/96. */
struct proxies {
    struct {
        struct address base;
        unsigned bits; /* length of the prefix, 0 to 128 */
    } net[ADDRESS_PROXIES_MAX];
    size_t count;
    const char *field; /* the one that they set: "X-Forwarded-For" or "Forwarded"; static storage */
};

/* Reads "10.0.0.0/8, ::1" (separated by spaces or commas; "" is none) and the name of the field, in any
 * case. STATUS_INPUT says which part is at fault. */
enum status proxies_parse(struct proxies *p, const char *list, const char *field, struct error *err);
bool proxies_trust(const struct proxies *p, const struct address *a);

/* text[length]: "10.1.2.3", "10.1.2.3:80", "::1", "[::1]:80". */
bool address_parse(const char *text, size_t length, struct address *a);
struct address address_of_socket(const struct sockaddr *from);
/* In the usual notation: "10.1.2.3", "2001:db8::1". */
void address_text(const struct address *a, char text[ADDRESS_TEXT_SIZE]);

/* The client's address for a request with field[count] on a connection from `peer`. Where a trusted proxy names
 * something that is not an address, the proxy's own address counts. */
struct address address_of_request(const struct field *field, size_t count, const struct address *peer,
                                  const struct proxies *p);

#endif
