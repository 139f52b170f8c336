/* oom.h -- how many processes the kernel has killed because memory ran out. */
#ifndef UNBAKE_JOB_OOM_H
#define UNBAKE_JOB_OOM_H

#include <stdint.h>

/* Kills so far: in this process's cgroup where it counts them (workers belong to it), else on the machine; 0 where
 * neither can be read. `root` is put before all paths: "" except in tests. */
uint64_t oom_kills(const char *root);

#endif
