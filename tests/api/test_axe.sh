#!/bin/bash
# axe-core (WCAG) finds no fault in the page and in a job's report, in Chromium: axe.mjs. It and what drives the browser
# come from npm into BUILD/axe, once.
. tests/api/client.sh "$@"

chromium=$(command -v chromium || command -v chromium-browser || command -v google-chrome) || { echo "there is no Chromium"; exit 77; }
command -v node >/dev/null || { echo "there is no node"; exit 77; }
modules=$build/axe/node_modules
if [ ! -d "$modules/axe-core" ] || [ ! -d "$modules/puppeteer-core" ]; then
    command -v npm >/dev/null || { echo "there is no npm"; exit 77; }
    mkdir -p "$build/axe"
    echo '{"private": true}' >"$build/axe/package.json"
    (cd "$build/axe" && timeout 120 npm install --no-audit --no-fund --ignore-scripts axe-core@4.14.1 puppeteer-core@24.43.1) >"$work/npm" 2>&1 ||
        { echo "npm cannot install axe-core and puppeteer-core: $(tail -n 1 "$work/npm")"; exit 77; }
fi

mkdir -m 750 "$data"
UNBAKE_TOKEN=$("$build/unbaked" token add ada --role admin --data "$data" 2>/dev/null)
export UNBAKE_TOKEN
daemon_start
make_room "$work/room" 12
run 0 submit "$work/room" --set texture_size=64 --set texels_per_metre=2 --set iterations=20 --set texels_per_iteration=64 --set report_samples=1 --watch
run 0 submit "$work/room" --set texture_size=64 --set texels_per_metre=2 --set iterations=1000000000 --set texels_per_iteration=64 --name 'one that runs'
run 0 get 1 report.html -q -o "$work"
for scheme in light dark; do
    echo "$scheme" >"$work/room/notes.txt"
    tar -C "$work/room" -cf "$work/room-$scheme.tar" .
done
mkdir -p "$build/axe/pictures"
HOME=$work timeout 180 node tests/api/axe.mjs "$modules" "$chromium" "$UNBAKE_SERVER" "$UNBAKE_TOKEN" "$work/report.html" "$work/room" "$build/axe/pictures" \
    >"$work/out" 2>&1 || fail "axe-core finds: $(cat "$work/out")"
equal "$(grep -c 'rules hold' "$work/out")" 14 "pages that were looked at"
daemon_end TERM
finish
