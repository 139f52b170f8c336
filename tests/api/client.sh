# client.sh -- for the tests of the client: `. tests/api/client.sh`, with the build folder
# in $1. Makes a temporary folder ($tmp), and removes it and the daemon when the test ends.
# shellcheck shell=bash disable=SC2034
set -u
build=$(realpath "${1:-build}")
tmp=$(mktemp -d /tmp/unbake-api-XXXXXX)
daemon_pid=
port=0
failures=0

finish() {
    if [ -n "$daemon_pid" ]; then
        kill -KILL "$daemon_pid" 2>/dev/null
        wait "$daemon_pid" 2>/dev/null
    fi
    [ "$failures" -eq 0 ] || { echo "--- the daemon's log ends:"; tail -n 20 "$tmp/daemon.log"; }
    rm -rf "$tmp"
}
trap finish EXIT

fail() {
    echo "line ${BASH_LINENO[${2:-0}]}: $1"
    failures=$((failures + 1))
}

# daemon_start [ARGUMENT...]: waits until it accepts connections; sets $S, the server's URL. A
# second start takes the same port.
daemon_start() {
    rm -f "$tmp/port"
    "$build/unbaked" --data "$tmp/data" --listen "127.0.0.1:$port" --port-file "$tmp/port" --set min_free_mib=1 "$@" \
        >/dev/null 2>>"$tmp/daemon.log" &
    daemon_pid=$!
    for _ in $(seq 200); do
        [ -s "$tmp/port" ] && break
        kill -0 "$daemon_pid" 2>/dev/null || break
        sleep 0.05
    done
    if [ ! -s "$tmp/port" ]; then
        failures=1
        echo "the daemon does not start"
        exit 1
    fi
    port=$(cat "$tmp/port")
    S=http://127.0.0.1:$port
    export UNBAKE_SERVER=$S
}

# daemon_end SIGNAL: ends it and waits for that; its exit status is $?.
daemon_end() {
    kill -s "$1" "$daemon_pid"
    wait "$daemon_pid" 2>/dev/null
    local code=$?
    daemon_pid=
    return $code
}

# run WANTED ARGUMENT...: runs the client; $out and $err are what it printed.
run() {
    local wanted=$1 code
    shift
    out=$("$build/unbake" "$@" 2>"$tmp/err")
    code=$?
    err=$(cat "$tmp/err")
    [ "$code" -eq "$wanted" ] || fail "unbake $*: exit $code, wanted $wanted: $out $err" 1
}

# has TEXT PART: PART must be in TEXT.
has() {
    [[ $1 == *"$2"* ]] || fail "\"$2\" is not in: $1" 1
}

# same FOUND WANTED
same() {
    [ "$1" = "$2" ] || fail "found \"$1\", wanted \"$2\"" 1
}

# wait_for SECONDS COMMAND...: until it succeeds.
wait_for() {
    local tries=$(($1 * 10))
    shift
    for _ in $(seq "$tries"); do
        "$@" >/dev/null 2>&1 && return 0
        sleep 0.1
    done
    fail "waited too long for: $*" 1
    return 1
}

job_is() { # JOB STATE
    [ "$("$build/unbake" show "$1" --json | jq -r .state)" = "$2" ]
}

# make_room DIR [FRAMES]: a cube of 4 m seen from its middle, in flat grey photographs.
make_room() {
    local dir=$1 frames=${2:-6} i
    mkdir -p "$dir/images"
    cat >"$dir/mesh.ply" <<'PLY'
ply
format ascii 1.0
element vertex 8
property float x
property float y
property float z
element face 6
property list uchar int vertex_indices
end_header
-2 -2 -2
2 -2 -2
2 2 -2
-2 2 -2
-2 -2 2
2 -2 2
2 2 2
-2 2 2
4 0 1 2 3
4 4 7 6 5
4 0 4 5 1
4 3 2 6 7
4 0 3 7 4
4 1 5 6 2
PLY
    for i in $(seq "$frames"); do
        base64 -d >"$dir/images/$i.png" <<'PNG'
iVBORw0KGgoAAAANSUhEUgAAACAAAAAYCAIAAAAUMWhjAAAAJElEQVR42mNoqEihKWIYtWDUglELRi0YtWDUglELRi0YGhYAAGNMFD2InbU1AAAAAElFTkSuQmCC
PNG
    done
    awk -v n="$frames" 'BEGIN {
        printf "{\"camera_model\": \"PINHOLE\", \"w\": 32, \"h\": 24, \"camera_angle_x\": 1.4, \"frames\": ["
        for (i = 1; i <= n; i++) {
            a = 6.2831853 * i / n
            printf "%s{\"file_path\": \"images/%d.png\", \"exposure\": 1, \"split\": \"%s\", \"transform_matrix\": ",
                   (i > 1 ? ", " : ""), i, (i == n ? "test" : "train")
            printf "[[%.7f,0,%.7f,0],[0,1,0,0],[%.7f,0,%.7f,0],[0,0,0,1]]}", cos(a), sin(a), -sin(a), cos(a)
        }
        print "]}"
    }' >"$dir/transforms.json"
}
