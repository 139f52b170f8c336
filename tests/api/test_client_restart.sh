#!/bin/bash
# `watch` goes on where it was while the daemon is killed and started again, and Ctrl-C leaves the
# job alone.
. tests/api/client.sh "$@"

running_attempt() { # NUMBER
    "$build/unbake" show 1 --json | jq -e ".state == \"running\" and .attempt >= $1"
}
lines() { # NUMBER: so many progress events are in the file
    [ "$(grep -c '"progress"' "$work/events")" -ge "$1" ]
}

make_room "$work/room"
daemon_start --set checkpoint_interval_sec=1
run 0 submit "$work/room" $endless -q
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
interrupt "$third"
equal $? 130
has "$(cat "$work/interrupted")" "job 1 continues"
wait_for 60 job_is 1 running || fail "the job does not go on"

run 0 cancel 1
wait "$watcher"
equal $? 1
wait "$plain"
equal $? 1
has "$(cat "$work/plain")" "job 1 cancelled"
has "$(cat "$work/plain.err")" "lost the connection"

# The events that are stored came once each, in order, across both restarts: what is missing from
# the daemon's own record is only progress that was overtaken.
jq -c 'select(.event != "progress" and (.data.snapshot | not)) | .id' "$work/events" >"$work/ids"
sort -nu "$work/ids" | cmp -s - "$work/ids" || fail "events came twice or out of order"
curl -sN -H 'Accept: application/x-ndjson' "$url/v1/jobs/1/events?after=0" |
    jq -c 'select(.event != "progress" and (.data.snapshot | not)) | .id' >"$work/stored"
cmp -s "$work/stored" "$work/ids" || fail "$(diff "$work/stored" "$work/ids" | head -n 5)"

# --- an upload that another process has begun: this one sends what is missing, and no more ----------
make_room "$work/second" 5
head -c 400000 /dev/urandom >"$work/second/notes.bin"
(cd "$work/second" && find . -type f -printf '%P\n' | LC_ALL=C sort |
    tar --format=gnu --owner=0 --group=0 --numeric-owner --mode=0644 --mtime=@0 -b1 -cf "$work/second.tar" -T -)
length=$(stat -c %s "$work/second.tar")
sha=$(sha256sum <"$work/second.tar" | cut -c 1-64)
upload=$(curl -s -D - -o /dev/null -X POST -H 'Tus-Resumable: 1.0.0' -H "Upload-Length: $length" \
    -H "Upload-Metadata: sha256 $(printf %s "$sha" | base64 -w 0)" "$url/v1/uploads" | sed -n 's/^Location: \(.*\)\r$/\1/p')
head -c 150000 "$work/second.tar" | curl -s -o /dev/null -X PATCH -H 'Tus-Resumable: 1.0.0' -H 'Upload-Offset: 0' \
    -H 'Content-Type: application/offset+octet-stream' --data-binary @- "$url$upload"
received() { curl -s "$url/metrics" | sed -n 's/^unbaked_uploaded_bytes_total //p'; }
before=$(received)
run 0 submit "$work/second" $endless
has "$err" "are on the server already: going on from there"
has "$err" "sent second"
equal "$(($(received) - before))" $((length - 150000)) "bytes that were sent"
equal "$(sha256sum <"$data/scenes/$sha/archive" | cut -c 1-64)" "$sha" "the hash of what is there"
run 0 cancel last

# The daemon goes away for good in the middle: the client says so and ends, and what is there stays.
make_room "$work/third" 4
head -c 3000000 /dev/urandom >"$work/third/notes.bin"
equal "$(find "$data" ! -type l -perm /077 | head)" "" "of scenes and jobs, open to other users"
daemon_end TERM || fail "the daemon did not end with 0"
run 5 submit "$work/third" $endless --retry 1
finish
