/* machine.h: the least of what the kernel has and what the groups allow, of both versions. */
#include "common/machine.h"

#include "common/file.h"
#include "common/mem.h"
#include "tests/check.h"

#define MIB ((uint64_t)1 << 20)

static char root[] = "/tmp/unbake-machine-XXXXXX";
static struct error err;

static void put(const char *name, const char *text) {
    char *path = mem_printf("%s/%s", root, name), *folder = mem_strdup(path);
    *strrchr(folder, '/') = '\0';
    CHECK(file_make_dirs(folder, &err) == STATUS_OK);
    CHECK(file_replace(path, text, strlen(text), &err) == STATUS_OK);
    mem_free(folder);
    mem_free(path);
}

static uint64_t mib(void) { return machine_memory_available(root) / MIB; }

int main(void) {
    if (!mkdtemp(root))
        return 1;
    CHECK(mib() == 0);
    put("proc/meminfo", "MemTotal:       16777216 kB\nMemFree:  1024 kB\nMemAvailable:    8388608 kB\n");
    CHECK(mib() == 8192);
    put("proc/self/cgroup", "0::/system.slice/unbaked.service\n");
    CHECK(mib() == 8192);
    put("sys/fs/cgroup/system.slice/unbaked.service/memory.max", "max\n");
    CHECK(mib() == 8192);
    put("sys/fs/cgroup/system.slice/memory.max", "4294967296\n"); /* of a group around it */
    CHECK(mib() == 4096);
    put("sys/fs/cgroup/system.slice/unbaked.service/memory.max", "2147483648\n");
    CHECK(mib() == 2048);
    put("proc/self/cgroup", "7:cpu:/other\n4:memory:/docker/12ab\n"); /* a container sees its own group as the mount */
    CHECK(mib() == 8192);
    put("sys/fs/cgroup/memory/memory.limit_in_bytes", "1073741824\n");
    CHECK(mib() == 1024);
    put("proc/self/cgroup", "0::/\n");
    put("sys/fs/cgroup/memory.max", "536870912\n");
    CHECK(mib() == 512);
    put("proc/self/cgroup", "not a group\n");
    CHECK(mib() == 8192);
    CHECK(file_remove_tree(root, &err) == STATUS_OK);
    CHECK(machine_memory_available("") > 0);
    return check_result();
}
