/* oom.c -- see oom.h. A service may not see /proc/vmstat (ProcSubset=pid in its systemd unit) but sees its own
 * cgroup; and kills elsewhere on the machine are irrelevant to its workers. Both cgroup versions count kills, for the
 * group's own limit and for the machine's, before the process gets its signal. */
#include "server/job/oom.h"

#include <stdbool.h>
#include <stdio.h>

#include "common/cgroup.h"
#include "common/mem.h"

/* The number on the line "oom_kill N". */
static bool read_count(const char *root, const char *folder, const char *name, uint64_t *count) {
    char line[128];
    unsigned long long number;
    bool found = false;
    char *path = mem_printf("%s%s/%s", root, folder, name);
    FILE *file = fopen(path, "re");
    mem_free(path);
    while (file && !found && fgets(line, sizeof line, file))
        found = sscanf(line, "oom_kill %llu", &number) == 1;
    if (file)
        fclose(file);
    if (found)
        *count = number;
    return found;
}

/* Of the group that a line of /proc/self/cgroup names. */
static bool read_group(const char *root, char *line, uint64_t *count) {
    struct cgroup group;
    if (!cgroup_parse(line, &group))
        return false;
    const char *name = group.is_v2 ? "memory.events" : "memory.oom_control";
    char *folder = mem_printf("%s%s", group.mount, group.path);
    bool found = read_count(root, folder, name, count) || read_count(root, group.mount, name, count);
    mem_free(folder);
    return found;
}

uint64_t oom_kills(const char *root) {
    char line[4096];
    uint64_t count = 0;
    bool found = false;
    char *path = mem_printf("%s/proc/self/cgroup", root);
    FILE *file = fopen(path, "re");
    mem_free(path);
    while (file && !found && fgets(line, sizeof line, file))
        found = read_group(root, line, &count);
    if (file)
        fclose(file);
    if (!found)
        read_count(root, "/proc", "vmstat", &count);
    return count;
}
