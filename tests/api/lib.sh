# lib.sh -- for tests that drive the real daemon: `. tests/api/lib.sh BUILD`.
#
# start_daemon [FLAG...]   on a free port with a data folder of its own; sets $url, $daemon_pid
# stop_daemon              SIGTERM; waits; sets $daemon_status
# call METHOD PATH [curl argument...]   sets $status; the reply is in $work/body, $work/head
# expect STATUS WHAT       the last call's status
# field JQ-FILTER          of the last call's body
# equal FOUND WANTED WHAT
# finish                   last line of a test: its exit status

build=${1:-${UNBAKE_BUILD:-build}}
work=$(mktemp -d "${TMPDIR:-/tmp}/unbake-api-XXXXXX")
data=$work/data
daemon_pid=
failures=0
url=

cleanup() {
    [ -n "$daemon_pid" ] && kill -KILL "$daemon_pid" 2>/dev/null
    [ -n "${background:-}" ] && kill $background 2>/dev/null
    [ -n "${mounted:-}" ] && umount "$mounted"
    [ -n "${group:-}" ] && rmdir "$group" 2>/dev/null
    rm -rf "$work"
}
trap cleanup EXIT

fail() {
    echo "line ${BASH_LINENO[-2]}: $*" # of the test itself, however deep this was called
    failures=$((failures + 1))
}

equal() { [ "$1" = "$2" ] || fail "${3:-value} is '$1', wanted '$2'"; }

# wait_for SECONDS COMMAND...: until it succeeds.
wait_for() {
    local left=$(($1 * 10))
    shift
    until "$@" >/dev/null 2>&1; do
        left=$((left - 1))
        [ "$left" -gt 0 ] || { fail "still not after a long wait: $*"; return 1; }
        sleep 0.1
    done
}

daemon_listens_or_ended() { [ -s "$work/port" ] || ! kill -0 "$daemon_pid"; }

start_daemon() {
    rm -f "$work/port"
    "$build/unbaked" --data "$data" --listen 127.0.0.1:0 --port-file "$work/port" --set min_free_mib=1 --set low_disk_mib=1 \
        "$@" >"$work/stdout" 2>>"$work/log" &
    daemon_pid=$!
    if ! wait_for 60 daemon_listens_or_ended || [ ! -s "$work/port" ]; then
        cat "$work/log"
        exit 1
    fi
    url=http://127.0.0.1:$(cat "$work/port")
}

stop_daemon() {
    kill -TERM "$daemon_pid"
    wait "$daemon_pid"
    daemon_status=$?
    daemon_pid=
}

call() {
    local method=$1 path=$2
    shift 2
    [ "$method" = HEAD ] && set -- -I "$@"
    : >"$work/head"
    : >"$work/body"
    status=$(curl -sS -m 60 -X "$method" -o "$work/body" -D "$work/head" -w '%{http_code}' "$@" "$url$path" 2>"$work/curl")
}

expect() { [ "$status" = "$1" ] || fail "${2:-status} is $status, wanted $1: $(head -c 600 "$work/body") $(cat "$work/curl")"; }

field() { jq -r "$1" "$work/body"; }

header() { sed -n "s/^$1: \(.*\)\r$/\1/Ip" "$work/head"; }

json() { printf %s "$1" >"$work/request"; echo "@$work/request"; }

finish() {
    [ "$failures" -eq 0 ] || [ ! -e "$work/log" ] || { echo "--- the daemon's log ends:"; tail -n 15 "$work/log"; }
    exit $((failures > 0))
}
