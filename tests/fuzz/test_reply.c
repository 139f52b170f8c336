/* test_reply.c -- what a server may answer to the client's commands.
 *
 *   input:  one byte that chooses the command, one that chooses the status,
 *           then the bodies of the replies, one after the other, 0x1e between them; the last is
 *           repeated, and after REPLIES_MAX there are none
 *
 * The server is a thread that answers whatever is asked; what the command prints is thrown away. */
#include <arpa/inet.h>
#include <fcntl.h>
#include <ftw.h>
#include <netinet/in.h>
#include <pthread.h>
#include <sys/socket.h>
#include <unistd.h>

#include "client/commands.h"
#include "common/file.h"
#include "common/mem.h"
#include "tests/fuzz/fuzz.h"

#define REPLIES_MAX 8
#define SEPARATOR '\x1e'

static char *const words[][6] = {
    {"list"},
    {"list", "--limit", "0"},
    {"list", "--json"},
    {"show", "1"},
    {"show", "last"},
    {"logs", "1"},
    {"get", "1", "-o", "OUT"},
    {"cancel", "1"},
    {"pause", "1"},
    {"retry", "1"},
    {"rm", "1", "--dry-run"},
    {"extend", "1", "--time", "60"},
    {"edit", "1", "--name", "x"},
    {"scenes"},
    {"scenes", "show", "00112233"},
    {"scenes", "rm", "00112233"},
    {"scenes", "keep", "00112233", "--pin"},
    {"uploads"},
    {"uploads", "rm", "00"},
    {"collect"},
    {"settings"},
    {"version"},
    {"submit", "--scene", "00112233"},
    {"cancel", "1", "--json"},
    {"show", "1", "--json"},
};

static const long codes[] = {200, 200, 200, 200, 201, 202, 204, 206, 301, 400,
                             401, 404, 409, 412, 413, 422, 429, 500, 507};

/* --- the server ------------------------------------------------------------------------------ */

static struct {
    int listen_fd;
    pthread_mutex_t mutex;
    const uint8_t *at, *end; /* what is left of the input */
    long code;
    int count; /* of replies to this input */
} server = {.mutex = PTHREAD_MUTEX_INITIALIZER};

/* The next reply, the caller's. */
static char *next_reply(size_t *length) {
    pthread_mutex_lock(&server.mutex);
    size_t left = (size_t)(server.end - server.at);
    const uint8_t *mark = left ? memchr(server.at, SEPARATOR, left) : NULL;
    size_t size = server.count >= REPLIES_MAX ? 0 : mark ? (size_t)(mark - server.at) : left;
    long code = server.count++ >= REPLIES_MAX ? 404 : server.code;
    bool has_body = code != 204;
    char *head =
        mem_printf("HTTP/1.1 %ld X\r\nContent-Type: %s\r\nContent-Length: %zu\r\n\r\n", code,
                   size > 0 && (server.at[0] == '{' || server.at[0] == '[') ? "application/json" : "text/plain",
                   has_body ? size : 0);
    *length = strlen(head) + (has_body ? size : 0);
    char *reply = mem_alloc(*length + 1);
    memcpy(reply, head, strlen(head));
    if (has_body && size)
        memcpy(reply + strlen(head), server.at, size);
    if (mark)
        server.at = mark + 1;
    pthread_mutex_unlock(&server.mutex);
    mem_free(head);
    return reply;
}

/* Reads a request with its body. */
static bool take_request(int fd) {
    struct buf text;
    char chunk[4096];
    bool is_whole = false;
    buf_init(&text, 1 << 20);
    while (!is_whole) {
        ssize_t got = recv(fd, chunk, sizeof chunk, 0);
        if (got <= 0 || !buf_append(&text, chunk, (size_t)got))
            break;
        const char *gap = strstr(buf_text(&text), "\r\n\r\n"),
                   *length = strcasestr(buf_text(&text), "\r\nContent-Length: ");
        size_t body = gap && length && length < gap ? strtoul(length + 18, NULL, 10) : 0;
        is_whole = gap && text.length >= (size_t)(gap + 4 - text.data) + body;
    }
    buf_release(&text);
    return is_whole;
}

static void *serve(void *user) {
    (void)user;
    for (;;) {
        int fd = accept4(server.listen_fd, NULL, NULL, SOCK_CLOEXEC);
        while (fd >= 0 && take_request(fd)) {
            size_t length;
            char *reply = next_reply(&length);
            bool is_sent = send(fd, reply, length, MSG_NOSIGNAL) == (ssize_t)length;
            mem_free(reply);
            if (!is_sent)
                break;
        }
        if (fd >= 0)
            close(fd);
    }
    return NULL;
}

/* --- the client ------------------------------------------------------------------------------ */

/* archive_version_details, for `unbake version`, forgets what it returned when it is called again. */
const char *__lsan_default_suppressions(void);
const char *__lsan_default_suppressions(void) { return "leak:libarchive.so"; }

static struct client client;
static char *folder;

static void start(void) {
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof address;
    pthread_t thread;
    server.listen_fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    MUST(bind(server.listen_fd, (struct sockaddr *)&address, size) == 0 && listen(server.listen_fd, 8) == 0);
    MUST(getsockname(server.listen_fd, (struct sockaddr *)&address, &size) == 0);
    MUST(pthread_create(&thread, NULL, serve, NULL) == 0);
    char *url = mem_printf("http://127.0.0.1:%d", ntohs(address.sin_port));
    client.request = request_new(url, 0.0, -1);
    mem_free(url);
    folder = file_join(fuzz_folder(), "out");
    MUST(freopen("/dev/null", "w", stdout));
    terminal_init(&client.out, stdout);
    terminal_init(&client.err, stderr);
}

