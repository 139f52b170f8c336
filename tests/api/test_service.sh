#!/bin/bash
# deploy/unbaked.service: how exposed it is, by systemd's own judgement, and that everything works inside: a worker's
# sandbox, webhooks, backup, TLS, uploads and jobs that are cut off, and what is said to systemd. confine.c does what
# systemd would; as root also to the view of files.
set -u
command -v systemd-analyze >/dev/null || { echo "there is no systemd-analyze"; exit 77; }
. tests/api/client.sh "$@"
unit=deploy/unbaked.service

exposure=$(systemd-analyze security --offline=true "$unit" 2>/dev/null | sed -n 's/.*exposure level for .*: \([0-9.]*\) .*/\1/p')
echo "exposure $exposure"
awk -v found="${exposure:-10}" 'BEGIN { exit !(found <= 2.0) }' || fail "exposure is $exposure, 2.0 or less is wanted"
if systemd-analyze verify --help >/dev/null 2>&1; then
    sed 's|^ExecStart=[^ ]*|ExecStart=/bin/true|; s|^User=.*||' "$unit" >"$work/unbaked.service"
    said=$(systemd-analyze verify --man=no "$work/unbaked.service" 2>&1 | grep unbaked.service)
    equal "$said" "" "what systemd-analyze verify says"
fi
grace=$(sed -n 's/^stop_grace_sec = //p' config/unbaked.conf)
stop=$(sed -n 's/^TimeoutStopSec=//p' "$unit")
[ "$stop" -gt "$grace" ] || fail "TimeoutStopSec=$stop is not longer than stop_grace_sec = $grace"

# --- its filter: SystemCallFilter= lines with the sets taken apart ---
case $build in *asan | *tsan) echo "a sanitizer's runtime needs other system calls"; finish ;; esac
expand() {
    local name
    for name in "$@"; do
        case $name in
        @*) expand $(systemd-analyze syscall-filter "$name" 2>/dev/null | sed '1d; s/#.*//') ;;
        *) echo "$name" ;;
        esac
    done
}
allowed=$(sed -n 's/^SystemCallFilter=\([^~].*\)/\1/p' "$unit")
denied=$(sed -n 's/^SystemCallFilter=~\(.*\)/\1/p' "$unit")
expand $allowed @default | sort -u >"$work/allowed"
expand $denied | sort -u >"$work/denied"
# A set in the second list takes away what the first has let in, but never what @default has.
expand @default | sort -u | comm -23 "$work/denied" - >"$work/taken"
comm -23 "$work/allowed" "$work/taken" >"$work/calls"
[ "$(wc -l <"$work/calls")" -gt 200 ] || fail "only $(wc -l <"$work/calls") system calls"

# --- the daemon in the unit's whole view of the system; what hides something there has hidden a feature before ---
real=$(realpath "$build")
mkdir "$work/bin"
printf '#!/bin/sh\nexec "%s" "%s" "%s" "%s" "%s" "%s" "$@"\n' "$real/tests/api/confine" "$PWD/$unit" "$work/calls" \
    "$work/notified" "$work" "$real/unbaked" >"$work/bin/unbaked"
chmod +x "$work/bin/unbaked"
ln -s "$real/unbake" "$work/bin/unbake"
build=$work/bin
[ "$(id -u)" -eq 0 ] || echo "only root can give the daemon the unit's view of files: its system calls alone are tested"
make_room "$work/room"
quick=$tiny
"$real/tests/api/hook" a-secret-of-sixteen-bytes >"$work/hook" & background=$!
wait_for 60 test -s "$work/hook"

