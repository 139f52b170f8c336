#!/bin/bash
# What people do with the web page, in Chromium: page.mjs.
. tests/api/client.sh "$@"
. tests/api/browser.sh

daemon_start --set threads=2 --set small_render_paths=3000000
make_room "$work/room" 12 # in which nothing shines of its own
# shellcheck disable=SC2086
run 0 submit "$work/room" $tiny --set emitters.1=on --set emitters.2=off --set emitters.4=on --set emitters.5=on --watch
HOME=$work timeout 150 node tests/api/page.mjs "$modules" "$chromium" "$UNBAKE_SERVER" "$build/axe/pictures" "$work/room" >"$work/out" 2>&1 ||
    fail "the page: $(cat "$work/out")"
cat "$work/out"
daemon_end TERM
finish
