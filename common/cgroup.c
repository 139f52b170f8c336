/* cgroup.c -- see cgroup.h. */
#include "common/cgroup.h"

#include <string.h>

bool cgroup_parse(char *line, struct cgroup *group) {
    line[strcspn(line, "\n")] = '\0';
    char *controllers = strchr(line, ':'), *path = controllers ? strchr(controllers + 1, ':') : NULL;
    if (!path)
        return false;
    *path++ = '\0';
    *group = (struct cgroup){.is_v2 = controllers[1] == '\0', .path = path};
    group->mount = group->is_v2 ? "/sys/fs/cgroup" : "/sys/fs/cgroup/memory";
    return group->is_v2 || strcmp(controllers + 1, "memory") == 0;
}
