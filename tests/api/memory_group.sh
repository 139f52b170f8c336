# memory_group.sh -- `memory_group BYTES PID`: puts a process into a new cgroup below its own that may have so much memory.
# Fails where that cannot be done. lib.sh removes the group at the end of the test.
# shellcheck shell=bash
memory_group() {
    local own
    own=$(sed -n 's/^[0-9]*:memory://p' "/proc/$2/cgroup")
    if [ -n "$own" ]; then # version 1
        group=/sys/fs/cgroup/memory${own%/}/unbake-test-$$
        mkdir "$group" 2>/dev/null && echo "$1" >"$group/memory.limit_in_bytes" && echo "$2" >"$group/cgroup.procs"
    else
        own=$(sed -n 's/^0:://p' "/proc/$2/cgroup")
        group=/sys/fs/cgroup${own%/}/unbake-test-$$
        mkdir "$group" 2>/dev/null && echo "$1" >"$group/memory.max" && echo 0 >"$group/memory.swap.max" && echo "$2" >"$group/cgroup.procs"
    fi 2>/dev/null
}
