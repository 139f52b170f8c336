/* test_oom.c -- kills for want of memory, as both kinds of cgroup and the machine count them. */
#include "server/job/oom.h"

#include "common/file.h"
#include "common/mem.h"
#include "tests/check.h"

static char root[] = "/tmp/unbake-test-oom-XXXXXX";
static struct error err;

static void put(const char *folder, const char *name, const char *text) {
    char *dir = mem_printf("%s/%s", root, folder), *path = file_join(dir, name);
    CHECK_THAT(file_make_dirs(dir, &err) == STATUS_OK && file_replace(path, text, strlen(text), &err) == STATUS_OK,
               "%s", err.message);
    mem_free(path);
    mem_free(dir);
}

#define EVENTS(n) "low 0\nhigh 4\nmax 5\noom 6\noom_kill " n "\noom_group_kill 0\n"

int main(void) {
    CHECK(mkdtemp(root) != NULL);
    CHECK(oom_kills(root) == 0);
    put("proc", "vmstat", "nr_free_pages 7\noom_kill 3\n");
    CHECK(oom_kills(root) == 3);

    put("proc/self", "cgroup", "0::/system.slice/unbaked.service\n");
    CHECK(oom_kills(root) == 3); /* a group that does not count */
    put("sys/fs/cgroup/system.slice/unbaked.service", "memory.events", EVENTS("11"));
    CHECK(oom_kills(root) == 11);

    put("proc/self", "cgroup", "0::/docker/0123\n"); /* as the host sees it */
    CHECK(oom_kills(root) == 3);
    put("sys/fs/cgroup", "memory.events", EVENTS("12"));
    CHECK(oom_kills(root) == 12);
    put("proc/self", "cgroup", "0::/\n");
    CHECK(oom_kills(root) == 12);

    put("proc/self", "cgroup", "9:name=systemd:/x\n4:memory:/a/b\n1:cpu:/\n");
    CHECK(oom_kills(root) == 3);
    put("sys/fs/cgroup/memory/a/b", "memory.oom_control", "oom_kill_disable 0\nunder_oom 0\noom_kill 13\n");
    CHECK(oom_kills(root) == 13);

    put("proc/self", "cgroup", "nonsense\n:\n");
    CHECK(oom_kills(root) == 3);
    CHECK(file_remove_tree(root, &err) == STATUS_OK);
    return check_result();
}