daemon_start --set webhook_private=yes
grep -qx READY=1 "$work/notified" || wait_for 60 grep -qx READY=1 "$work/notified" || fail "no READY=1: $(cat "$work/notified")"
if [ "$(id -u)" -eq 0 ]; then # it is what it should be
    inside=/proc/$(pgrep -P "$daemon_pid")
    view=$inside/root # of the file system, as the daemon has it
    [ ! -e "$view/proc/vmstat" ] || fail "/proc/vmstat is seen"
    for hidden in home root; do # ProtectHome: empty, whatever is there
        [ -z "$(ls -A "$view/$hidden")" ] || fail "/$hidden is seen"
    done
    equal "$(sed -n 's/^CapBnd:\s*//p' "$inside/status")" 0000000000000000 "capabilities"
    awk '$5 == "/" && $6 !~ /^ro/ { bad = 1 } END { exit bad }' "$inside/mountinfo" || fail "/ is writable"
fi
UNBAKE_WEBHOOK_SECRET=a-secret-of-sixteen-bytes run 0 submit "$work/room" $quick --webhook "http://localhost:$(head -n 1 "$work/hook")/" --watch
run 0 logs last
has "$out" "sandbox: no network, no new programs, only the job's folder is writable"
wait_for 60 grep -q '"state":"succeeded"' "$work/hook"
token=$("$real/unbaked" token add alice --role admin --data "$data" 2>/dev/null)
export UNBAKE_TOKEN=$token
run 0 list
"$real/unbaked" backup "$work/copy.db" --data "$data" 2>"$work/said" && [ -s "$work/copy.db" ] || fail "backup: $(cat "$work/said")"
wait_for 60 grep -qx WATCHDOG=1 "$work/notified" || fail "the watchdog is not fed"

# Bytes of an upload that a killed daemon has received and not yet counted.
call POST /v1/uploads -H "Authorization: Bearer $token" -H 'Tus-Resumable: 1.0.0' -H 'Upload-Length: 7000000'
expect 201; upload=$(header location)
exec 3<>"/dev/tcp/127.0.0.1/$port"
printf 'PATCH %s HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer %s\r\nTus-Resumable: 1.0.0\r\nContent-Type: application/offset+octet-stream\r\nUpload-Offset: 0\r\nContent-Length: 7000000\r\n\r\n' "$upload" "$token" >&3
head -c 6000000 /dev/zero >&3
wait_for 60 sh -c "[ \$(stat -c %s '$data/uploads/${upload##*/}') -ge 6000000 ]"
kill -KILL "$(pgrep -P "$daemon_pid")"
wait "$daemon_pid" 2>/dev/null
exec 3>&-
if command -v openssl >/dev/null; then # from here on by TLS
    openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 2 -subj /CN=localhost \
        -addext subjectAltName=IP:127.0.0.1 -keyout "$work/key" -out "$work/cert" 2>/dev/null
    export UNBAKE_CA=$work/cert CURL_CA_BUNDLE=$work/cert
    daemon_start --set tls_certificate="$work/cert" --set tls_key="$work/key"
    url=https://127.0.0.1:$port UNBAKE_SERVER=https://127.0.0.1:$port
else
    daemon_start
fi
run 0 list
call HEAD "$upload" -H "Authorization: Bearer $token" -H 'Tus-Resumable: 1.0.0'
expect 200; equal "$(header upload-offset)" 6000000 "offset after a crash"

# A worker that the kernel kills for want of memory.
source tests/api/memory_group.sh
if memory_group $((120 << 20)) "$(pgrep -P "$daemon_pid")"; then
    run 0 submit "$work/room" --set texture_size=4096
    wait_for 60 grep -q 'attempt 1 broke off: killed by the kernel, which ran out of memory' "$work/log"
    wait_for 60 sh -c "'$real/unbake' logs last 2>/dev/null | grep -q 'warning: 1 thread, texels_per_iteration'" # the next one
    "$real/unbake" cancel last >/dev/null 2>&1 # unless it has failed meanwhile
else
    echo "no memory cgroup to be had: kills for want of memory are not tested"
fi
daemon_end TERM
equal $? 0 "exit status"
equal "$(tail -n 1 "$work/notified")" STOPPING=1 "what it said last"
finish
