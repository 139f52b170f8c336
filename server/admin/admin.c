/* admin.c -- see admin.h. */
#include "server/admin/admin.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"
#include "server/data/folder.h"
#include "server/data/layout.h"

#define LINE_MAX_BYTES ((size_t)1 << 20)
#define PATIENCE_SEC 5 /* for the daemon to take a request; a reply may take any time */

struct admin {
    const char *data_dir; /* borrowed */
    struct store *store;
    void (*revoked)(void *user);
    void *user;
    int listen_fd, stop_fd;
    pthread_t thread;
    bool is_bound, has_thread;
};

/* --- commands -------------------------------------------------------------------------------- */

static enum status token_add(struct store *store, const cJSON *request, cJSON *reply, struct error *err) {
    const char *name, *role_text;
    char token[TOKEN_SIZE];
    enum role role;
    int64_t id;
    enum status status = json_string(request, "name", "the request", "", &name, err);
    if (status == STATUS_OK)
        status = json_string(request, "role", "the request", "user", &role_text, err);
    if (status == STATUS_OK && !role_parse(role_text, &role))
        status = error_set(err, STATUS_INPUT, "there is no role \"%.80s\": viewer, user, admin", role_text);
    if (status == STATUS_OK)
        status = store_token_add(store, name, role, token, &id, err);
    if (status != STATUS_OK)
        return status;
    log_info("token %lld made for %s, role %s", (long long)id, name, role_name(role));
    json_add_int(reply, "id", id);
    json_add_string(reply, "token", token);
    return STATUS_OK;
}

static enum status token_list(struct store *store, cJSON *reply, struct error *err) {
    struct token_row *rows;
    size_t count;
    enum status status = store_token_list(store, &rows, &count, err);
    cJSON *items = cJSON_AddArrayToObject(reply, "items");
    for (size_t i = 0; status == STATUS_OK && i < count; i++) {
        cJSON *item = cJSON_CreateObject();
        json_add_int(item, "id", rows[i].id);
        json_add_string(item, "user", rows[i].name);
        json_add_string(item, "role", role_name(rows[i].role));
        json_add_int(item, "created_ms", rows[i].created_ms);
        cJSON_AddItemToArray(items, item);
    }
    mem_free(rows);
    return status;
}

static enum status token_revoke(struct store *store, const cJSON *request, cJSON *reply, struct error *err) {
    const char *which;
    size_t count;
    enum status status = json_string(request, "which", "the request", "", &which, err);
    if (status == STATUS_OK)
        status = store_token_revoke(store, which, &count, err);
    if (status != STATUS_OK)
        return status;
    log_info("%zu tokens of %s revoked", count, which);
    json_add_int(reply, "count", (int64_t)count);
    return STATUS_OK;
}

/* The copy is unlinked before its descriptor is handed over: nothing is left behind. */
static enum status backup(const char *data_dir, struct store *store, int *fd, struct error *err) {
    char *dir = layout_trash(data_dir), *path = layout_trash_file(data_dir, "backup-" LAYOUT_RANDOM);
    enum status status = file_make_dirs(dir, err);
    int made = status == STATUS_OK ? mkostemp(path, O_CLOEXEC) : -1;
    if (status == STATUS_OK && made < 0)
        status = error_set_errno(err, errno, "cannot make a file in %s", dir);
    if (status == STATUS_OK)
        status = store_backup(store, path, err);
    if (status == STATUS_OK) {
        *fd = open(path, O_RDONLY | O_CLOEXEC);
        if (*fd < 0)
            status = error_set_errno(err, errno, "cannot open %s", path);
    }
    if (made >= 0) {
        close(made);
        unlink(path);
    }
    mem_free(path);
    mem_free(dir);
    return status;
}

