#!/bin/bash
# The whole way on a small demo room, as `make demo` goes it: photographs of known materials, the
# daemon, the client, the outputs, the comparison with the truth. A fixed number of iterations, so
# the figures are the same on every machine; the limits leave room for changes of the optimiser, not
# for a broken one. They are those of textures of 128 texels, as coarse as that: at 256 base colour is 3 dB nearer, and takes
# three times as long. HDR frames, then ordinary ones at cycling exposures.
set -u
# shellcheck source=tests/api/lib.sh
. tests/api/lib.sh "$1"

start_daemon
export UNBAKE_SERVER=$url

# at_least NAME FOUND LEAST / at_most NAME FOUND MOST
at_least() { awk "BEGIN{exit !($2 >= $3)}" || fail "$1 is $2, wanted $3 at least"; }
at_most() { awk "BEGIN{exit !($2 <= $3)}" || fail "$1 is $2, wanted $3 at most"; }

# try NAME LEAST-PSNR MOST-MSRE DEMO-ROOM-FLAG...
try() {
    local name=$1 psnr=$2 msre=$3
    shift 3
    "$build/unbaked" demo-room "$work/$name" --width 96 --height 72 --frames 22 --test-frames 2 \
        --spp 16 --test-spp 32 --texture-size 256 "$@" >"$work/$name.log" 2>&1 ||
        fail "demo-room: $(tail -n 3 "$work/$name.log")"
    tar -C "$work/$name" --exclude=./truth -cf "$work/$name.tar" .
    "$build/unbake" submit "$work/$name.tar" --watch --set texture_size=128 --set iterations=80 --set gather_samples=64 --set gloss_passes=1 \
        --set texels_per_iteration=512 --set report_samples=16 >"$work/$name.watch" 2>&1 ||
        fail "the job failed: $(tail -n 3 "$work/$name.watch")"
    "$build/unbake" get last -o "$work/$name.out" >/dev/null 2>&1 || fail "get"
    "$build/unbaked" evaluate "$work/$name" "$work/$name.out" --json >"$work/$name.json" ||
        fail "evaluate"
    cat "$work/$name.json"
    at_least "$name: base-colour PSNR over seen surface" "$(jq "$base_color" "$work/$name.json")" "$psnr"
    at_most "$name: MSRE" "$(jq "$msre_of" "$work/$name.json")" "$msre"
    at_least "$name: errors within one standard deviation" "$(jq .base_color_within_one_deviation "$work/$name.json")" 0.5
    at_most "$name: errors within one standard deviation" "$(jq .base_color_within_one_deviation "$work/$name.json")" 0.75
    equal "$(jq "$found" "$work/$name.json")" 2 "$name: emitters found"
    equal "$(jq "$false_found" "$work/$name.json")" 0 "$name: emitters that are none"
    for file in base_color.exr roughness.exr specular.exr emission.exr confidence.exr base_color.png scene.ply \
        scene.glb scene.obj scene.mtl scene.xml scene.serialized report.json report.html preview/base_color.png; do
        [ -s "$work/$name.out/$file" ] || fail "$name: $file is missing"
    done
}

base_color=.base_color_psnr_db
msre_of=.msre
found=.emitters_found
false_found=.emitters_false
try hdr 25 0.2
# In another light it is near the true room in that light (relight_room.c): a glowing ball, each lamp alone.
"$build/tests/render/relight_room" "$work/hdr" "$work/hdr.out" "$work/relit" views=0,1 spp=8 label=hdr least=20 ratio=1.05 ||
    fail "relit it is not near the truth"
"$build/unbaked" relight "$work/hdr.out" --set light.99=off --view 99 --out "$work/none.png" 2>"$work/none"
equal "$? $(grep -c 'setting light.99\|setting view' "$work/none")" "2 2" "relight of what the room has not"
mkdir "$work/told"
cp "$work/hdr.out"/*.exr "$work/hdr.out/scene.ply" "$work/hdr.out/views.json" "$work/told"
jq '.luminance_per_unit = {"cd_per_m2": 100}' "$work/hdr.out/report.json" >"$work/told/report.json"
"$build/unbaked" relight "$work/told" --set unit=nits --set size=8x6 --spp 1 --out "$work/nits.exr" --quiet 2>"$work/none" ||
    fail "relight in nits where the report knows the unit: $(cat "$work/none")"
"$build/unbaked" relight "$work/hdr.out" --view 0 --out "$work/none.jpg" 2>"$work/none"
equal "$? $(grep -c 'pictures are .png' "$work/none")" "2 1" "relight into another format"
[ ! -e "$work/none.jpg" ] || fail "a folder with the name of a picture"
# A job compares it with the truth that comes with a room, and finds what the command does.
tar -C "$work/hdr" -cf "$work/known.tar" .
known=$(curl -s -X POST -T "$work/known.tar" -H 'Content-Type: application/x-tar' "$url/v1/scenes?name=known" | jq -r .id)
"$build/unbake" evaluate last --scene "$known" -q -o "$work/evaluated" || fail "the job that evaluates failed"
jq -S . "$work/evaluated/evaluation.json" >"$work/by_job.json"
jq -S . "$work/hdr.json" | cmp - "$work/by_job.json" || fail "a job and the command evaluate differently"
[ -s "$work/evaluated/pictures/base_color_$(jq -r '[.frames[] | select(.split == "test").file_path][0]' "$work/hdr/transforms.json" |
    sed 's/.*\///; s/\..*//').png" ] || fail "no pictures of the comparison: $(ls -R "$work/evaluated")"
try sdr 25 0.2 --sdr
stop_daemon
equal "$daemon_status" 0 "the daemon's exit status"
finish
