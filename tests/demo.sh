#!/bin/bash
# The demo: makes a small room whose materials are known, reconstructs it through the daemon and
# the client as a user would, and compares what was found with what is true. Everything stays
# under BUILD/demo. UNBAKE_DEMO_QUALITY is that of the reconstruction (standard).
#
# usage: tests/demo.sh BUILD
set -u
build=${1:-build}
dir=$build/demo
quality=${UNBAKE_DEMO_QUALITY:-standard}
daemon=

fail() {
    printf 'demo: %s\n' "$*" >&2
    if [ -s "$dir/unbaked.log" ]; then
        echo "the end of $dir/unbaked.log:" >&2
        tail -n 20 "$dir/unbaked.log" >&2
    fi
    exit 1
}

stop_daemon() {
    [ -n "$daemon" ] || return 0
    kill -TERM "$daemon" 2>/dev/null
    wait "$daemon" 2>/dev/null
    daemon=
}

clean_up() {
    stop_daemon
    [ -n "${data:-}" ] && rm -rf "$data"
}
trap clean_up EXIT
trap 'exit 130' INT
trap 'exit 143' TERM HUP

step() {
    printf '\n== %s (%d s)\n' "$*" "$SECONDS"
}

[ -x "$build/unbaked" ] && [ -x "$build/unbake" ] || fail "build first: make"
rm -rf "$dir"
mkdir -p "$dir" || exit 1
data=$(mktemp -d "${TMPDIR:-/tmp}/unbake-demo-XXXXXX") || exit 1

step "photographing a room of known materials: $dir/room"
"$build/unbaked" demo-room "$dir/room" || fail "the room could not be made"
# What is uploaded is what a user has: a mesh, photographs, cameras. The truth stays here.
tar -C "$dir/room" --exclude=./truth -cf "$dir/room.tar" . || fail "the room could not be packed"

step "starting unbaked on a free port of the loopback address"
"$build/unbaked" --data "$data" --listen 127.0.0.1:0 --port-file "$data/port" --set min_free_mib=64 \
    2>"$dir/unbaked.log" &
daemon=$!
for _ in $(seq 100); do
    [ -s "$data/port" ] && break
    kill -0 "$daemon" 2>/dev/null || { daemon=; fail "unbaked did not start"; }
    sleep 0.1
done
[ -s "$data/port" ] || fail "unbaked does not listen after 10 s"
UNBAKE_SERVER=http://127.0.0.1:$(cat "$data/port")
export UNBAKE_SERVER

step "reconstructing it, $quality"
"$build/unbake" submit "$dir/room.tar" --name "demo room" --watch --set texture_size=512 \
    --set "quality=$quality" || fail "the job did not succeed"

step "fetching the results"
"$build/unbake" get last -o "$dir/out" || fail "the results could not be fetched"
stop_daemon

step "comparing them with the truth"
"$build/unbaked" evaluate "$dir/room" "$dir/out" --pictures "$dir/pictures" ||
    fail "the results could not be compared with the truth"

cat <<END

The whole report, to open in a browser:  $dir/out/report.html
Textures:                                $dir/out/*.exr, previews in $dir/out/preview
True and found base colour, photographs
and re-renders, side by side:            $dir/pictures

$SECONDS s in all.
END
