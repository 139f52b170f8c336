#!/bin/bash
# axe-core (WCAG) finds no fault in the page and in a job's report, in Chromium: axe.mjs.
. tests/api/client.sh "$@"

. tests/api/browser.sh

mkdir -m 750 "$data"
UNBAKE_TOKEN=$("$build/unbaked" token add ada --role admin --data "$data" 2>/dev/null)
export UNBAKE_TOKEN
daemon_start --set threads=1 # one job runs all the time
make_room "$work/room" 12
run 0 submit "$work/room" --set texture_size=64 --set texels_per_metre=2 --set iterations=20 --set texels_per_iteration=64 --set report_samples=1 --watch
run 0 submit "$work/room" --set texture_size=64 --set texels_per_metre=2 --set iterations=1000000000 --set texels_per_iteration=64 --name 'one that runs'
run 0 get 1 report.html -q -o "$work"
for scheme in light dark; do
    echo "$scheme" >"$work/room/notes.txt"
    tar -C "$work/room" -cf "$work/room-$scheme.tar" .
done
HOME=$work timeout 180 node tests/api/axe.mjs "$modules" "$chromium" "$UNBAKE_SERVER" "$UNBAKE_TOKEN" "$work/report.html" "$work/room" "$build/axe/pictures" \
    >"$work/out" 2>&1 || fail "axe-core finds: $(cat "$work/out")"
equal "$(grep -c 'rules hold' "$work/out")" 16 "pages that were looked at"
daemon_end TERM
finish
