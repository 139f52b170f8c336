#!/bin/bash
# The wall clock is set a day forward and two days back while a job runs and another waits: neither
# notices. One attempt each, the same textures, a stream that does not break, requests that are
# answered. The job's worker is held up while the clock is off, but for some steps each time, so that however fast it
# is it lives through all of that. UNBAKE_ROUNDS sets how often (1; in the long form 5).
set -u
. tests/api/client.sh "$@"
if [ -n "${UNBAKE_LONG:-}" ]; then rounds=5; else rounds=1; fi
rounds=${UNBAKE_ROUNDS:-$rounds}

# set_clock SECONDS: how far it is off.
set_clock() {
    local n=$1 i bytes=
    for i in 0 8 16 24 32 40 48 56; do bytes+=$(printf '\\x%02x' $(((n >> i) & 255))); done
    printf "$bytes" | dd of="$work/clock" conv=notrunc status=none
}
hold() { "$build/tests/chaos/hold" "$work/faults" "$@"; }
# The stream has something of another day than its first.
clock_jumped() { jq -es '[.[].data.at[0:10]] | unique | length >= 2' "$work/stream"; }
textures() { (cd "$(dirname "$data/jobs/$1"/attempt-*/out/base_color.exr)" && sha256sum base_color.exr roughness.exr specular.exr emission.exr confidence.exr); }

make_room "$work/room"
settings="${tiny/iterations=3/iterations=100} --set seed=3"
head -c 8 /dev/zero >"$work/clock"
hold new "$data" || exit 1
export UNBAKE_CLOCK="$work/clock" UNBAKE_FAULTS="$work/faults"
preload="$(realpath "$build/tests/chaos/preload/clock.so") $(realpath "$build/tests/chaos/preload/files.so")"
# The address sanitizer wants to come first and does well enough second.
preloaded() { ASAN_OPTIONS=verify_asan_link_order=0 LD_PRELOAD="$preload" daemon_start --set checkpoint_interval_sec=0.2; }
preloaded
run 0 submit "$work/room" $settings --watch -q
textures 1 >"$work/peace"
lost=0
for round in $(seq "$rounds"); do
    job=$(seq $((round * 2)) | tail -n 1)
    hold at 1
    run 0 submit "$work/room" $settings -q
    run 0 submit "$work/room" $settings -q # waits for its turn meanwhile
    curl -sN -m 300 -H 'Accept: application/x-ndjson' "$url/v1/jobs/$job/events?after=0" >"$work/stream" &
    background=$!
    wait_for 60 job_is "$job" running
    steps=60 # it opens its checkpoint, and begins; then fewer
    for day in 86400 -86400 86400 0; do
        set_clock "$day"
        hold at $steps
        steps=20
        call GET /healthz; expect 200 "health, the clock off by $day s"
        call GET "/v1/jobs/$job"
        equal "$(field .attempt)" 1 "attempt, the clock off by $day s"
        hold await || fail "the worker does not go on, the clock off by $day s"
        wait_for 60 clock_jumped
    done
    hold go
    equal "$(curl -s "$url/metrics" | awk '/^unbaked_attempts_ended_total.*crashed/ { print $2 }')" 0 "crashes"
    for id in "$job" $((job + 1)); do
        run 0 watch "$id" -q
        run 0 show "$id" --json
        equal "$(jq '.attempt' <<<"$out")" 1 "attempts of job $id"
        textures "$id" | cmp -s - "$work/peace" || { fail "textures of job $id differ"; lost=$((lost + 1)); }
    done
    wait "$background" || fail "the stream broke"
    background=
    jq -es 'last | .event == "state" and .data.state == "succeeded"' "$work/stream" >/dev/null || fail "the stream's end"
done
printf 'clock set a day forward and back: jobs with a lost attempt\t%d\t0\tlower\n' "$lost"
stop_daemon
equal "$daemon_status" 0 "exit status"
finish