static int remove_one(const char *path, const struct stat *facts, int kind, struct FTW *place) {
    (void)facts, (void)kind;
    return place->level > 0 ? remove(path) : 0;
}

static void run(char *const *line) {
    const struct command *command = command_find(line[0]);
    struct options o;
    struct error err;
    char *given[6] = {0};
    int count = 0;
    for (; line[count + 1]; count++)
        given[count] = strcmp(line[count + 1], "OUT") == 0 ? folder : line[count + 1];
    MUST(command && options_parse(&o, count, given, command->options, command_shared_options, &err) == STATUS_OK);
    client.json = options_flag(&o, "json");
    client.retry_sec = 0.0;
    int code = command->run(&client, &o);
    MUST(code >= 0 && code <= CLIENT_INTERRUPTED);
    options_release(&o);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    if (size < 2)
        return 0;
    if (!folder)
        start();
    pthread_mutex_lock(&server.mutex);
    server.at = data + 2;
    server.end = data + size;
    server.code = codes[data[1] % (sizeof codes / sizeof *codes)];
    server.count = 0;
    pthread_mutex_unlock(&server.mutex);
    fflush(stderr);
    int kept = dup(STDERR_FILENO), quiet = open("/dev/null", O_WRONLY | O_CLOEXEC);
    dup2(quiet, STDERR_FILENO);
    run(words[data[0] % (sizeof words / sizeof *words)]);
    fflush(stderr);
    dup2(kept, STDERR_FILENO);
    close(kept);
    close(quiet);
    nftw(folder, remove_one, 16, FTW_DEPTH | FTW_PHYS);
    return 0;
}

/* --- seeds ----------------------------------------------------------------------------------- */

#define JOB                                                                                                              \
    "{\"id\":1,\"revision\":3,\"scene\":\"00112233\",\"name\":\"x\",\"state\":\"running\",\"stage\":\"refine\","         \
    "\"progress\":0.5,\"eta_sec\":12.5,\"attempt\":1,\"priority\":0,\"labels\":{\"a\":\"b\"},\"settings\":{\"seed\":7}," \
    "\"created_at\":\"2024-05-06T07:08:09.123Z\",\"expires_at\":\"2030-01-01T00:00:00Z\",\"pinned\":false,"              \
    "\"reason\":\"\",\"hint\":\"\"}"
#define SCENE                                                                                                          \
    "{\"id\":\"00112233445566778899aabbccddeeff\",\"name\":\"room\",\"state\":\"rejected\",\"bytes\":1000,"            \
    "\"problems\":[{\"file\":\"a.png\",\"reason\":\"is damaged\",\"hint\":\"\"}],\"facts\":{\"frame_count\":3},"       \
    "\"created_at\":\"2024-05-06T07:08:09Z\"}"
#define OUTPUTS                                                                                                        \
    "{\"items\":[{\"name\":\"preview/a.png\",\"bytes\":3,\"content_type\":\"image/png\",\"sha256\":"                   \
    "\"ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad\"}]}"
#define PROBLEM                                                                                                        \
    "{\"type\":\"urn:unbake:invalid\",\"title\":\"t\",\"status\":422,\"detail\":\"d\",\"hint\":\"h\","                 \
    "\"invalid_params\":[{\"name\":\"seed\",\"reason\":\"is no number\",\"hint\":\"x\"}]}"

void fuzz_seeds(struct seeds *s) {
    static const char *const bodies[] = {
        "{\"items\":[" JOB "],\"next\":\"17\"}\x1e{\"items\":[" JOB "]}",
        JOB "\x1e" OUTPUTS,
        "{\"items\":[" JOB "]}\x1e" JOB "\x1e" OUTPUTS,
        OUTPUTS "\x1e"
                "abc\x1e" JOB,
        "{\"items\":[" SCENE "]}",
        SCENE,
        PROBLEM,
        "{\"items\":[{\"id\":\"00\",\"name\":\"r\",\"length\":100,\"offset\":10,\"expires_at\":\"2030-01-01T00:00:00Z\"}]}",
        "{\"dry_run\":true,\"bytes\":1000,\"files\":3,\"items\":[{\"kind\":\"job\",\"id\":\"1\",\"bytes\":10}]}",
        "[{\"name\":\"seed\",\"type\":\"int\",\"unit\":\"\",\"minimum\":0,\"maximum\":9,\"default\":\"7\",\"help\":\"h\"}]",
        "{\"settings\":[{\"name\":\"seed\",\"type\":\"int\",\"unit\":\"s\",\"minimum\":0,\"default\":7,\"help\":\"h\"}]}",
        "{\"version\":\"1\",\"libraries\":[{\"name\":\"SQLite\",\"version\":\"3\"}]}",
        "event: log\ndata: {\"level\":\"warning\",\"message\":\"m\",\"at\":\"2024\"}\nid: 3\n\n\x1e" JOB,
    };
    char text[4096];
    s->mutants = 1000;
    for (size_t w = 0; w < sizeof words / sizeof *words; w++) {
        for (size_t b = 0; b < sizeof bodies / sizeof *bodies; b++) {
            int length = snprintf(text, sizeof text, "%c%c%s", (int)w, strstr(bodies[b], "urn:") ? 15 : 0, bodies[b]);
            seeds_add(s, text, (size_t)length);
        }
    }
}
