#!/bin/bash
# How long a relit preview takes: the real daemon with the demo room, a render of 640 x 480 that is sent to it, and the time
# until GET has the first preview and the picture. Beside the clock the worker's processor time until then, which on a busy
# machine says more: two idle processors need half of it. The reconstruction is a coarse one; its light and mesh are not.
#
#     tests/bench/relit_preview.sh BUILD
set -u
. tests/api/client.sh "$@"
"$build/unbaked" demo-room "$work/room" >/dev/null || exit 1
daemon_start --set threads=2
run 0 submit "$work/room" --set quality=draft --set texture_size=512 --set iterations=20 --set report_samples=1 --watch
for round in 1 2; do # the first reads the files from the disk
    begun=$(date +%s.%N)
    run 0 render 1 --size 640x480 --set environment=none -q
    id=$out
    pid() { sed -n "s/.*job $id: attempt 1 runs as process \([0-9]*\) .*/\1/p" "$work/log"; }
    has_preview() { [ "$(curl -s -o "$work/picture" -w '%{http_code}' "$url/v1/jobs/$id/outputs/preview/render.png")" = 200 ]; }
    until has_preview; do sleep 0.02; done
    seen=$(date +%s.%N)
    ticks=$(awk '{ print $14 + $15 }' "/proc/$(pid)/stat" 2>/dev/null || echo 0)
    wait_for 600 job_is "$id" succeeded
    ended=$(date +%s.%N)
done
awk -v a="$begun" -v b="$seen" -v c="$ended" -v t="$ticks" -v hz="$(getconf CLK_TCK)" 'BEGIN {
    printf "relit preview, 640 x 480, s\t%.2f\t2\tlower\n", b - a
    printf "its processor time, s\t%.2f\t4\tlower\n", t / hz
    printf "the picture with 64 samples, s\t%.1f\t\tlower\n", c - a }'
daemon_end TERM
[ $failures = 0 ]
