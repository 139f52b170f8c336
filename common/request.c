/* request.c -- see request.h. */
#include "common/request.h"

#include <curl/curl.h>
#include <math.h>
#include <poll.h>
#include <string.h>
#include <strings.h>
#include <sys/signalfd.h>
#include <unistd.h>

#include "common/clock.h"
#include "common/mem.h"
#include "common/protocol.h"

#define CONNECT_SEC 10L     /* to connect */
#define SILENCE_SEC 300.0   /* without traffic, unless the call says otherwise */
#define TICK_MS 200         /* between two calls of tick and go_on */
#define PAUSE_FIRST_SEC 0.1 /* between two tries; doubled each time */
#define PAUSE_MAX_SEC 5.0   /* up to this */
#define UNIX_PREFIX "unix:"

struct http_request {
    char *server;                        /* owned */
    char *socket;                        /* path of a unix socket; owned; NULL: none */
    const struct request_advice *advice; /* borrowed; NULL: none */
    char *authorization;                 /* the header; owned; NULL: none */
    char *ca_file;                       /* owned; NULL: the system's */
    double retry_sec;
    int signal_fd; /* borrowed; -1: none */
    bool interrupted;
    CURL *easy;
    CURLM *multi;
};

/* One try of a call, as curl's callbacks see it. */
struct request_try {
    struct http_request *request;
    const struct request_call *call;
    struct reply *reply;
    struct error *err;
    enum status read_status; /* error while pulling the body */
    bool stopped;            /* the sink ended the transfer */
    bool too_long;
};

struct http_request *request_new(const char *server_url, double retry_sec, int signal_fd) {
    struct http_request *r = mem_calloc(1, sizeof *r);
    size_t length = strlen(server_url);
    while (length > 0 && server_url[length - 1] == '/')
        length--;
    r->server = mem_strndup(server_url, length);
    if (strncmp(r->server, UNIX_PREFIX, strlen(UNIX_PREFIX)) == 0)
        r->socket = mem_strdup(r->server + strlen(UNIX_PREFIX));
    r->retry_sec = retry_sec;
    r->signal_fd = signal_fd;
    curl_global_init(CURL_GLOBAL_DEFAULT);
    r->easy = curl_easy_init();
    r->multi = curl_multi_init();
    return r;
}

void request_set_token(struct http_request *r, const char *token) {
    mem_free(r->authorization);
    r->authorization = token ? mem_printf("Authorization: Bearer %s", token) : NULL;
}

void request_set_ca(struct http_request *r, const char *path) {
    mem_free(r->ca_file);
    r->ca_file = mem_strdup(path);
}

void request_set_advice(struct http_request *r, const struct request_advice *advice) { r->advice = advice; }

void request_free(struct http_request *r) {
    if (!r)
        return;
    curl_easy_cleanup(r->easy);
    curl_multi_cleanup(r->multi);
    curl_global_cleanup();
    mem_free(r->server);
    mem_free(r->socket);
    mem_free(r->authorization);
    mem_free(r->ca_file);
    mem_free(r);
}

const char *request_server(const struct http_request *r) { return r->server; }

const char *request_library_version(void) { return curl_version_info(CURLVERSION_NOW)->version; }

/* --- interruption and pauses --------------------------------------------------------------- */

static bool wait_for_signal(struct http_request *r, int milliseconds) {
    struct pollfd wait = {.fd = r->signal_fd, .events = POLLIN};
    struct signalfd_siginfo info;
    if (!r->interrupted && poll(&wait, 1, milliseconds) == 1 &&
        read(r->signal_fd, &info, sizeof info) == (ssize_t)sizeof info)
        r->interrupted = true;
    return r->interrupted;
}

bool request_interrupted(struct http_request *r) { return wait_for_signal(r, 0); }

static double pause_length(int tries, double asked_sec) {
    double pause = fmin(PAUSE_FIRST_SEC * pow(2.0, tries), PAUSE_MAX_SEC);
    return asked_sec >= 0.0 ? fmin(fmax(asked_sec, PAUSE_FIRST_SEC), 60.0) : pause;
}

bool request_pause(struct http_request *r, int tries, double asked_sec) {
    return !wait_for_signal(r, (int)lround(1000.0 * pause_length(tries, asked_sec)));
}

static enum status cancelled(struct error *err) { return error_set(err, STATUS_CANCELLED, "interrupted"); }

static size_t on_header(char *bytes, size_t size, size_t count, void *user) {
    reply_take_header(((struct request_try *)user)->reply, bytes, size * count);
    return size * count;
}

static size_t on_body(char *bytes, size_t size, size_t count, void *user) {
    struct request_try *a = user;
    size_t length = size * count;
    if (a->call->sink && (a->reply->code == 200 || a->reply->code == 206)) {
        a->stopped = !a->call->sink(a->call->user, a->reply, bytes, length);
        return a->stopped ? 0 : length;
    }
    a->too_long = !buf_append(&a->reply->body, bytes, length);
    return a->too_long ? 0 : length;
}

