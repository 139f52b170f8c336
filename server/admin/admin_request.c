/* admin_request.c -- see admin_request.h. */
#include "server/admin/admin_request.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/file.h"
#include "common/log.h"
#include "common/mem.h"
#include "server/data/layout.h"

/* The first token makes an admin unless a role is asked for: from then on nobody administers without one. */
static enum status token_add(struct store *store, const cJSON *request, cJSON *reply, struct error *err) {
    const char *name, *role_text;
    char token[TOKEN_SIZE];
    enum role role;
    int64_t id;
    double expires_ms = 0.0;
    bool is_administered;
    const char *role_default = role_name(store_has_users(store) ? ROLE_USER : ROLE_ADMIN);
    enum status status = json_string(request, "name", "the request", "", &name, err);
    if (status == STATUS_OK)
        status = json_string(request, "role", "the request", role_default, &role_text, err);
    if (status == STATUS_OK && !role_parse(role_text, &role))
        status = error_set(err, STATUS_INPUT, "there is no role \"%.80s\": viewer, user, admin", role_text);
    if (status == STATUS_OK)
        status = json_number(request, "expires_ms", "the request", 0.0, &expires_ms, err);
    if (status == STATUS_OK) /* before the token, whose secret is lost where anything fails after it */
        status = store_has_admin(store, &is_administered, err);
    if (status == STATUS_OK)
        status = store_token_add(store, name, role, (int64_t)expires_ms, token, &id, err);
    if (status != STATUS_OK)
        return status;
    log_info("token %lld made for %s, role %s", (long long)id, name, role_name(role));
    json_add_int(reply, "id", id);
    json_add_string(reply, "token", token);
    json_add_string(reply, "role", role_name(role));
    json_add_bool(reply, "has_admin", is_administered || role == ROLE_ADMIN);
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
        json_add_int(item, "expires_ms", rows[i].expires_ms);
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

static enum status usage(struct store *store, cJSON *reply, struct error *err) {
    struct usage_row *rows;
    size_t count;
    enum status status = store_usage_list(store, &rows, &count, err);
    cJSON *items = cJSON_AddArrayToObject(reply, "items");
    for (size_t i = 0; i < count; i++) {
        cJSON *item = cJSON_CreateObject();
        json_add_string(item, "user", rows[i].user);
        json_add_string(item, "month", rows[i].month);
        json_add_number(item, "cpu_sec", rows[i].cpu_sec);
        cJSON_AddItemToArray(items, item);
    }
    store_usage_release(rows, count);
    return status;
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

enum status admin_request_do(const char *data_dir, struct store *store, const cJSON *request, cJSON *reply, int *fd,
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
    if (strcmp(command, "usage") == 0)
        return usage(store, reply, err);
    if (strcmp(command, "backup") == 0)
        return backup(data_dir, store, fd, err);
    return error_set(err, STATUS_INPUT, "the daemon knows no command \"%.80s\"", command);
}
