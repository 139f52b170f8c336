#!/bin/bash
# One job, done in peace on two threads, on one thread, and interrupted again and again (its
# worker killed with SIGKILL, the daemon with it, the daemon stopped) while it goes on from its
# checkpoints: the same textures, byte for byte. However fast a worker is, it is interrupted before its end: after three
# quarters of what an undisturbed one does to files it is held up. UNBAKE_KILLS sets how often (5).
set -u
build=$1
kills=${UNBAKE_KILLS:-5}
dir=$(mktemp -d /tmp/unbake-test-resume-XXXXXX) || exit 1
daemon=

fail() {
    echo "failed: $*"
    tail -n 30 "$dir"/*.log
    exit 1
}
# shellcheck disable=SC2317
clean_up() {
    [ -n "$daemon" ] && kill -KILL "$daemon" 2>/dev/null
    rm -rf "$dir"
}
trap clean_up EXIT

hold() { "$build/tests/chaos/hold" "$dir/faults" "$@"; }
# start NAME THREADS INTERVAL: a daemon on the data folder $dir/NAME; its URL goes to UNBAKE_SERVER.
start() {
    rm -f "$dir/port"
    UNBAKE_FAULTS=$dir/faults ASAN_OPTIONS=verify_asan_link_order=0 LD_PRELOAD=$library "$build/unbaked" --data "$dir/$1" --listen 127.0.0.1:0 --port-file "$dir/port" \
        --set "threads=$2" --set max_attempts=100 --set "checkpoint_interval_sec=$3" \
        --set min_free_mib=0 >>"$dir/$1.log" 2>&1 &
    daemon=$!
    for _ in $(seq 3000); do
        [ -s "$dir/port" ] && break
        sleep 0.02
    done
    UNBAKE_SERVER=http://127.0.0.1:$(cat "$dir/port" 2>/dev/null)
    export UNBAKE_SERVER
}
stop() {
    kill "$daemon" && wait "$daemon" || fail "the daemon did not stop cleanly: $?"
    daemon=
}
submit() {
    "$build/unbake" submit "$dir/room" --set texture_size=64 --set iterations=40 \
        --set gather_samples=16 --set gloss_passes=1 --set texels_per_iteration=1024 --set report_samples=1 --set preview_interval_sec=60 >/dev/null 2>&1 ||
        fail "submit"
}
# textures NAME: the hashes of what the job left.
textures() {
    (cd "$(dirname "$dir/$1"/jobs/1/attempt-*/out/base_color.exr)" && sha256sum base_color.exr roughness.exr specular.exr emission.exr \
        confidence.exr base_color.png scene.ply scene.glb scene.obj scene.mtl scene.xml \
        scene.serialized) || fail "no textures in $1"
}
checkpoints() {
    "$build/unbake" logs 1 2>/dev/null | grep -c "checkpoint at iteration"
}
state() {
    "$build/unbake" show 1 2>/dev/null | awk '$1 == "state" { print $2 }'
}

library=$(realpath "$build/tests/chaos/preload/files.so") || exit 1
"$build/unbaked" demo-room "$dir/room" --frames 8 --test-frames 1 --spp 4 --test-spp 4 \
    --width 64 --height 48 >"$dir/room.log" 2>&1 || fail "the demo room"

for threads in 2 1; do
    hold new "$dir/peace$threads" || fail "hold"
    start "peace$threads" "$threads" 3600
    submit
    "$build/unbake" watch 1 >/dev/null || fail "the undisturbed job on $threads threads"
    stop
    most=$(($(hold count) * 3 / 4))
    textures "peace$threads" >"$dir/peace$threads.sums"
done
cmp -s "$dir/peace1.sums" "$dir/peace2.sums" || fail "one and two threads differ"

RANDOM=11
hold new "$dir/war" || fail "hold"
hold at "$most"
start war 2 0.2
submit
for ((i = 0; i < kills; i++)); do
    # First, and every other time where that is possible, there is something new to go on from; else at any moment.
    before=$(checkpoints)
    while ((i % 2 == 0)) && [ "$(checkpoints)" -le "$before" ] && [ "$(state)" != succeeded ]; do
        ((i > 0)) && hold is && break
        sleep 0.05
    done
    sleep "0.$((RANDOM % 40 + 10))"
    worker=$(awk '/runs as process/ { for (i = 1; i < NF; i++) if ($i == "process") p = $(i + 1) }
                  END { print p }' "$dir/war.log")
    # The kernel kills the daemon's children with it: "both" is the daemon.
    if ((i % 3 == 2)); then
        hold go # a stop is no kill: it saves, and ends
        stop
        hold at "$most"
        start war 1 0.2
    elif ((i % 3 == 1)) && [ -n "$worker" ] && grep -qa "$dir/war" "/proc/$worker/cmdline" 2>/dev/null; then
        hold at "$most" # of the next one
        kill -KILL "$worker"
    else
        kill -KILL "$daemon"
        wait "$daemon" 2>/dev/null
        [ -n "$worker" ] && for _ in $(seq 6000); do
            grep -qa "$dir/war" "/proc/$worker/cmdline" 2>/dev/null || break
            sleep 0.01
        done
        grep -qa "$dir/war" "/proc/${worker:-none}/cmdline" 2>/dev/null &&
            fail "worker $worker outlived its daemon"
        hold at "$most"
        start war 2 0.2
    fi
    [ "$(state)" = succeeded ] && break
done
hold go
"$build/unbake" watch 1 >/dev/null || fail "the disturbed job"
curl -s -H 'Accept: application/x-ndjson' "$UNBAKE_SERVER/v1/jobs/1/events?after=0" >"$dir/events.log"
grep -q "resumed at iteration" "$dir/events.log" || fail "it never went on from a checkpoint"
stop
grep -q "attempt 2 runs" "$dir/war.log" || fail "it was never interrupted"
textures war >"$dir/war.sums"
cmp -s "$dir/peace2.sums" "$dir/war.sums" || fail "$(diff "$dir/peace2.sums" "$dir/war.sums")"
echo "$(grep -c 'runs as process' "$dir/war.log") attempts, equal textures"