static size_t on_read(char *bytes, size_t size, size_t count, void *user) {
    struct request_try *a = user;
    size_t got = 0;
    a->read_status = a->call->read(a->call->user, bytes, size * count, &got, a->err);
    return a->read_status == STATUS_OK ? got : CURL_READFUNC_ABORT;
}

/* --- one try ------------------------------------------------------------------------------- */

static bool is_loopback(const char *server) {
    const char *host = strstr(server, "://");
    host = host ? host + 3 : server;
    return strncmp(host, "127.", 4) == 0 || strncasecmp(host, "localhost", 9) == 0 || strncmp(host, "[::1]", 5) == 0;
}

bool request_is_loopback(const struct http_request *r) { return r->socket || is_loopback(r->server); }

/* Configures the handle; the returned list of headers and the texts must outlive the transfer. */
static struct curl_slist *set_up(struct request_try *a, const char *url, const char *body) {
    const struct request_call *call = a->call;
    CURL *easy = a->request->easy;
    curl_easy_reset(easy);
    curl_easy_setopt(easy, CURLOPT_URL, url);
    curl_easy_setopt(easy, CURLOPT_PROTOCOLS_STR, "http,https");
    curl_easy_setopt(easy, CURLOPT_USERAGENT, "unbake/" UNBAKE_VERSION);
    curl_easy_setopt(easy, CURLOPT_CONNECTTIMEOUT, CONNECT_SEC);
    curl_easy_setopt(easy, CURLOPT_LOW_SPEED_LIMIT, 1L);
    curl_easy_setopt(easy, CURLOPT_LOW_SPEED_TIME, lround(call->silence_sec > 0.0 ? call->silence_sec : SILENCE_SEC));
    curl_easy_setopt(easy, CURLOPT_HEADERFUNCTION, on_header);
    curl_easy_setopt(easy, CURLOPT_HEADERDATA, a);
    curl_easy_setopt(easy, CURLOPT_WRITEFUNCTION, on_body);
    curl_easy_setopt(easy, CURLOPT_WRITEDATA, a);
    if (request_is_loopback(a->request))
        curl_easy_setopt(easy, CURLOPT_PROXY, "");
    if (a->request->socket)
        curl_easy_setopt(easy, CURLOPT_UNIX_SOCKET_PATH, a->request->socket);
    if (a->request->ca_file)
        curl_easy_setopt(easy, CURLOPT_CAINFO, a->request->ca_file);
    struct curl_slist *headers = NULL;
    if (a->request->authorization)
        headers = curl_slist_append(headers, a->request->authorization);
    for (size_t i = 0; i < sizeof call->header / sizeof *call->header && call->header[i]; i++)
        headers = curl_slist_append(headers, call->header[i]);
    if (call->read) {
        curl_easy_setopt(easy, CURLOPT_POST, 1L);
        curl_easy_setopt(easy, CURLOPT_POSTFIELDSIZE_LARGE, (curl_off_t)call->read_length);
        curl_easy_setopt(easy, CURLOPT_READFUNCTION, on_read);
        curl_easy_setopt(easy, CURLOPT_READDATA, a);
        char type[128];
        snprintf(type, sizeof type, "Content-Type: %s",
                 call->content_type ? call->content_type : "application/octet-stream");
        headers = curl_slist_append(headers, type);
        headers = curl_slist_append(headers, "Expect: 100-continue");
    } else if (body || (call->method && strcmp(call->method, "POST") == 0)) {
        curl_easy_setopt(easy, CURLOPT_POSTFIELDS, body ? body : "");
        if (body)
            headers = curl_slist_append(headers, "Content-Type: " MIME_JSON);
        headers = curl_slist_append(headers, "Expect:");
    }
    if (call->method && strcmp(call->method, "HEAD") == 0)
        curl_easy_setopt(easy, CURLOPT_NOBODY, 1L);
    else if (call->method)
        curl_easy_setopt(easy, CURLOPT_CUSTOMREQUEST, call->method);
    curl_easy_setopt(easy, CURLOPT_HTTPHEADER, headers);
    return headers;
}

/* Runs the transfer to its end; false when interrupted. */
static bool drive(struct request_try *a, CURLcode *result) {
    struct http_request *r = a->request;
    int running = 1;
    *result = CURLE_FAILED_INIT;
    while (running) {
        struct curl_waitfd also = {.fd = r->signal_fd, .events = CURL_WAIT_POLLIN};
        if (curl_multi_perform(r->multi, &running) != CURLM_OK)
            return true;
        if (request_interrupted(r))
            return false;
        if (a->call->tick) {
            curl_off_t sent = 0;
            curl_easy_getinfo(r->easy, CURLINFO_SIZE_UPLOAD_T, &sent);
            a->call->tick(a->call->user, (double)sent);
        }
        if (a->call->go_on && !a->call->go_on(a->call->user))
            return false;
        if (running)
            curl_multi_poll(r->multi, &also, r->signal_fd >= 0 ? 1 : 0, TICK_MS, NULL);
    }
    int left;
    CURLMsg *message = curl_multi_info_read(r->multi, &left);
    if (message && message->msg == CURLMSG_DONE)
        *result = message->data.result;
    return true;
}

