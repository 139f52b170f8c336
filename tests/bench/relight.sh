#!/bin/bash
# How near a recovered room under another light is to the true room under the same light: a glowing ball, each of its three
# brightest lamps alone, and a sky through the openings of removed windows. Rooms are reconstructed from their HDR frames;
# the scans and the phone captures of the test data are held against the same truths. Prints a table, writes
# BUILD/relight.json and, under BUILD/relight/ROOM, pictures beside each other. What is compared is said at the head of
# tests/render/relight_room.c. FLIP is flip-evaluator's (PyPI, into BUILD/flip); where that is not to be had its rows are
# left out, and that is said.
#
# RELIGHT_ROOMS    "demo staircase2 bathroom staircase2-scan bathroom-scan staircase2-phone bathroom-phone"
# RELIGHT_QUALITY  of the reconstructions (standard)
# RELIGHT_TEXTURE  their texture_size (1024)
# RELIGHT_SPP      samples a pixel of each of the four renders (64)
#
# usage: relight.sh BUILD
set -u
build=$1
. tests/bench/lib.sh
rows=$build/relight.tsv
sky=$data/hdri/lythwood_room_1k.hdr
rm -rf "$build/relight"
mkdir -p "$build/relight"
: >"$rows"

has_flip=
if [ -x "$build/flip/bin/python" ] || python3 -m venv "$build/flip" >&2; then
    "$build/flip/bin/python" -c 'import flip_evaluator, numpy' 2>/dev/null ||
        timeout 300 "$build/flip/bin/pip" install -q flip-evaluator==1.7 numpy >&2
    "$build/flip/bin/python" -c 'import flip_evaluator, numpy' 2>/dev/null && has_flip=1
fi
[ -n "$has_flip" ] || echo "flip-evaluator is not to be had: FLIP is left out" >&2
[ -e "$sky" ] || echo "no $sky: the sky is left out" >&2

# segment OUT OBJECT: which segment of a reconstruction an object is.
segment() {
    jq -r ".segments[] | select(.id == $2).segment" "$1/report.json" | head -n 1
}

# window ROOM: the object that a sky would come in through.
window() {
    case $1 in
    demo) echo 21 ;;
    bathroom) echo 16 ;;
    esac
}

# recover ROOM FOLDER: once in a run for all rows that need it.
recover() {
    [ -e "$build/relight/$1/out/report.json" ] ||
        reconstruct "$2" "$build/relight/$1/out" "texture_size=${RELIGHT_TEXTURE:-1024}" \
            "quality=${RELIGHT_QUALITY:-standard}" report_samples=1
}

measure() { # ROOM
    local name=$1 base=${1%-scan} room options window scan=
    base=${base%-phone}
    room=$data/rooms/$base
    [ "$base" = demo ] && room=$build/relight/demo/room
    if [ "$base" = demo ] && [ ! -e "$room/transforms.json" ]; then
        "$build/unbaked" demo-room "$room" --opening || return
    fi
    if [ ! -e "$room/truth/objects.json" ]; then
        echo "$name: no $room with a truth: left out" >&2
        return
    fi
    echo "== $name" >&2
    mkdir -p "$build/relight/$name"
    recover "$base" "$room" || return
    options=("label=$name" "spp=${RELIGHT_SPP:-64}")
    window=$(window "$base")
    if [ -n "$window" ] && [ -e "$sky" ]; then
        options+=("sky=$sky" "remove=$(segment "$build/relight/$base/out" "$window")")
    fi
    case $name in
    *-scan)
        # the scan's mesh with the photographs of the room
        scan=$build/relight/$name/room
        rm -rf "$scan"
        mkdir -p "$scan"
        cp -r "$room/images" "$room/transforms.json" "$scan/" && cp "$data/rooms/$name/mesh.ply" "$scan/mesh.ply" || return
        ;;
    *-phone) scan=$data/rooms/$name ;;
    esac
    if [ -n "$scan" ]; then
        if [ ! -e "$scan/mesh.ply" ]; then
            echo "$name: no $scan: left out" >&2
            return
        fi
        recover "$name" "$scan" || return
        # segments of a scan have other numbers: no window of it can be named
        options=("label=$name" "spp=${RELIGHT_SPP:-64}" "scan=$build/relight/$name/out")
    fi
    "$build/tests/render/relight_room" "$room" "$build/relight/$base/out" "$build/relight/$name" "${options[@]}" >>"$rows"
    [ -n "$has_flip" ] && "$build/flip/bin/python" tests/bench/flip.py "$name" "$build/relight/$name" >>"$rows"
}

for room in ${RELIGHT_ROOMS:-demo staircase2 bathroom staircase2-scan bathroom-scan staircase2-phone bathroom-phone}; do
    measure "$room"
done
tests/table.sh "$rows" "$build/relight.json"
echo "pictures: $build/relight/ROOM/*.png"
rm -f "$rows"
