#!/bin/bash
# Makes the rooms of furnished_room.py, as bundles for FIDELITY_ROOMS, under BUILD/rooms. One that is there
# stays. ROOM_SPP: samples a pixel (256: an hour each on two cores).
#
# usage: rooms.sh BUILD
set -u
build=$1
. tests/bench/lib.sh
mitsuba_ready || exit 77
for kind in kitchen parlour bedroom lounge study cafe; do
    room=$build/rooms/$kind
    [ -e "$room/truth/objects.json" ] && continue
    mkdir -p "$room"
    "$build/mitsuba/bin/python" tests/bench/furnished_room.py "$kind" "$room" "${ROOM_SPP:-256}" || exit 1
done
echo "rooms: $build/rooms"
