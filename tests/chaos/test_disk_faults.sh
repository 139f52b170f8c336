#!/bin/bash
# The disk is full, or broken, at the n-th operation on a file: see fault_daemon.c and fault_worker.c.
# UNBAKE_STEP sets for which n (every 19th, and every 84th of the many of a worker, in one of four ways
# each; a third of these under a sanitizer; in the long form every one in all four).
set -u
. tests/api/client.sh "$@"
make_room "$work/room"
tar -C "$work/room" -cf "$work/room.tar" .
if [ -n "${UNBAKE_LONG:-}" ]; then step=1 all=1 worker=1; else step=19 all=0 worker=84; fi
if [ $all = 0 ] && ldd "$build/unbaked" | grep -q 'lib[at]san'; then step=57 worker=252; fi
"$build/tests/chaos/fault_daemon" "$build" "$work/room.tar" disk "${UNBAKE_STEP:-$step}" $all || fail "the daemon"
"$build/tests/chaos/fault_worker" "$build" "$work/room" "$work/room.tar" disk "${UNBAKE_STEP:-$worker}" $all || fail "a worker"
finish
