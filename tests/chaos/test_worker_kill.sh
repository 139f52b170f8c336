#!/bin/bash
# Workers killed in the middle of an iteration and of a checkpoint: see worker_kill.c. UNBAKE_KILLS
# sets how often (20; in the long form 500).
set -u
. tests/api/client.sh "$@"
make_room "$work/room"
if [ -n "${UNBAKE_LONG:-}" ]; then kills=500; else kills=20; fi
"$build/tests/chaos/worker_kill" "$build" "$work/room" "${UNBAKE_KILLS:-$kills}"