enum status admin_do(const char *data_dir, struct store *store, const cJSON *request, cJSON *reply, int *fd,
                     struct error *err) {
    const char *command;
    enum status status = json_string(request, "command", "the request", "", &command, err);
    if (status != STATUS_OK)
        return status;
    if (strcmp(command, "token-add") == 0)
        return token_add(store, request, reply, err);
    if (strcmp(command, "token-list") == 0)
        return token_list(store, reply, err);
    if (strcmp(command, "token-revoke") == 0)
        return token_revoke(store, request, reply, err);
    if (strcmp(command, "backup") == 0)
        return backup(data_dir, store, fd, err);
    return error_set(err, STATUS_INPUT, "the daemon knows no command \"%.80s\"", command);
}

/* --- the socket ---------------------------------------------------------------------------- */

/* Binds (or connects) fd to DIR/admin.sock, through the folder's descriptor: a socket's address has 108 bytes, and a
 * path may be longer. */
static int with_address(const char *dir, int fd, int (*call)(int, const struct sockaddr *, socklen_t)) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    int dir_fd = open(dir, O_PATH | O_DIRECTORY | O_CLOEXEC);
    if (dir_fd < 0)
        return -1;
    snprintf(address.sun_path, sizeof address.sun_path, "/proc/self/fd/%d/" LAYOUT_SOCKET, dir_fd);
    int result = call(fd, (struct sockaddr *)&address, sizeof address);
    int number = errno;
    close(dir_fd);
    errno = number;
    return result;
}

/* Writes a line, with a descriptor attached to its first byte (fd -1: none). */
static bool send_line(int to, const cJSON *value, int fd) {
    char *text = json_text(value), *line = mem_printf("%s\n", text);
    union {
        struct cmsghdr head;
        char bytes[CMSG_SPACE(sizeof(int))];
    } control = {0};
    struct iovec part = {.iov_base = line, .iov_len = strlen(line)};
    struct msghdr message = {.msg_iov = &part, .msg_iovlen = 1};
    mem_free(text);
    if (fd >= 0) {
        message.msg_control = control.bytes;
        message.msg_controllen = sizeof control.bytes;
        struct cmsghdr *head = CMSG_FIRSTHDR(&message);
        head->cmsg_level = SOL_SOCKET;
        head->cmsg_type = SCM_RIGHTS;
        head->cmsg_len = CMSG_LEN(sizeof fd);
        memcpy(CMSG_DATA(head), &fd, sizeof fd);
    }
    while (part.iov_len > 0) {
        ssize_t sent = sendmsg(to, &message, MSG_NOSIGNAL);
        if (sent < 0 && errno == EINTR)
            continue;
        if (sent <= 0)
            break;
        part.iov_base = (char *)part.iov_base + sent;
        part.iov_len -= (size_t)sent;
        message.msg_control = NULL;
        message.msg_controllen = 0;
    }
    mem_free(line);
    return part.iov_len == 0;
}

/* Reads a line and any descriptor that comes with it; false when there is no complete line. */
static bool receive_line(int from, struct buf *line, int *fd) {
    *fd = -1;
    while (line->length == 0 || line->data[line->length - 1] != '\n') {
        char chunk[4096];
        union {
            struct cmsghdr head;
            char bytes[CMSG_SPACE(sizeof(int))];
        } control;
        struct iovec part = {.iov_base = chunk, .iov_len = sizeof chunk};
        struct msghdr message = {
            .msg_iov = &part, .msg_iovlen = 1, .msg_control = control.bytes, .msg_controllen = sizeof control.bytes};
        ssize_t got = recvmsg(from, &message, MSG_CMSG_CLOEXEC);
        if (got < 0 && errno == EINTR)
            continue;
        struct cmsghdr *head = got > 0 ? CMSG_FIRSTHDR(&message) : NULL;
        if (head && head->cmsg_level == SOL_SOCKET && head->cmsg_type == SCM_RIGHTS && *fd < 0)
            memcpy(fd, CMSG_DATA(head), sizeof *fd);
        if (got <= 0 || !buf_append(line, chunk, (size_t)got))
            return false;
    }
    return true;
}

