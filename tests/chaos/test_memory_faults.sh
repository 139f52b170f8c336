#!/bin/bash
# There is no memory for the n-th allocation: see fault_daemon.c and fault_worker.c. Most end the
# process, which then has to be started again, so UNBAKE_STEP is larger than that of the disk (257, and of a
# worker that reconstructs every 600th stack of calls, of one that checks a scene every 86th, once or for good in turn; in
# the long form all, in both ways).
set -u
. tests/api/client.sh "$@"
if ldd "$build/unbaked" | grep -q 'lib[at]san'; then
    echo "a sanitizer has an allocator of its own"
    exit 77
fi
make_room "$work/room"
tar -C "$work/room" -cf "$work/room.tar" .
if [ -n "${UNBAKE_LONG:-}" ]; then step=1 all=1 worker=1; else step=257 all=0 worker=600; fi
"$build/tests/chaos/fault_daemon" "$build" "$work/room.tar" memory "${UNBAKE_STEP:-$step}" $all || fail "the daemon"
"$build/tests/chaos/fault_worker" "$build" "$work/room" "$work/room.tar" memory "${UNBAKE_STEP:-$worker}" $all || fail "a worker"
finish
