/* machine.c -- see machine.h. */
#include "common/cgroup.h"
#include "common/machine.h"

#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "common/mem.h"

static uint64_t lesser(uint64_t a, uint64_t b) { return a < b ? a : b; }

/* The line "MemAvailable: N kB". */
static uint64_t available(const char *root) {
    char line[128];
    unsigned long long kib = 0;
    char *path = mem_printf("%s/proc/meminfo", root);
    FILE *file = fopen(path, "re");
    mem_free(path);
    while (file && kib == 0 && fgets(line, sizeof line, file))
        if (sscanf(line, "MemAvailable: %llu kB", &kib) != 1)
            kib = 0;
    if (file)
        fclose(file);
    return (uint64_t)kib * 1024;
}

/* The number in a file of a group; UINT64_MAX where there is none ("max" is no limit). */
static uint64_t read_limit(const char *root, const char *mount, const char *group, const char *name) {
    unsigned long long bytes;
    char *path = mem_printf("%s%s%s/%s", root, mount, group, name);
    FILE *file = fopen(path, "re");
    bool found = file && fscanf(file, "%llu", &bytes) == 1;
    mem_free(path);
    if (file)
        fclose(file);
    return found ? (uint64_t)bytes : UINT64_MAX;
}

/* The least limit of the group that a line of /proc/self/cgroup names and those around it. The mount itself is last: in
 * a container it is the container's own group. */
static uint64_t group_limit(const char *root, char *line) {
    uint64_t least = UINT64_MAX;
    struct cgroup group;
    if (!cgroup_parse(line, &group))
        return least;
    for (char *path = group.path;;) {
        char *end = strrchr(path, '/');
        if (end && end[1] == '\0')
            *end = '\0';
        least =
            lesser(least, read_limit(root, group.mount, path, group.is_v2 ? "memory.max" : "memory.limit_in_bytes"));
        end = strrchr(path, '/');
        if (!end)
            return least;
        *end = '\0';
    }
}

uint64_t machine_memory_available(const char *root) {
    char line[4096];
    uint64_t bytes = available(root);
    char *path = mem_printf("%s/proc/self/cgroup", root);
    FILE *file = fopen(path, "re");
    mem_free(path);
    while (file && fgets(line, sizeof line, file))
        bytes = lesser(bytes, group_limit(root, line));
    if (file)
        fclose(file);
    return bytes;
}
