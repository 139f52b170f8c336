#!/bin/bash
# What the web page shows of a room's check, in Chromium: check.mjs.
. tests/api/client.sh "$@"
. tests/api/browser.sh

make_room "$work/room" 12
"$build/unbaked" check "$work/room" --pictures "$work/pictures" >"$work/out" 2>&1 || fail "no pictures: $(cat "$work/out")"
HOME=$work timeout 150 node tests/api/check.mjs "$modules" "$chromium" "$build/tests/api/idle" "$work/pictures" "$build/axe/pictures" >"$work/out" 2>&1 ||
    fail "the check: $(cat "$work/out")"
cat "$work/out"
finish
