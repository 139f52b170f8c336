#!/bin/bash
# deploy/unbaked.service: how exposed it is, by systemd's own judgement, and that the daemon and a
# worker's sandbox work under its system call filter and say to systemd what they should.
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

real=$(realpath "$build")
mkdir "$work/bin"
printf '#!/bin/sh\nexec "%s" "%s" "%s" 3 "%s" "$@"\n' "$real/tests/api/confine" "$work/calls" "$work/notified" \
    "$real/unbaked" >"$work/bin/unbaked"
chmod +x "$work/bin/unbaked"
ln -s "$real/unbake" "$work/bin/unbake"
build=$work/bin
make_room "$work/room"
daemon_start
grep -qx READY=1 "$work/notified" || wait_for 60 grep -qx READY=1 "$work/notified" || fail "no READY=1: $(cat "$work/notified")"
run 0 submit "$work/room" --set texture_size=64 --set iterations=3 --set texels_per_iteration=256 --set report_samples=1 --watch
run 0 logs last
has "$out" "sandbox: no network, no new programs, only the job's folder is writable"
token=$("$real/unbaked" token add alice --data "$data" 2>/dev/null)
UNBAKE_TOKEN=$token run 0 list
wait_for 60 grep -qx WATCHDOG=1 "$work/notified" || fail "the watchdog is not fed"
daemon_end TERM
equal $? 0 "exit status"
equal "$(tail -n 1 "$work/notified")" STOPPING=1 "what it said last"
finish