/* --- the daemon's side ---------------------------------------------------------------------- */

static void answer(struct admin *a, int client) {
    struct buf line;
    struct error err = {0};
    cJSON *request = NULL, *reply = cJSON_CreateObject();
    int came = -1, goes = -1;
    buf_init(&line, LINE_MAX_BYTES);
    if (receive_line(client, &line, &came)) {
        enum status status = json_parse(buf_text(&line), line.length, "the request", &request, &err);
        if (status == STATUS_OK)
            status = admin_do(a->data_dir, a->store, request, reply, &goes, &err);
        if (status == STATUS_OK && cJSON_HasObjectItem(request, "which"))
            a->revoked(a->user);
        if (status != STATUS_OK) {
            json_add_string(reply, "error", err.message);
            json_add_string(reply, "hint", err.hint);
            json_add_int(reply, "status", (int64_t)status);
        }
        send_line(client, reply, goes);
    }
    if (came >= 0)
        close(came);
    if (goes >= 0)
        close(goes);
    cJSON_Delete(request);
    cJSON_Delete(reply);
    buf_release(&line);
}

static bool may_ask(int client) {
    struct ucred peer;
    socklen_t size = sizeof peer;
    return getsockopt(client, SOL_SOCKET, SO_PEERCRED, &peer, &size) == 0 && (peer.uid == 0 || peer.uid == geteuid());
}