/* Sets the hint where there is one; returns `status`, which is that of the error. */
static enum status advise(enum status status, const char *hint, struct error *err) {
    if (hint)
        error_hint(err, "%s", hint);
    return status;
}

static enum status transport_failed(struct request_try *a, CURLcode code, const char *detail) {
    static const struct request_advice none = {0};
    const struct request_advice *advice = a->request->advice ? a->request->advice : &none;
    struct error *err = a->err;
    const char *why = *detail ? detail : curl_easy_strerror(code);
    long number = 0; /* errno: "Connection refused" says more than curl's text */
    if (code == CURLE_COULDNT_CONNECT && curl_easy_getinfo(a->request->easy, CURLINFO_OS_ERRNO, &number) == CURLE_OK &&
        number > 0)
        why = strerror((int)number);
    if (code == CURLE_URL_MALFORMAT || code == CURLE_UNSUPPORTED_PROTOCOL) {
        error_set(err, STATUS_INPUT, "%s is not the URL of a server: %s", a->request->server, why);
        return advise(STATUS_INPUT, advice->url, err);
    }
    error_set(err, STATUS_UNAVAILABLE, "cannot reach %s: %s", a->request->server, why);
    a->reply->is_untrusted = code == CURLE_PEER_FAILED_VERIFICATION || code == CURLE_SSL_CACERT_BADFILE;
    if (a->reply->is_untrusted)
        return advise(STATUS_UNAVAILABLE, advice->ca, err);
    if (code == CURLE_SSL_CONNECT_ERROR)
        return error_hint(err, "does it speak https, or should the URL begin with http://?");
    if (code == CURLE_GOT_NOTHING && strncmp(a->request->server, "http://", 7) == 0)
        return error_hint(err, "does it want https? Then the URL begins with https://");
    return advise(STATUS_UNAVAILABLE, advice->any, err);
}

/* One try. *unsent: the server cannot have received the request. */
static enum status transfer(struct request_try *a, const char *url, const char *body, bool *unsent) {
    struct http_request *r = a->request;
    char detail[CURL_ERROR_SIZE] = "";
    struct curl_slist *headers = set_up(a, url, body);
    curl_easy_setopt(r->easy, CURLOPT_ERRORBUFFER, detail);
    curl_multi_add_handle(r->multi, r->easy);
    CURLcode code;
    bool whole = drive(a, &code);
    curl_multi_remove_handle(r->multi, r->easy);
    curl_easy_setopt(r->easy, CURLOPT_ERRORBUFFER, NULL);
    curl_slist_free_all(headers);
    if (!whole)
        return cancelled(a->err);
    if (a->read_status != STATUS_OK)
        return a->read_status;
    if (a->too_long)
        return error_set(a->err, STATUS_LIMIT, "%s sent more than %zu bytes", url, REPLY_BODY_MAX);
    /* A server that refuses an upload early may close before everything is sent: its reply counts. */
    if (code == CURLE_OK || a->stopped || (code == CURLE_SEND_ERROR && a->reply->code >= 400))
        return STATUS_OK;
    *unsent = code == CURLE_COULDNT_CONNECT || code == CURLE_COULDNT_RESOLVE_HOST;
    return transport_failed(a, code, detail);
}

static enum status try_once(struct request_try *a, const char *url, const char *body, bool *unsent) {
    enum status status = STATUS_OK;
    *unsent = false;
    if (a->call->rewind)
        status = a->call->rewind(a->call->user, a->err);
    if (status == STATUS_OK)
        status = transfer(a, url, body, unsent);
    if (status != STATUS_OK)
        a->reply->code = 0; /* neither 100 Continue nor half a reply is a reply */
    return status;
}

enum status request_run(struct http_request *r, const struct request_call *call, struct reply *reply,
                        struct error *err) {
    char *url = mem_printf("%s%s", r->socket ? "http://localhost" : r->server, call->path);
    char *body = call->body ? json_text(call->body) : NULL;
    bool same_twice = call->same_twice || !call->method;
    double give_up_at = clock_sec() + r->retry_sec;
    enum status status;
    for (int tries = 0;; tries++) {
        bool unsent;
        reply_release(reply);
        reply_init(reply);
        struct request_try a = {.request = r, .call = call, .reply = reply, .err = err};
        status = try_once(&a, url, body, &unsent);
        if (status == STATUS_OK)
            status = reply_judge(reply, r->server, err);
        bool again = status == STATUS_UNAVAILABLE && !call->once && (same_twice || unsent || reply->code == 503);
        if (!again || clock_sec() + pause_length(tries, reply->retry_after_sec) > give_up_at)
            break;
        if (!request_pause(r, tries, reply->retry_after_sec)) {
            status = cancelled(err);
            break;
        }
    }
    mem_free(url);
    mem_free(body);
    return status;
}

enum status request_get(struct http_request *r, const char *path, struct reply *reply, struct error *err) {
    enum status status = request_run(r, &(struct request_call){.path = path}, reply, err);
    if (status != STATUS_OK || reply->json)
        return status;
    error_set(err, STATUS_UNAVAILABLE, "%s%s answered %ld without JSON", r->server, path, reply->code);
    return error_hint(err, "is that server unbaked?");
}
