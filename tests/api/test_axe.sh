#!/bin/bash
# axe-core (WCAG) finds no fault in the page and in a job's report, in Chromium: axe.mjs.
. tests/api/client.sh "$@"

. tests/api/browser.sh

mkdir -m 750 "$data"
UNBAKE_TOKEN=$("$build/unbaked" token add ada --role admin --data "$data" 2>/dev/null)
export UNBAKE_TOKEN
daemon_start --set threads=1 # one job runs all the time
make_room "$work/room" 12
run 0 submit "$work/room" $tiny --watch
run 0 submit "$work/room" $endless --name 'one that runs'
# It gets on, which is looked for, but leaves the processors to the browser.
runs() { worker=$(sed -n 's/.*job 2: attempt 1 runs as process \([0-9]*\) .*/\1/p' "$work/log"); [ -n "$worker" ]; }
wait_for 60 runs
while kill -STOP "$worker"; do
    sleep 0.45
    kill -CONT "$worker"
    sleep 0.05
done 2>/dev/null & background=$!
run 0 get 1 report.html -q -o "$work"
for scheme in light dark; do
    echo "$scheme" >"$work/room/notes.txt"
    tar -C "$work/room" -cf "$work/room-$scheme.tar" .
done
HOME=$work timeout 180 node tests/api/axe.mjs "$modules" "$chromium" "$UNBAKE_SERVER" "$UNBAKE_TOKEN" "$work/report.html" "$work/room" "$build/axe/pictures" \
    >"$work/out" 2>&1 || fail "axe-core finds: $(cat "$work/out")"
equal "$(grep -c 'rules hold' "$work/out")" 16 "pages that were looked at"
kill "$background"
kill -CONT "$worker"
daemon_end TERM
finish
