#!/bin/bash
# The power fails: see power_cut.c. UNBAKE_CUTS sets at how many moments (200, each in one of three
# ways; in the long form 2000, each in all three).
set -u
. tests/api/client.sh "$@"
make_room "$work/room"
tar -C "$work/room" -cf "$work/room.tar" .
if [ -n "${UNBAKE_LONG:-}" ]; then cuts=2000 ways=3; else cuts=200 ways=1; fi
"$build/tests/chaos/power_cut" "$build" "$work/room.tar" "$work/room" "${UNBAKE_CUTS:-$cuts}" $ways