static void *serve(void *user) {
    struct admin *a = user;
    struct pollfd wait[2] = {{.fd = a->listen_fd, .events = POLLIN}, {.fd = a->stop_fd, .events = POLLIN}};
    for (;;) {
        if (poll(wait, 2, -1) < 0 && errno != EINTR)
            return NULL;
        if (wait[1].revents)
            return NULL;
        if (!wait[0].revents)
            continue;
        int client = accept4(a->listen_fd, NULL, NULL, SOCK_CLOEXEC);
        if (client < 0)
            continue;
        struct timeval patience = {.tv_sec = PATIENCE_SEC};
        setsockopt(client, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
        setsockopt(client, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience);
        if (may_ask(client))
            answer(a, client);
        close(client);
    }
}

enum status admin_start(struct admin **out, const char *data_dir, struct store *store, void (*revoked)(void *user),
                        void *user, struct error *err) {
    struct admin *a = mem_calloc(1, sizeof *a);
    *a = (struct admin){
        .data_dir = data_dir, .store = store, .revoked = revoked, .user = user, .stop_fd = eventfd(0, EFD_CLOEXEC)};
    if (a->stop_fd < 0) {
        enum status failed = error_set_errno(err, errno, "cannot make an eventfd");
        mem_free(a);
        return failed;
    }
    char *path = layout_socket(data_dir);
    enum status status = STATUS_OK;
    unlink(path); /* of an earlier run: this process holds the folder's lock */
    a->listen_fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    /* the file gets the mode of the unbound socket */
    a->is_bound =
        a->listen_fd >= 0 && fchmod(a->listen_fd, 0600) == 0 && with_address(data_dir, a->listen_fd, bind) == 0;
    if (!a->is_bound || listen(a->listen_fd, 16) != 0)
        status = error_set_errno(err, errno, "cannot listen on %s", path);
    else {
        int failed = pthread_create(&a->thread, NULL, serve, a);
        if (failed)
            status = error_set_errno(err, failed, "cannot start a thread");
        a->has_thread = failed == 0;
    }
    mem_free(path);
    if (status != STATUS_OK)
        admin_stop(a);
    else
        *out = a;
    return status;
}

void admin_stop(struct admin *a) {
    if (!a)
        return;
    if (a->has_thread) {
        eventfd_write(a->stop_fd, 1);
        pthread_join(a->thread, NULL);
    }
    if (a->is_bound) {
        char *path = layout_socket(a->data_dir);
        unlink(path);
        mem_free(path);
    }
    if (a->listen_fd >= 0)
        close(a->listen_fd);
    close(a->stop_fd);
    mem_free(a);
}

/* --- the command's side --------------------------------------------------------------------- */

static enum status ask_daemon(int socket_fd, const cJSON *request, cJSON **reply, int *fd, struct error *err) {
    struct buf line;
    const char *message = NULL, *hint = "";
    double number = STATUS_INTERNAL;
    buf_init(&line, LINE_MAX_BYTES);
    enum status status = STATUS_OK;
    if (!send_line(socket_fd, request, -1) || !receive_line(socket_fd, &line, fd))
        status = error_set(err, STATUS_UNAVAILABLE, "the daemon does not answer on its admin socket");
    else
        status = json_parse(buf_text(&line), line.length, "the daemon's reply", reply, err);
    if (status == STATUS_OK)
        status = json_string(*reply, "error", "the daemon's reply", NULL, &message, err);
    if (status == STATUS_OK && message) {
        json_string(*reply, "hint", "the daemon's reply", "", &hint, NULL);
        json_number(*reply, "status", "the daemon's reply", STATUS_INTERNAL, &number, NULL);
        status = number > 0 && number < (double)STATUS_COUNT ? (enum status)(int)number : STATUS_INTERNAL;
        error_set(err, status, "%s", message);
        error_hint(err, "%s", hint);
    }
    buf_release(&line);
    return status;
}

/* Root acts as the folder's owner; otherwise the daemon could not open the files made. */
static enum status become_owner(const char *dir, struct error *err) {
    struct stat info;
    if (geteuid() != 0)
        return STATUS_OK;
    if (stat(dir, &info) != 0) { /* the owner of a new folder is unknown */
        error_set_errno(err, errno, "cannot look at the data folder %s", dir);
        return error_hint(err, "start the daemon once, or make the folder for its user");
    }
    if (info.st_uid == 0)
        return STATUS_OK;
    if (setegid(info.st_gid) == 0 && seteuid(info.st_uid) == 0)
        return STATUS_OK;
    return error_set_errno(err, errno, "cannot act as the owner of %s", dir);
}

static enum status do_alone(const char *data_dir, const cJSON *request, cJSON **reply, int *fd, struct error *err) {
    struct store *store = NULL;
    int lock_fd = -1;
    enum status status = become_owner(data_dir, err);
    if (status == STATUS_OK)
        status = folder_lock(data_dir, &lock_fd, err);
    if (status == STATUS_CONFLICT)
        error_hint(err, "it does not listen on %s/admin.sock: it starts or stops just now; try again", data_dir);
    if (status == STATUS_OK)
        status = store_open(&store, data_dir, err);
    if (status == STATUS_OK) {
        *reply = cJSON_CreateObject();
        status = admin_do(data_dir, store, request, *reply, fd, err);
    }
    store_close(store);
    if (lock_fd >= 0)
        close(lock_fd);
    if (geteuid() != getuid() && (seteuid(getuid()) != 0 || setegid(getgid()) != 0) && status == STATUS_OK)
        status = error_set_errno(err, errno, "cannot return to one's own user");
    return status;
}

enum status admin_call(const char *data_dir, const cJSON *request, cJSON **reply, int *fd, struct error *err) {
    *reply = NULL;
    *fd = -1;
    int socket_fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (socket_fd < 0)
        return error_set_errno(err, errno, "cannot make a socket");
    enum status status;
    if (with_address(data_dir, socket_fd, connect) == 0)
        status = ask_daemon(socket_fd, request, reply, fd, err);
    else if (errno == EACCES || errno == EPERM) {
        error_set_errno(err, errno, "cannot reach the daemon of %s", data_dir);
        status = error_hint(err, "run this as the daemon's user or as root");
    } else
        status = do_alone(data_dir, request, reply, fd, err);
    close(socket_fd);
    if (status != STATUS_OK) {
        cJSON_Delete(*reply);
        *reply = NULL;
    }
    return status;
}
