/* admin.c -- see admin.h. */
#include "server/admin/admin.h"

#include <errno.h>
#include <poll.h>
#include <pthread.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <unistd.h>

#include "common/file.h"
#include "common/mem.h"
#include "server/admin/admin_request.h"
#include "server/admin/admin_wire.h"
#include "server/data/folder.h"
#include "server/data/layout.h"

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

/* --- the daemon's side ---------------------------------------------------------------------- */

static void answer(struct admin *a, int client) {
    struct buf line;
    struct error err = {0};
    cJSON *request = NULL, *reply = cJSON_CreateObject();
    int came = -1, goes = -1;
    buf_init(&line, ADMIN_WIRE_LINE_MAX);
    if (admin_wire_receive(client, &line, &came)) {
        enum status status = json_parse(buf_text(&line), line.length, "the request", &request, &err);
        if (status == STATUS_OK)
            status = admin_request_do(a->data_dir, a->store, request, reply, &goes, &err);
        if (status == STATUS_OK && cJSON_HasObjectItem(request, "which"))
            a->revoked(a->user);
        if (status != STATUS_OK) {
            json_add_string(reply, "error", err.message);
            json_add_string(reply, "hint", err.hint);
            json_add_int(reply, "status", (int64_t)status);
        }
        admin_wire_send(client, reply, goes);
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
        a->listen_fd >= 0 && fchmod(a->listen_fd, 0600) == 0 && admin_wire_address(data_dir, a->listen_fd, bind) == 0;
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
    enum status status = STATUS_OK;
    buf_init(&line, ADMIN_WIRE_LINE_MAX);
    if (!admin_wire_send(socket_fd, request, -1) || !admin_wire_receive(socket_fd, &line, fd))
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

/* Whether it is a daemon's data folder. A token may be made before the daemon's first start; all else asks for what a
 * daemon has left, and must not make an empty database where the folder is the wrong one. */
static enum status check_folder(const char *dir, const cJSON *request, struct stat *info, struct error *err) {
    const char *command = cJSON_GetStringValue(cJSON_GetObjectItem(request, "command"));
    if (stat(dir, info) != 0) { /* whose a new folder would be is unknown */
        error_set_errno(err, errno, "cannot access the data folder %s", dir);
        return error_hint(err,
                          "--data DIR or --config FILE names the daemon's; or start the daemon once, or make the folder"
                          " for its user");
    }
    bool is_first = command && strcmp(command, "token-add") == 0;
    if (is_first || file_is_in(dir, LAYOUT_STATE))
        return STATUS_OK;
    error_set(err, STATUS_NOT_FOUND, "%s is not a data folder: it has no " LAYOUT_STATE, dir);
    return error_hint(err, "--data DIR or --config FILE names the daemon's");
}

/* Root acts as the folder's owner; otherwise the daemon could not open the files made. */
static enum status become_owner(const char *dir, const cJSON *request, struct error *err) {
    struct stat info;
    enum status status = check_folder(dir, request, &info, err);
    if (status != STATUS_OK || geteuid() != 0 || info.st_uid == 0)
        return status;
    if (setegid(info.st_gid) == 0 && seteuid(info.st_uid) == 0)
        return STATUS_OK;
    return error_set_errno(err, errno, "cannot act as the owner of %s", dir);
}

static enum status do_alone(const char *data_dir, const cJSON *request, cJSON **reply, int *fd, struct error *err) {
    struct store *store = NULL;
    int lock_fd = -1;
    enum status status = become_owner(data_dir, request, err);
    if (status == STATUS_OK)
        status = folder_lock(data_dir, &lock_fd, err);
    if (status == STATUS_CONFLICT)
        error_hint(err, "it does not listen on %s/admin.sock: it starts or stops just now; try again", data_dir);
    if (status == STATUS_OK)
        status = store_open(&store, data_dir, err);
    if (status == STATUS_OK) {
        *reply = cJSON_CreateObject();
        status = admin_request_do(data_dir, store, request, *reply, fd, err);
        json_add_bool(*reply, "daemon_runs", false);
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
    if (admin_wire_address(data_dir, socket_fd, connect) == 0)
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
