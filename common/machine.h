/* machine.h -- what this process may use of the machine. */
#ifndef UNBAKE_COMMON_MACHINE_H
#define UNBAKE_COMMON_MACHINE_H

#include <stdint.h>

/* Bytes of memory that could be had now: what the kernel calls available, or the limit of this process's cgroup or of a
 * group around it where that is less. 0 where the system does not tell. `root` is before all paths: "" but in tests. */
uint64_t machine_memory_available(const char *root);

#endif
