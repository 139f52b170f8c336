#!/bin/bash
# How near a recovered room under another light is to the true room under the same light: a glowing ball, each of its three
# brightest lamps alone, and a sky through the openings of removed windows. Rooms are reconstructed from their HDR frames;
# the scans and the phone captures of the test data are held against the same truths. Prints a table, writes
# BUILD/relight.json and, under BUILD/relight/ROOM, pictures beside each other. What is compared is said at the head of
# tests/render/relight_room.c. FLIP is flip-evaluator's (PyPI, into BUILD/flip); where that is not to be had its rows are
# left out, and that is said.
#
# What takes long is kept under BUILD/relight and used again: a reconstruction as long as room, settings and program are the
# same, a picture as long as its room, light and program are. So a run that was broken off goes on, and RELIGHT_ROOMS may
# grow from run to run.
#
# RELIGHT_ROOMS    "demo staircase2 bathroom staircase2-scan bathroom-scan staircase2-phone bathroom-phone"
# RELIGHT_QUALITY  of the reconstructions (standard)
# RELIGHT_SCANS    the same of scans and phone captures (as RELIGHT_QUALITY)
# RELIGHT_TEXTURE  their texture_size (1024)
# RELIGHT_SPP      samples a pixel of each of the four renders (64)
#
# usage: relight.sh BUILD
set -u
build=$1
. tests/bench/lib.sh
rows=$build/relight.tsv
sky=$data/hdri/lythwood_room_1k.hdr
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

# windows ROOM: the objects, with commas between, that a sky comes in through when they are away; of staircase2 its lamps, too.
windows() {
    case $1 in
    demo) echo 21 ;;
    staircase2) seq -s , 18 30 ;;
    bathroom) echo 16 ;;
    esac
}

# segments OUT OBJECTS: which segments of a reconstruction the objects are.
segments() {
    jq -r "[.segments[] | select(.id | IN($2)).segment] | join(\",\")" "$1/report.json"
}

# is_kept FILE KEY: whether what FILE stands for was made from what KEY says.
is_kept() { [ "$(cat "$1" 2>/dev/null)" = "$2" ]; }

# make_demo: the demo room, as the program makes it now.
make_demo() {
    local key
    key=$(sha256sum <"$build/unbaked")
    is_kept "$build/relight/demo/room.key" "$key" && return
    rm -rf "$build/relight/demo/room" "$build/relight/demo/room.key"
    "$build/unbaked" demo-room "$build/relight/demo/room" --opening && echo "$key" >"$build/relight/demo/room.key"
}

# recover ROOM FOLDER QUALITY
recover() {
    local out=$build/relight/$1/out key settings=("texture_size=${RELIGHT_TEXTURE:-1024}" "quality=$3" report_samples=1)
    key=$({
        sha256sum <"$build/tests/bench/reconstruct_room"
        echo "${settings[@]}"
        cd "$2" && find . -path ./truth -prune -o -type f -print0 | sort -z | xargs -0 sha256sum
    } | sha256sum)
    is_kept "$out.key" "$key" && return
    rm -f "$out.key"
    reconstruct "$2" "$out" "${settings[@]}" && echo "$key" >"$out.key"
}

# keep_pictures ROOM BASE: takes away what an earlier program, or another reconstruction, has rendered.
keep_pictures() {
    local dir=$build/relight/$1 key
    key=$(cat "$build/relight/$1/out.key" "$build/relight/$2/out.key"; sha256sum <"$build/tests/render/relight_room")
    is_kept "$dir/renders.key" "$key" && return
    rm -rf "$dir/renders" "$dir/truth" "$dir"/*.png
    echo "$key" >"$dir/renders.key"
}

measure() { # ROOM
    local name=$1 base=${1%-scan} quality=${RELIGHT_QUALITY:-standard} room options windows scan=
    base=${base%-phone}
    room=$data/rooms/$base
    [ "$base" = demo ] && room=$build/relight/demo/room
    if [ "$base" = demo ]; then
        mkdir -p "$build/relight/demo"
        make_demo || return
    fi
    if [ ! -e "$room/truth/objects.json" ]; then
        echo "$name: no $room with a truth: left out" >&2
        return
    fi
    echo "== $name" >&2
    mkdir -p "$build/relight/$name"
    recover "$base" "$room" "$quality" || return
    options=("label=$name" "spp=${RELIGHT_SPP:-64}")
    windows=$(windows "$base")
    if [ -n "$windows" ] && [ -e "$sky" ]; then
        options+=("sky=$sky" "remove=$(segments "$build/relight/$base/out" "$windows")")
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
        recover "$name" "$scan" "${RELIGHT_SCANS:-$quality}" || return
        # segments of a scan have other numbers: no window of it can be named
        options=("label=$name" "spp=${RELIGHT_SPP:-64}" "scan=$build/relight/$name/out" "truth=$build/relight/$base")
    fi
    keep_pictures "$base" "$base"
    keep_pictures "$name" "$base"
    "$build/tests/render/relight_room" "$room" "$build/relight/$base/out" "$build/relight/$name" "${options[@]}" >>"$rows"
    [ -n "$has_flip" ] && "$build/flip/bin/python" tests/bench/flip.py "$name" "$build/relight/$name" >>"$rows"
}

for room in ${RELIGHT_ROOMS:-demo staircase2 bathroom staircase2-scan bathroom-scan staircase2-phone bathroom-phone}; do
    measure "$room"
done
tests/table.sh "$rows" "$build/relight.json"
echo "pictures: $build/relight/ROOM/*.png"
rm -f "$rows"
