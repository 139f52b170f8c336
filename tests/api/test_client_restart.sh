#!/bin/bash
# `watch` goes on where it was while the daemon is killed and started again, and Ctrl-C leaves the
# job alone.
. tests/api/client.sh "$@"
long="--set texture_size=64 --set iterations=1000000 --set texels_per_iteration=64"

running_attempt() { # NUMBER
    "$build/unbake" show 1 --json | jq -e ".state == \"running\" and .attempt >= $1"
}
lines() { # NUMBER: so many progress events are in the file
    [ "$(grep -c '"progress"' "$work/events")" -ge "$1" ]
}

make_room "$work/room"
daemon_start --set checkpoint_interval_sec=1
run 0 submit "$work/room" $long -q
"$build/unbake" watch 1 --json --all >"$work/events" 2>"$work/watch.err" &
watcher=$!
"$build/unbake" watch 1 >"$work/plain" 2>"$work/plain.err" &
plain=$!
wait_for 60 lines 3

# Killed, as a power cut would; then stopped as an administrator would.
daemon_end KILL
sleep 0.5
daemon_start --set checkpoint_interval_sec=1
wait_for 60 running_attempt 2
before=$(grep -c '"progress"' "$work/events")
wait_for 60 lines $((before + 3))
daemon_end TERM || fail "the daemon did not end with 0"
daemon_start --set checkpoint_interval_sec=1
before=$(grep -c '"progress"' "$work/events")
wait_for 60 lines $((before + 3))

# Ctrl-C ends the watching, not the job.
env --default-signal=INT "$build/unbake" watch 1 >/dev/null 2>"$work/interrupted" &
third=$!
sleep 0.5
kill -INT "$third"
wait "$third"
equal $? 130
has "$(cat "$work/interrupted")" "job 1 goes on"
job_is 1 running || fail "the job does not go on"

run 0 cancel 1
wait "$watcher"
equal $? 1
wait "$plain"
equal $? 1
has "$(cat "$work/plain")" "job 1 cancelled"
has "$(cat "$work/plain.err")" "lost the server"

# The events that are stored came once each, in order, across both restarts: what is missing from
# the daemon's own record is only progress that was overtaken.
jq -c 'select(.event != "progress" and (.data.snapshot | not)) | .id' "$work/events" >"$work/ids"
sort -nu "$work/ids" | cmp -s - "$work/ids" || fail "events came twice or out of order"
curl -sN -H 'Accept: application/x-ndjson' "$url/v1/jobs/1/events?after=0" |
    jq -c 'select(.event != "progress" and (.data.snapshot | not)) | .id' >"$work/stored"
cmp -s "$work/stored" "$work/ids" || fail "$(diff "$work/stored" "$work/ids" | head -n 5)"
finish
