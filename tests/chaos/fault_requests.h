/* fault_requests.h -- clients of a daemon whose disk or memory fails: each request does what it should or says why
 * not. */
#ifndef UNBAKE_TESTS_CHAOS_FAULT_REQUESTS_H
#define UNBAKE_TESTS_CHAOS_FAULT_REQUESTS_H

#include <dirent.h>

#include "tests/chaos/daemon.h"
#include "tests/chaos/faults.h"

#define THINGS_MAX 32

/* What was acknowledged in this round. */
struct thing {
    char path[120], state[16]; /* "": any */
    bool is_gone, is_unsure;
};

static struct daemon daemon_;
static struct faults *faults;
static struct thing thing[THINGS_MAX];
static size_t thing_count;
static char scene[65], round_[80];
static char kept_upload[80]; /* the path of the last */
static long strikes, requests, ends;
static bool is_memory; /* not the disk */

static inline bool has_struck(void) { return atomic_load(&faults->roles) && atomic_load(&faults->failed) > 0; }

static inline struct thing *note(const char *path, const char *state) {
    size_t i = 0;
    while (i < thing_count && strcmp(thing[i].path, path) != 0)
        i++;
    if (i == THINGS_MAX)
        exit(1);
    thing_count += i == thing_count;
    snprintf(thing[i].path, sizeof thing[i].path, "%s", path);
    snprintf(thing[i].state, sizeof thing[i].state, "%s", state);
    thing[i].is_gone = thing[i].is_unsure = false;
    return &thing[i];
}

/* True when it does what it should; else it must say what the disk did. */
static inline bool is_right(int wanted, int status, const char *method, const char *path, const struct buf *body) {
    bool is_full = atomic_load(&faults->error) == ENOSPC;
    requests++;
    if (status == wanted)
        return true;
    if (is_memory) {
        CHECK_THAT(has_struck() && (status == 0 || status == 500), "%s: %s %s gets %d, not %d: %s", round_, method,
                   path, status, wanted, buf_text(body));
        return false;
    }
    CHECK_THAT(has_struck() && status == (is_full ? 507 : 500), "%s: %s %s gets %d, not %d: %s", round_, method, path,
               status, wanted, buf_text(body));
    CHECK_THAT(!is_full || strcmp(method, "DELETE") != 0, "%s: %s cannot be removed from a full disk", round_, path);
    return false;
}

static inline bool ask(int wanted, const char *method, const char *path, const char *fields, const void *data,
                       size_t length, struct buf *body) {
    int status = http_ask(daemon_.port, method, path, fields, data, length, body);
    return is_right(wanted, status, method, path, body);
}

static inline bool ask_json(int wanted, const char *method, const char *path, const char *json, struct buf *body) {
    return ask(wanted, method, path, "Content-Type: application/json\r\nIf-Match: *\r\n", json, strlen(json), body);
}

/* A change of what is at the path. */
static inline bool change(const char *method, const char *path, const char *action, const char *json, int wanted,
                          const char *state) {
    struct buf body;
    char *full = mem_printf("%s%s", path, action);
    struct thing *it = note(path, state);
    bool done = ask_json(wanted, method, full, json, &body);
    it->is_unsure = !done;
    it->is_gone = done && wanted == 204;
    buf_release(&body);
    mem_free(full);
    return done;
}

/* --- requests ------------------------------------------------------------------------------------- */

static inline bool submit(const char *name, int iterations, char path[40]) {
    struct buf body;
    char *json = mem_printf(
        "{\"scene\":\"%s\",\"name\":\"%s\",\"settings\":{\"texture_size\":64,\"iterations\":%d,"
        "\"texels_per_iteration\":64,\"cameras_per_texel\":1,\"samples_per_camera\":2,"
        "\"gather_samples\":16,\"gloss_passes\":1,\"texels_per_metre\":2,\"report_samples\":1," CLOSED_ROOM "}}",
        scene, name, iterations);
    bool made = ask_json(201, "POST", "/v1/jobs", json, &body);
    if (made)
        snprintf(path, 40, "/v1/jobs/%lld", strtoll(buf_text(&body) + 6, NULL, 10));
    buf_release(&body);
    mem_free(json);
    return made;
}

static inline bool send_scene(long number, char path[120]) {
    struct buf body;
    char text[600] = "no archive";
    char id[65];
    memcpy(text + 100, &number, sizeof number);
    bool made = ask(201, "POST", "/v1/scenes", "", text, sizeof text, &body);
    if (made && sscanf(strstr(buf_text(&body), "\"id\":\"") + 6, "%64[0-9a-f]", id) == 1)
        snprintf(path, 120, "/v1/scenes/%s", id);
    buf_release(&body);
    return made;
}

#define TUS "Tus-Resumable: 1.0.0\r\n"

static inline bool upload_begin(char path[80]) {
    struct buf head, body;
    int status = http_exchange(daemon_.port, "POST", "/v1/uploads", TUS "Upload-Length: 600\r\n", "", 0, &head, &body);
    bool made = is_right(201, status, "POST", "/v1/uploads", &body);
    const char *location = strcasestr(buf_text(&head), "\r\nLocation: ");
    CHECK_THAT(!made || location, "%s: an upload that is made has no place", round_);
    made = made && location && sscanf(location + 12, "%79[^\r]", path) == 1;
    buf_release(&head);
    buf_release(&body);
    return made;
}

static inline void fill(unsigned char bytes[600], long number) {
    memset(bytes, 'x', 600);
    memcpy(bytes, "neither", 7);
    memcpy(bytes + 100, &number, sizeof number);
}

/* An upload in two parts, of which the second makes it a scene. */
static inline void upload(long number, bool is_removed) {
    struct buf body;
    unsigned char bytes[600];
    char path[80] = "";
    fill(bytes, number);
    *kept_upload = '\0';
    if (!upload_begin(path))
        return;
    strcpy(kept_upload, path);
    note(path, "");
    bool has_part = ask(204, "PATCH", path, TUS "Content-Type: application/offset+octet-stream\r\nUpload-Offset: 0\r\n",
                        bytes, 400, &body);
    buf_release(&body);
    if (has_part && !is_removed) {
        ask(204, "PATCH", path, TUS "Content-Type: application/offset+octet-stream\r\nUpload-Offset: 400\r\n",
            bytes + 400, 200, &body);
        buf_release(&body);
    }
    if (is_removed)
        change("DELETE", path, "", "", 204, "");
}

static inline void talk(long number) {
    struct buf body;
    char first[40], second[40], sent[120];
    bool has_first = submit("first", 3, first), has_second = submit("second", 3, second), has_scene;
    if (has_first) {
        note(first, "queued");
        change("PATCH", first, "", "{\"name\":\"renamed\",\"priority\":3}", 200, "queued");
        if (change("POST", first, "/pause", "{}", 202, "paused"))
            change("POST", first, "/resume", "{}", 202, "queued");
    }
    has_scene = send_scene(number, sent);
    if (has_scene)
        note(sent, "");
    upload(number, true);
    upload(number, false);
    if (has_second) {
        note(second, "queued");
        if (change("POST", second, "/cancel", "{}", 202, "cancelled"))
            change("POST", second, "/retry", "{}", 202, "queued");
    }
    http_get(daemon_.port, "/readyz", &body);
    buf_release(&body);
    ask(200, "GET", "/v1/jobs", "", "", 0, &body);
    buf_release(&body);
    if (has_second)
        change("DELETE", second, "", "", 204, "");
}

#endif
