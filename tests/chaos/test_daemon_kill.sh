#!/bin/bash
# The daemon killed again and again under load: see daemon_kill.c. UNBAKE_KILLS sets how often
# (10; in the long form 2000).
set -u
. tests/api/client.sh "$@"
make_room "$work/room"
tar -C "$work/room" -cf "$work/room.tar" .
if [ -n "${UNBAKE_LONG:-}" ]; then kills=2000; else kills=50; fi
"$build/tests/chaos/daemon_kill" "$build" "$work/room.tar" "${UNBAKE_KILLS:-$kills}"
