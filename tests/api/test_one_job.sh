#!/bin/bash
# One small job from end to end, as a user runs it: a room, the daemon, the client; what `make check` has of them.
set -u
. tests/api/lib.sh "$@"

"$build/unbaked" demo-room "$work/room" --width 48 --height 36 --frames 10 --test-frames 1 --spp 4 --test-spp 4 \
    --texture-size 128 >"$work/demo-room.log" 2>&1 || fail "demo-room: $(tail -n 3 "$work/demo-room.log")"
rm -r "$work/room/truth"
# Under a sanitizer, which takes ten times as long, fewer texels do, and one pass less.
case $build in *asan | *tsan) coarse="--set gloss_passes=1" density=5 ;; *) coarse='' density=6 ;; esac
start_daemon
export UNBAKE_SERVER=$url
"$build/unbake" submit "$work/room" --set texture_size=128 --set texels_per_metre=$density --set iterations=2 \
    --set gather_samples=16 --set report_samples=1 $coarse --watch >"$work/submit.log" 2>&1 ||
    fail "submit: $(tail -n 5 "$work/submit.log")"
call GET /v1/jobs
expect 200
equal "$(field '.items[0].state')" succeeded "state of the job"
job=$(field '.items[0].id')
"$build/unbake" get "$job" -o "$work/out" >"$work/get.log" 2>&1 || fail "get: $(tail -n 5 "$work/get.log")"
for name in base_color.exr roughness.exr specular.exr emission.exr scene.glb report.json report.html; do
    [ -s "$work/out/$name" ] || fail "no $name among $(ls "$work/out")"
done
# Both emitters were found, and what was found is of the room's order, not black and not white.
equal "$(jq '[.segments[] | select(.emitter)] | length' "$work/out/report.json")" 2 "emitters"
jq -e '.metrics.psnr_db > 12' "$work/out/report.json" >/dev/null ||
    fail "held-out views: $(jq -c .metrics "$work/out/report.json")"
stop_daemon
equal "$daemon_status" 0 "the daemon's exit status"
finish
