/* sites.c -- see sites.h. */
#include "server/executor/sites.h"

#include <string.h>

#include "common/clock.h"
#include "common/file.h"
#include "common/mem.h"

#define PROCESS JOB_EXECUTOR_HERE

static double monotonic(void *user) {
    (void)user;
    return clock_sec();
}

static bool has(const struct sites *s, const char *name) {
    for (size_t i = 0; i < s->count; i++)
        if (strcmp(name, s->place[i].is_process ? PROCESS : s->place[i].site.name) == 0)
            return true;
    return false;
}

static void read_one(struct sites *s, const char *name, const char *dir, struct buf *problems) {
    struct error err;
    if (has(s, name)) {
        buf_printf(problems, "executors: %s is there twice\n", name);
        return;
    }
    s->place = mem_realloc_array(s->place, s->count + 1, sizeof *s->place);
    struct site_place *place = &s->place[s->count++];
    *place = (struct site_place){.is_process = strcmp(name, PROCESS) == 0};
    if (place->is_process)
        return;
    if (!site_name_is_good(name)) {
        buf_printf(problems, "executors: \"%s\" is no name: at most 31 lower-case letters, digits and -\n", name);
        s->count--;
        return;
    }
    char *file = mem_printf("%s.conf", name), *path = file_join(dir, file);
    if (site_read(&place->site, name, path, problems, &err) != STATUS_OK)
        buf_printf(problems, "executors: %s: %s\n", name, err.message);
    mem_free(path);
    mem_free(file);
}

void sites_read(struct sites *s, const char *names, const char *dir, struct buf *problems) {
    char *copy = mem_strdup(names), *rest = copy, *name;
    *s = (struct sites){0};
    while ((name = strsep(&rest, " \t,")) != NULL)
        if (*name)
            read_one(s, name, dir, problems);
    if (s->count == 0)
        buf_printf(problems, "executors: there must be one at least; process is this machine\n");
    mem_free(copy);
}

enum status sites_start(struct sites *s, const struct executor *process, struct store *store, const char *data_dir,
                        void (*wake)(void *user), void *user, struct error *err) {
    s->executor = mem_calloc(s->count + 1, sizeof *s->executor);
    for (size_t i = 0; i < s->count; i++) {
        struct site_place *place = &s->place[i];
        s->executor[i] = process;
        if (place->is_process)
            continue;
        place->commands = command_queue_new(place->site.deadline_sec, wake, user, err);
        if (!place->commands)
            return STATUS_IO;
        const struct remote_parts parts = {
            .site = &place->site, .store = store, .commands = place->commands, .data_dir = data_dir, .now = monotonic};
        place->remote = remote_new(&parts);
        s->executor[i] = remote_executor(place->remote);
    }
    return STATUS_OK;
}

void sites_release(struct sites *s) {
    for (size_t i = 0; i < s->count; i++) {
        if (s->place[i].is_process)
            continue;
        command_queue_free(s->place[i].commands);
        remote_free(s->place[i].remote);
        site_release(&s->place[i].site);
    }
    mem_free(s->place);
    mem_free(s->executor);
    *s = (struct sites){0};
}
