/* Requests that two servers may read differently, or that a page in a browser may send: each is
 * refused with its status, on a connection that is then closed; and the good ones pass. */
#include "tests/api/rig.h"

#define HOST "Host: localhost\r\n"
#define CLOSE "Connection: close\r\n"
#define TUS "Tus-Resumable: 1.0.0\r\n"
#define NO_UPLOAD "/v1/uploads/00000000000000000000000000000000"
/* Added to a status: libmicrohttpd 1.0 refuses it with 400 before anybody is asked. */
#define OR_REFUSED 1000
#define CLOSED 0 /* the connection ends without a word */

static const struct {
    const char *what, *text;
    int status;
} cases[] = {
    {"a plain request", "GET /healthz HTTP/1.1\r\n" HOST CLOSE "\r\n", 200},
    {"HTTP/1.0 without Host", "GET /healthz HTTP/1.0\r\n\r\n", 200},
    {"a HEAD", "HEAD /healthz HTTP/1.1\r\n" HOST CLOSE "\r\n", 200},
    {"Host of IPv6", "GET /healthz HTTP/1.1\r\nHost: [::1]:80\r\n" CLOSE "\r\n", 200},
    {"Host of the configuration", "GET /healthz HTTP/1.1\r\nHost: lab.example.org\r\n" CLOSE "\r\n", 200},
    {"a chunked body",
     "POST /v1/jobs/1/cancel HTTP/1.1\r\n" HOST CLOSE "Transfer-Encoding: chunked\r\n\r\n3\r\nabc\r\n0\r\n\r\n", 404},
    {"a body that nobody wants", "GET /healthz HTTP/1.1\r\n" HOST CLOSE "Content-Length: 3\r\n\r\nabc", 200},

    {"no Host", "GET /healthz HTTP/1.1\r\n" CLOSE "\r\n", 400},
    {"two Hosts", "GET /healthz HTTP/1.1\r\n" HOST HOST CLOSE "\r\n", 400},
    {"an empty Host", "GET /healthz HTTP/1.1\r\nHost:\r\n" CLOSE "\r\n", 400},
    {"a Host with a path", "GET /healthz HTTP/1.1\r\nHost: localhost/x\r\n" CLOSE "\r\n", 400},
    {"a Host with a user", "GET /healthz HTTP/1.1\r\nHost: a@localhost\r\n" CLOSE "\r\n", 400},
    {"another Host (DNS rebinding)", "GET /healthz HTTP/1.1\r\nHost: evil.org\r\n" CLOSE "\r\n", 403},
    {"a Host like loopback", "GET /healthz HTTP/1.1\r\nHost: 127.0.0.1.evil.org\r\n" CLOSE "\r\n", 403},
    {"a change from another origin",
     "POST /v1/jobs/1/cancel HTTP/1.1\r\n" HOST CLOSE "Origin: http://evil.org\r\nContent-Length: 0\r\n\r\n", 403},
    {"a change from a null origin", "DELETE /v1/jobs/1 HTTP/1.1\r\n" HOST CLOSE "Origin: null\r\n\r\n", 403},
    {"a change from this origin", "DELETE /v1/jobs/1 HTTP/1.1\r\n" HOST CLOSE "Origin: http://localhost\r\n\r\n", 404},
    {"a look from another origin", "GET /healthz HTTP/1.1\r\n" HOST CLOSE "Origin: http://evil.org\r\n\r\n", 200},

    {"two equal Content-Lengths",
     "POST /v1/jobs/1/cancel HTTP/1.1\r\n" HOST "Content-Length: 3\r\nContent-Length: 3\r\n\r\nabc", 400},
    {"two Content-Lengths",
     "POST /v1/jobs/1/cancel HTTP/1.1\r\n" HOST "Content-Length: 3\r\nContent-Length: 30\r\n\r\nabc", 400},
    {"a list of lengths", "POST /v1/jobs/1/cancel HTTP/1.1\r\n" HOST "Content-Length: 3, 3\r\n\r\nabc", 400},
    {"a signed length", "POST /v1/jobs/1/cancel HTTP/1.1\r\n" HOST "Content-Length: +3\r\n\r\nabc", 400},
    {"a negative length", "POST /v1/jobs/1/cancel HTTP/1.1\r\n" HOST "Content-Length: -3\r\n\r\nabc", 400},
    {"a hexadecimal length", "POST /v1/jobs/1/cancel HTTP/1.1\r\n" HOST "Content-Length: 0x3\r\n\r\nabc", 400},
    {"a length beyond numbers",
     "POST /v1/jobs/1/cancel HTTP/1.1\r\n" HOST "Content-Length: 99999999999999999999999\r\n\r\nabc", 413},
    {"length and coding",
     "POST /v1/jobs/1/cancel HTTP/1.1\r\n" HOST "Content-Length: 3\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n",
     400},
    {"coding and length",
     "POST /v1/jobs/1/cancel HTTP/1.1\r\n" HOST "Transfer-Encoding: chunked\r\nContent-Length: 3\r\n\r\n0\r\n\r\n",
     400},
    {"two codings",
     "POST /v1/jobs/1/cancel HTTP/1.1\r\n" HOST
     "Transfer-Encoding: chunked\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n",
     400},
    {"another coding", "POST /v1/jobs/1/cancel HTTP/1.1\r\n" HOST "Transfer-Encoding: gzip\r\n\r\n", 400},
    {"a list of codings",
     "POST /v1/jobs/1/cancel HTTP/1.1\r\n" HOST "Transfer-Encoding: gzip, chunked\r\n\r\n0\r\n\r\n", 400},
    {"a disguised coding", "POST /v1/jobs/1/cancel HTTP/1.1\r\n" HOST "Transfer-Encoding: xchunked\r\n\r\n0\r\n\r\n",
     400},
    {"a field with a space before its colon",
     "POST /v1/jobs/1/cancel HTTP/1.1\r\n" HOST "Content-Length : 3\r\n\r\nabc", 400},
    {"a control byte in a field", "GET /healthz HTTP/1.1\r\n" HOST CLOSE "X-A: a\001b\r\n\r\n", 400},
    {"a DEL in a field", "GET /healthz HTTP/1.1\r\n" HOST CLOSE "X-A: a\177b\r\n\r\n", 400},
    {"a field whose name is no word", "GET /healthz HTTP/1.1\r\n" HOST CLOSE "a b: c\r\n\r\n", 400},
    {"two Idempotency-Keys",
     "POST /v1/jobs HTTP/1.1\r\n" HOST CLOSE "Idempotency-Key: a\r\nIdempotency-Key: b\r\nContent-Length: 0\r\n\r\n",
     400},
    {"two Ranges", "GET /healthz HTTP/1.1\r\n" HOST CLOSE "Range: bytes=0-1\r\nRange: bytes=1-2\r\n\r\n", 400},
    {"an unknown expectation", "POST /v1/jobs HTTP/1.1\r\n" HOST CLOSE "Expect: tea\r\nContent-Length: 1\r\n\r\n", 417},
    {"no expectation", "GET /healthz HTTP/1.1\r\n" HOST CLOSE "Expect:\r\n\r\n", 200},
    {"OPTIONS of what is no upload's id", "OPTIONS /v1/uploads/x HTTP/1.1\r\n" HOST CLOSE "\r\n", 404},
    {"a change by JSON in another version of tus",
     "PATCH " NO_UPLOAD " HTTP/1.1\r\n" HOST CLOSE
     "Content-Type: application/json\r\nTus-Resumable: 2.0.0\r\nContent-Length: 2\r\n\r\n{}",
     412},
    {"a change by JSON with an offset",
     "PATCH " NO_UPLOAD " HTTP/1.1\r\n" HOST CLOSE
     "Content-Type: application/json\r\nUpload-Offset: 0\r\nContent-Length: 2\r\n\r\n{}",
     400},
    {"HTTP/1.7", "GET /healthz HTTP/1.7\r\n" HOST CLOSE "\r\n", 400},
    {"HTTP/2.0", "GET /healthz HTTP/2.0\r\n" HOST CLOSE "\r\n", 505},
    {"no version", "GET /healthz\r\n\r\n", 400},
    {"no HTTP at all", "\x16\x03\x01\x02\r\n\r\n", CLOSED},

    {"a path that climbs", "GET /v1/../etc/passwd HTTP/1.1\r\n" HOST CLOSE "\r\n", 400},
    {"an encoded path that climbs", "GET /v1/jobs/1/outputs/%2e%2e%2fstate.db HTTP/1.1\r\n" HOST CLOSE "\r\n", 400},
    {"slashes in disguise that climb", "GET /v1/jobs/1/outputs/a%2f..%2f..%2fb HTTP/1.1\r\n" HOST CLOSE "\r\n", 400},
    {"an encoded NUL", "GET /healthz%00.png HTTP/1.1\r\n" HOST CLOSE "\r\n", 400},
    {"an encoded line end", "GET /healthz%0d%0aX: HTTP/1.1\r\n" HOST CLOSE "\r\n", 400},
    {"a double slash", "GET //healthz HTTP/1.1\r\n" HOST CLOSE "\r\n", 400},
    {"a slash at the end", "GET /healthz/ HTTP/1.1\r\n" HOST CLOSE "\r\n", 400},
    {"a broken escape", "GET /healthz%4 HTTP/1.1\r\n" HOST CLOSE "\r\n", 400},
    {"an absolute target", "GET http://localhost/healthz HTTP/1.1\r\n" HOST CLOSE "\r\n", 200},
    {"an absolute target without a path", "GET http://localhost:7777 HTTP/1.1\r\n" HOST CLOSE "\r\n", 200},
    {"an absolute target that is right where Host is not",
     "GET https://lab.example.org/healthz HTTP/1.1\r\nHost: evil.org\r\n" CLOSE "\r\n", 200},
    {"an absolute target of another host", "GET http://evil.org/healthz HTTP/1.1\r\n" HOST CLOSE "\r\n", 403},
    {"an absolute target of another host in HTTP/1.0", "GET http://evil.org/healthz HTTP/1.0\r\n\r\n", 403},
    {"an absolute target without Host", "GET http://localhost/healthz HTTP/1.1\r\n" CLOSE "\r\n", 400},
    {"an absolute target with a user", "GET http://a@localhost/healthz HTTP/1.1\r\n" HOST CLOSE "\r\n", 400},
    {"an absolute target without a host", "GET http:///healthz HTTP/1.1\r\n" HOST CLOSE "\r\n", 400},
    {"an absolute target of another scheme", "GET ftp://localhost/healthz HTTP/1.1\r\n" HOST CLOSE "\r\n", 400},
    {"a change from the origin that is the target's",
     "DELETE http://lab.example.org/v1/jobs/1 HTTP/1.1\r\n" HOST CLOSE "Origin: https://lab.example.org\r\n\r\n", 404},
    {"a change from the origin that is only Host's",
     "DELETE http://lab.example.org/v1/jobs/1 HTTP/1.1\r\n" HOST CLOSE "Origin: http://localhost\r\n\r\n", 403},
    {"a NUL within a string",
     "POST /v1/session HTTP/1.1\r\n" HOST CLOSE "Content-Type: application/json\r\n"
     "Content-Length: 21\r\n\r\n{\"token\": \"a\\u0000b\"}",
     400},
    {"a star", "OPTIONS * HTTP/1.1\r\n" HOST CLOSE "\r\n", 400},
    {"an unknown path", "GET /v2/jobs HTTP/1.1\r\n" HOST CLOSE "\r\n", 404},
    {"an encoded slash between parts", "GET /v1%2fjobs HTTP/1.1\r\n" HOST CLOSE "\r\n", 404},
    {"an unknown method", "BREW /healthz HTTP/1.1\r\n" HOST CLOSE "\r\n", 405},
    {"a method in lower case", "get /healthz HTTP/1.1\r\n" HOST CLOSE "\r\n", 405},
    {"TRACE", "TRACE /healthz HTTP/1.1\r\n" HOST CLOSE "\r\n", 405},
    {"CONNECT", "CONNECT localhost:80 HTTP/1.1\r\n" HOST CLOSE "\r\n", 400},
    {"a query that nobody knows", "GET /v1/version?x=1 HTTP/1.1\r\n" HOST CLOSE "\r\n", 400},
    {"more after the version", "GET /healthz HTTP/1.1 x\r\n" HOST CLOSE "\r\n", 400},
    {"a request line of spaces", "   \r\n\r\n", CLOSED},
    {"a field that is continued", "GET /healthz HTTP/1.1\r\n" HOST CLOSE "X-A: a\r\n b\r\n\r\n", 200},
    {"a length that is continued",
     "POST /v1/jobs/1/cancel HTTP/1.1\r\n" HOST CLOSE "Content-Length: 3\r\n 0\r\n\r\nabc", 400},
    {"a coding that is continued",
     "POST /v1/jobs/1/cancel HTTP/1.1\r\n" HOST CLOSE "Transfer-Encoding: chunked\r\n x\r\n\r\n0\r\n\r\n", 400},
    {"lines that end in LF alone",
     "GET /healthz HTTP/1.1\n"
     "Host: localhost\nConnection: close\n\n",
     200},
    {"a field without a colon", "GET /healthz HTTP/1.1\r\n" HOST CLOSE "X-A\r\n\r\n", 400},
    {"a field without a name", "GET /healthz HTTP/1.1\r\n" HOST CLOSE ": a\r\n\r\n",
     OR_REFUSED + 200}, /* 0.9.75 drops it */
    {"an upgrade that nobody offers",
     "GET /healthz HTTP/1.1\r\n" HOST "Connection: close, Upgrade\r\nUpgrade: h2c\r\n\r\n", 200},
    {"a coding in HTTP/1.0", "POST /v1/jobs/1/cancel HTTP/1.0\r\n" HOST "Transfer-Encoding: chunked\r\n\r\n0\r\n\r\n",
     404},
    {"a coding in capitals",
     "POST /v1/jobs/1/cancel HTTP/1.1\r\n" HOST CLOSE "Transfer-Encoding: Chunked\r\n\r\n0\r\n\r\n", 404},
    {"an empty coding", "POST /v1/jobs/1/cancel HTTP/1.1\r\n" HOST CLOSE "Transfer-Encoding:\r\n\r\n", 400},
    {"chunks with extensions and trailers",
     "POST /v1/jobs/1/cancel HTTP/1.1\r\n" HOST CLOSE
     "Transfer-Encoding: chunked\r\n\r\n3;a=b\r\nabc\r\n0\r\nX: y\r\n\r\n",
     OR_REFUSED + 404},
    {"a chunk whose size is no number",
     "POST /v1/jobs HTTP/1.1\r\n" HOST CLOSE "Content-Type: application/json\r\n"
     "Transfer-Encoding: chunked\r\n\r\nzz\r\n{}\r\n0\r\n\r\n",
     400},
    {"a chunk of negative size",
     "POST /v1/jobs HTTP/1.1\r\n" HOST CLOSE "Content-Type: application/json\r\n"
     "Transfer-Encoding: chunked\r\n\r\n-2\r\n{}\r\n0\r\n\r\n",
     400},
    {"a chunk larger than numbers",
     "POST /v1/jobs HTTP/1.1\r\n" HOST CLOSE "Content-Type: application/json\r\n"
     "Transfer-Encoding: chunked\r\n\r\nfffffffffffffffff\r\n{}\r\n0\r\n\r\n",
     413},
    {"a chunk longer than it says",
     "POST /v1/jobs HTTP/1.1\r\n" HOST CLOSE "Content-Type: application/json\r\n"
     "Transfer-Encoding: chunked\r\n\r\n1\r\n{}\r\n0\r\n\r\n",
     400},
    {"a body that is no JSON",
     "POST /v1/jobs HTTP/1.1\r\n" HOST CLOSE "Content-Type: application/json\r\nContent-Length: 3\r\n\r\nabc", 400},
    {"a body that is packed",
     "POST /v1/jobs HTTP/1.1\r\n" HOST CLOSE "Content-Type: application/json\r\n"
     "Content-Encoding: gzip\r\nContent-Length: 3\r\n\r\nabc",
     415},
    {"a body too long for its kind",
     "POST /v1/jobs HTTP/1.1\r\n" HOST CLOSE "Content-Type: application/json\r\n"
     "Content-Length: 99999999\r\n\r\n",
     413},
    {"a refusal instead of 100 Continue",
     "POST /v1/scenes HTTP/1.1\r\n" HOST CLOSE "Expect: 100-continue\r\nContent-Length: 99999999999\r\n\r\n", 413},

    {"OPTIONS where there is one", "OPTIONS /v1/uploads HTTP/1.1\r\n" HOST CLOSE "\r\n", 204},
    {"OPTIONS where there is none", "OPTIONS /v1/jobs HTTP/1.1\r\n" HOST CLOSE "\r\n", 405},
    {"an upload of another protocol",
     "POST /v1/uploads HTTP/1.1\r\n" HOST CLOSE "Tus-Resumable: 0.2.2\r\nUpload-Length: 1\r\nContent-Length: 0\r\n\r\n",
     412},
    {"an upload of two lengths",
     "POST /v1/uploads HTTP/1.1\r\n" HOST CLOSE TUS "Upload-Length: 1\r\nUpload-Length: 2\r\nContent-Length: 0\r\n\r\n",
     400},
    {"an upload of negative length",
     "POST /v1/uploads HTTP/1.1\r\n" HOST CLOSE TUS "Upload-Length: -1\r\nContent-Length: 0\r\n\r\n", 400},
    {"an upload that is too long",
     "POST /v1/uploads HTTP/1.1\r\n" HOST CLOSE TUS "Upload-Length: 8388609\r\nContent-Length: 0\r\n\r\n", 413},
    {"metadata with a control byte",
     "POST /v1/uploads HTTP/1.1\r\n" HOST CLOSE TUS
     "Upload-Length: 1\r\nUpload-Metadata: name\001 YQ==\r\nContent-Length: 0\r\n\r\n",
     400},
    {"a part of no upload",
     "PATCH " NO_UPLOAD " HTTP/1.1\r\n" HOST CLOSE TUS "Upload-Offset: 0\r\n"
     "Content-Type: application/offset+octet-stream\r\nContent-Length: 3\r\n\r\nabc",
     404},
    {"a part of two offsets",
     "PATCH " NO_UPLOAD " HTTP/1.1\r\n" HOST CLOSE TUS "Upload-Offset: 0\r\nUpload-Offset: 1\r\n"
     "Content-Type: application/offset+octet-stream\r\nContent-Length: 3\r\n\r\nabc",
     400},
    {"a part of an offset beyond numbers",
     "PATCH " NO_UPLOAD " HTTP/1.1\r\n" HOST CLOSE TUS
     "Upload-Offset: 99999999999999999999\r\nContent-Type: application/offset+octet-stream\r\nContent-Length: 3\r\n\r\nabc",
     404},
    {"a part of another type",
     "PATCH " NO_UPLOAD " HTTP/1.1\r\n" HOST CLOSE TUS "Upload-Offset: 0\r\n"
     "Content-Type: text/plain\r\nContent-Length: 3\r\n\r\nabc",
     415},
    {"a method in disguise elsewhere",
     "POST /v1/jobs/1 HTTP/1.1\r\n" HOST CLOSE "X-HTTP-Method-Override: DELETE\r\nContent-Length: 0\r\n\r\n", 405},
    {"two methods in disguise",
     "POST " NO_UPLOAD " HTTP/1.1\r\n" HOST CLOSE TUS
     "X-HTTP-Method-Override: DELETE\r\nX-HTTP-Method-Override: PATCH\r\nContent-Length: 0\r\n\r\n",
     400},
    {"a query twice", "GET /v1/jobs?limit=1&limit=2 HTTP/1.1\r\n" HOST CLOSE "\r\n", 400},
};

