/* cgroup.h -- the control group that limits this process's memory (cgroups(7), versions 1 and 2). */
#ifndef UNBAKE_COMMON_CGROUP_H
#define UNBAKE_COMMON_CGROUP_H

#include <stdbool.h>

struct cgroup {
    bool is_v2;
    const char *mount; /* of the memory controller: "/sys/fs/cgroup"; static text */
    char *path;        /* of the group below the mount: "/a/b"; borrowed from the line */
};

/* Reads a line of /proc/self/cgroup, "0::/a/b" (version 2) or "4:memory:/a/b" (version 1); changes it. False where it
 * is about another controller. In a container the path may be the host's: then its group is the mount itself. */
bool cgroup_parse(char *line, struct cgroup *group);

#endif
