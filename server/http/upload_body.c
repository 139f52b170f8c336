/* upload_body.c -- see upload_body.h. */
#include "server/http/upload_body.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "common/base64.h"
#include "common/mem.h"
#include "common/sha1.h"
#include "common/sha256.h"
#include "server/http/space.h"
#include "server/http/tus.h"
#include "server/net/field.h"
#include "server/transport/problem.h"
#include "server/uploads/upload_writer.h"

enum checksum { CHECKSUM_NONE, CHECKSUM_SHA1, CHECKSUM_SHA256 };

struct upload_patch {
    struct upload_writer *writer;
    enum checksum checksum;
    uint8_t wanted[32];
    struct sha1 sha1;
    struct sha256 sha256;
};

static struct response *read_checksum(const struct request *r, struct upload_patch *p) {
    const char *text = request_field(r, "Upload-Checksum");
    if (!text)
        return NULL;
    size_t name = strcspn(text, " "), used, size = 0;
    if (name == 4 && memcmp(text, "sha1", 4) == 0)
        p->checksum = CHECKSUM_SHA1, size = SHA1_BYTES;
    else if (name == 6 && memcmp(text, "sha256", 6) == 0)
        p->checksum = CHECKSUM_SHA256, size = sizeof p->wanted;
    else
        return problem(r, 400, "Upload-Checksum must be of sha1 or sha256");
    const char *value = text + name + strspn(text + name, " ");
    if (!base64_decode(value, strlen(value), p->wanted, size, &used) || used != size)
        return problem(r, 400, "Upload-Checksum is not the base64 of %zu bytes", size);
    sha1_init(&p->sha1);
    sha256_init(&p->sha256);
    return NULL;
}

struct response *upload_body_begin(struct api *api, struct request *r) {
    struct response *refusal = tus_check_version(r, true);
    const char *text = request_field(r, "Upload-Offset");
    const char *id = refusal ? NULL : tus_find_upload(api, r, &refusal);
    int64_t offset = 0;
    struct error err;
    if (!refusal && (!text || !field_number(text, 0, INT64_MAX, &offset)))
        refusal = problem(r, 400, "Upload-Offset must be a number of bytes");
    if (refusal)
        return refusal;
    struct upload_patch *p = r->patch = mem_calloc(1, sizeof *p);
    refusal = read_checksum(r, p);
    if (refusal)
        return refusal;
    if (upload_writer_take(api->resumables, id, (uint64_t)offset, p->checksum != CHECKSUM_NONE, &p->writer, &err) !=
        STATUS_OK)
        return tus_refuse(r, &err);
    if (r->content_length > 0 && (uint64_t)r->content_length > upload_writer_room(p->writer))
        return problem(r, 413, "the upload needs %" PRIu64 " further bytes, not %lld", upload_writer_room(p->writer),
                       (long long)r->content_length);
    uint64_t unreserved = upload_writer_unreserved(p->writer);
    return unreserved ? space_check_free(api, r, unreserved) : NULL;
}

struct response *upload_body_data(struct api *api, struct request *r, const void *data, size_t length) {
    struct upload_patch *p = r->patch;
    struct error err;
    if (upload_writer_write(p->writer, data, length, &err) != STATUS_OK)
        return tus_refuse(r, &err);
    atomic_fetch_add(&api->uploaded_bytes, length);
    if (p->checksum == CHECKSUM_SHA1)
        sha1_update(&p->sha1, data, length);
    else if (p->checksum == CHECKSUM_SHA256)
        sha256_update(&p->sha256, data, length);
    if (upload_writer_is_due(p->writer) && upload_writer_commit(p->writer, &err) != STATUS_OK)
        return tus_refuse(r, &err);
    return NULL;
}

void upload_body_drop(struct upload_patch *p) {
    if (!p)
        return;
    upload_writer_release(p->writer);
    mem_free(p);
}

static bool is_as_sent(struct upload_patch *p) {
    uint8_t found[32] = {0};
    if (p->checksum == CHECKSUM_NONE)
        return true;
    if (p->checksum == CHECKSUM_SHA1) {
        sha1_bytes(&p->sha1, found);
        return memcmp(found, p->wanted, SHA1_BYTES) == 0;
    }
    char hex[SHA256_HEX_SIZE];
    sha256_hex(&p->sha256, hex);
    for (size_t i = 0; i < sizeof found; i++) {
        unsigned byte = 0;
        sscanf(hex + 2 * i, "%2x", &byte);
        found[i] = (uint8_t)byte;
    }
    return memcmp(found, p->wanted, sizeof found) == 0;
}

struct response *upload_body_end(const struct request *r, struct upload_row *row) {
    struct upload_patch *p = r->patch;
    struct error err;
    enum status status = STATUS_OK;
    if (!is_as_sent(p))
        return problem(r, 460, "the checksum does not match the bytes that arrived; they were discarded");
    if (p->checksum != CHECKSUM_NONE)
        status = upload_writer_accept(p->writer, &err);
    if (status == STATUS_OK)
        status = upload_writer_finish(p->writer, row, &err);
    return status == STATUS_OK ? NULL : tus_refuse(r, &err);
}
