/* oom.h -- whether the kernel has killed for want of memory. */
#ifndef UNBAKE_JOB_OOM_H
#define UNBAKE_JOB_OOM_H

#include <stdint.h>

/* How many processes the kernel has killed so far: of this process's cgroup where it keeps count (workers are in it,
 * too), else of the machine; 0 where neither can be read. `root` is before all paths: "" but in tests. */
uint64_t oom_kills(const char *root);

#endif