/* A reply's length is known, so what follows the first one on a connection would show. */
static int replies_in(const char *text) {
    int count = 0;
    for (const char *at = text; (at = strstr(at, "HTTP/1.1 ")) != NULL; at++)
        count++;
    return count;
}

static void check_bytes(struct rig *rig, const char *what, const char *text, size_t length, int wanted) {
    struct buf reply;
    int status = rig_ask(rig, text, length, &reply);
    CHECK_THAT(status == wanted && (wanted != CLOSED || reply.length == 0), "%s: %d, not %d: %s", what, status, wanted,
               rig_body(&reply));
    /* What the library refuses by itself, before it asks, is a page of its own: there is no hook. */
    bool is_ours = !strstr(buf_text(&reply), "<html>");
    if (is_ours)
        CHECK_THAT(replies_in(buf_text(&reply)) <= 1, "%s: more than one reply", what);
    if (wanted >= 400 && is_ours)
        CHECK_THAT(strstr(buf_text(&reply), "application/problem+json"), "%s: %s", what, buf_text(&reply));
    buf_release(&reply);
}

/* Heads and fields that are too large, and bytes that no text can hold. */
static void check_large(struct rig *rig, bool is_late) {
    char *text = mem_alloc(200000);
    int used = sprintf(text, "GET /healthz HTTP/1.1\r\n" HOST CLOSE "X-Large: ");
    memset(text + used, 'a', 100000);
    memcpy(text + used + 100000, "\r\n\r\n", 4);
    check_bytes(rig, "a field of 100 kB", text, (size_t)used + 100004, 431);
    used = sprintf(text, "GET /");
    memset(text + used, 'a', 100000);
    int end = sprintf(text + used + 100000, " HTTP/1.1\r\n" HOST CLOSE "\r\n");
    check_bytes(rig, "a target of 100 kB", text, (size_t)(used + 100000 + end), 414);
    /* Before 1.0 the library ends a value at a NUL, before anybody can see it: what matters is that there is
     * one reading of it, and that nothing behind it is taken for a request. */
    static const char nul_value[] = "GET /healthz HTTP/1.1\r\n" HOST CLOSE "X-A: a\0b\r\n\r\n";
    check_bytes(rig, "a NUL in a field", nul_value, sizeof nul_value - 1, is_late ? 400 : 200);
    static const char nul_length[] = "POST /v1/jobs/1/cancel HTTP/1.1\r\n" HOST CLOSE "Content-Length: 3\0"
                                     "0\r\n\r\nabc";
    check_bytes(rig, "a NUL in Content-Length", nul_length, sizeof nul_length - 1, is_late ? 400 : 404);
    mem_free(text);
}

int main(void) {
    struct rig rig;
    bool is_late = strncmp(listener_library_version(), "0.", 2) != 0;
    rig_start(&rig, &rig_patient, 15);
    CHECK(sizeof cases / sizeof *cases >= 60);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        check_bytes(&rig, cases[i].what, cases[i].text, strlen(cases[i].text),
                    is_late && cases[i].status >= OR_REFUSED ? 400 : cases[i].status % OR_REFUSED);
    check_large(&rig, is_late);
    struct buf reply;
    CHECK(rig_get(&rig, "/healthz", "X-Request-Id: my-id.1\r\n", &reply) == 200);
    CHECK(strstr(buf_text(&reply), "X-Request-Id: my-id.1\r\n"));
    buf_release(&reply);
    CHECK(rig_get(&rig, "/healthz", "X-Request-Id: a\"b\r\n", &reply) == 200);
    CHECK(!strstr(buf_text(&reply), "a\"b"));
    buf_release(&reply);
    rig_stop(&rig);
    return check_result();
}
