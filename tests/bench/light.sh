#!/bin/bash
# How near the light that the default method finds comes to the truth of rooms with truth/lights.json (make rooms): each
# from HDR frames, from 8-bit frames of cycling exposure, and from those of one exposure. Prints a table, writes
# BUILD/light.json and the outputs under BUILD/light/ROOM-KIND. What is counted: light_scores.py.
#
# LIGHT_ROOMS    folders (those under BUILD/rooms that are for choices; those for the report choose nothing)
# LIGHT_KINDS    "hdr sdr one"
# LIGHT_QUALITY  setting quality (standard)
# LIGHT_TEXTURE  setting texture_size (2048)
#
# usage: light.sh BUILD
set -u
build=$1
. tests/bench/lib.sh
rows=$build/light.tsv
: >"$rows"

measure() { # ROOM KIND
    local room=$1 out transforms=transforms_$2.json
    out=$build/light/${1##*/}-$2
    [ "$2" = hdr ] && transforms=transforms.json
    if [ ! -e "$room/$transforms" ] || [ ! -e "$room/truth/lights.json" ]; then
        echo "$room: no room with $transforms and truth/lights.json: left out" >&2
        return
    fi
    echo "== ${room##*/}, $2" >&2
    reconstruct "$room" "$out" "texture_size=${LIGHT_TEXTURE:-2048}" "quality=${LIGHT_QUALITY:-standard}" \
        "transforms=$transforms" report_samples=1 &&
        evaluate "$room" "$out" --spp 0 &&
        python3 tests/bench/light_scores.py "$room" "$out" "${room##*/}, $2" >>"$rows"
}

default=
for name in galley gable sunroom hotel den gallery; do
    default="$default $build/rooms/$name"
done
for room in ${LIGHT_ROOMS:-$default}; do
    for kind in ${LIGHT_KINDS:-hdr sdr one}; do
        measure "${room%/}" "$kind"
    done
done
tests/table.sh "$rows" "$build/light.json"
rm -f "$rows"
