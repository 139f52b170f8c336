#!/bin/bash
# Attempts on another machine, by the real `unbaked node`: see node_kill.c. UNBAKE_KILLS sets how often a node is killed or taken back (2;
# in the long form 200).
set -u
. tests/api/client.sh "$@"
make_room "$work/room"
if [ -n "${UNBAKE_LONG:-}" ]; then kills=200 seed=$RANDOM; else kills=2 seed=25; fi
echo "seed $seed"
"$build/tests/chaos/node_kill" "$build" "$work/room" "${UNBAKE_KILLS:-$kills}" "$seed"
