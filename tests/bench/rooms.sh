#!/bin/bash
# Makes the rooms of furnished_room.py, as bundles for FIDELITY_ROOMS and LIGHT_ROOMS, under BUILD/rooms. One that is
# there stays. ROOM_NAMES: which; "choice": those to choose by, "report": those to report on, which must choose nothing
# (all). ROOM_SPP: samples a pixel (boxes 256: an hour each on two cores; the others 64).
#
# usage: rooms.sh BUILD
set -u
build=$1
boxes="kitchen parlour bedroom lounge study cafe"
choice="galley gable sunroom hotel den gallery"
report="workshop studio passage bar office washroom"
. tests/bench/lib.sh
mitsuba_ready || exit 77
names=${ROOM_NAMES:-$boxes $choice $report}
names=${names/#choice/$choice}
names=${names/#report/$report}
for name in $names; do
    room=$build/rooms/$name
    [ -e "$room/truth/objects.json" ] && continue
    case " $boxes " in
    *" $name "*) spp=256 ;;
    *) spp=64 ;;
    esac
    mkdir -p "$room"
    "$build/mitsuba/bin/python" tests/bench/furnished_room.py "$name" "$room" "${ROOM_SPP:-$spp}" || exit 1
done
echo "rooms: $build/rooms"
