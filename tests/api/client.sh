# client.sh -- for tests of the client: `. tests/api/client.sh BUILD`. On top of lib.sh:
#
# daemon_start [FLAG...]   as start_daemon; again: on the same port. $UNBAKE_SERVER names it
# daemon_end SIGNAL        ends it, waits; its exit status is $?
# run STATUS ARGUMENT...   runs the client and checks its exit status; sets $out, $err
# has TEXT PART            PART must be in TEXT
# job_is JOB STATE
# interrupt PID            Ctrl-C, once the client is ready for it; its exit status is $?
# held daemon_start ...    with chaos/preload/files.so under it: `hold WORD...` holds its workers up, see chaos/hold.c
# make_room DIR [FRAMES]
# $tiny                    settings of a job that passes through all stages with hardly any work in them. No surface is
#                          sought that a scan lacks: in the closed room of make_room there is none, and the search would
#                          be most of the work
# $endless                 settings of one that iterates until it is stopped
# shellcheck shell=bash disable=SC2034
. tests/api/lib.sh "$@"
build=$(realpath "$build")
port=0
tiny="--set texture_size=64 --set texels_per_metre=2 --set gather_samples=16 --set gloss_passes=1 --set iterations=3 --set texels_per_iteration=64 --set report_samples=1 --set holes=keep"
endless=${tiny/iterations=3/iterations=1000000000}

daemon_start() {
    start_daemon --listen "127.0.0.1:$port" "$@"
    port=${url##*:}
    export UNBAKE_SERVER=$url
}

daemon_end() {
    local code
    kill -s "$1" "$daemon_pid"
    wait "$daemon_pid" 2>/dev/null
    code=$?
    daemon_pid=
    return $code
}

# The address sanitizer wants to come first and does well enough second.
preload=$build/tests/chaos/preload/files.so
held() { ASAN_OPTIONS=verify_asan_link_order=0 LD_PRELOAD=$preload UNBAKE_FAULTS=$work/faults "$@"; }
hold() { "$build/tests/chaos/hold" "$work/faults" "$@"; }

run() {
    local wanted=$1 code
    shift
    out=$("$build/unbake" "$@" 2>"$work/err")
    code=$?
    err=$(cat "$work/err")
    [ "$code" -eq "$wanted" ] || fail "unbake $*: exit $code, wanted $wanted: $out $err"
}

has() { [[ $1 == *"$2"* ]] || fail "\"$2\" is not in: $1"; }

job_is() {
    [ "$("$build/unbake" show "$1" | awk '$1 == "state" { print $2; exit }')" = "$2" ] # asked often: jq takes longer
}

# It is the client by now, not the shell that started it, and reads Ctrl-C from a descriptor.
is_ready_for_int() {
    local mask
    mask=$(awk '$1 == "Name:" { name = $2 } $1 == "SigBlk:" { print name == "unbake" ? "0x" $2 : 0 }' "/proc/$1/status")
    ((mask & 2))
}
interrupt() {
    wait_for 60 is_ready_for_int "$1"
    kill -INT "$1"
    wait "$1"
}

# A cube of 4 m seen from its middle, in flat grey photographs.
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
