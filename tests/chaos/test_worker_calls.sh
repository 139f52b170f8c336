#!/bin/bash
# A worker's n-th call of the system fails: see worker_calls.c. UNBAKE_STEP sets for which n (every 131st; in the long
# form every one).
set -u
. tests/api/client.sh "$@"
make_room "$work/room"
tar -C "$work/room" -cf "$work/room.tar" .
if [ -n "${UNBAKE_LONG:-}" ]; then step=1; else step=131; fi
"$build/tests/chaos/worker_calls" "$build" "$work/room" "$work/room.tar" "${UNBAKE_STEP:-$step}" || fail "a worker"
finish
