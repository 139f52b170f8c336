#!/bin/bash
# A daemon that nobody asks anything, with a finished job behind it: what it holds of memory (30 MiB at
# most) and takes of a processor (0.1 % at most). UNBAKE_SECONDS sets for how long (3; in the long form 120).
set -u
. tests/api/client.sh "$@"
if ldd "$build/unbaked" | grep -q 'lib[at]san'; then
    echo "a sanitizer has memory and threads of its own"
    exit 77
fi
if [ -n "${UNBAKE_LONG:-}" ]; then seconds=120; else seconds=3; fi
seconds=${UNBAKE_SECONDS:-$seconds}

# Nanoseconds on a processor, of all threads.
used() { cat "/proc/$daemon_pid/task"/*/schedstat | awk '{ sum += $1 } END { printf "%.0f\n", sum }'; }

make_room "$work/room"
daemon_start
run 0 submit "$work/room" $tiny --watch -q
# First what the job has left to do: until a second has brought a millisecond of work at most.
for _ in $(seq 30); do
    before=$(used)
    sleep 1
    [ $(($(used) - before)) -gt 1000000 ] || break
done
before=$(used)
sleep "$seconds"
after=$(used)
mib=$(awk '/^VmRSS/ { printf "%.1f", $2 / 1024 }' "/proc/$daemon_pid/status")
percent=$(awk -v ns=$((after - before)) -v sec="$seconds" 'BEGIN { printf "%.4f", ns / sec / 1e7 }')
printf 'idle daemon: MiB\t%s\t30\tlower\n' "$mib"
printf 'idle daemon: %% of a processor\t%s\t0.1\tlower\n' "$percent"
[ "$before" -gt 0 ] || fail "no time of a processor is told"
awk -v mib="$mib" -v percent="$percent" 'BEGIN { exit !(mib <= 30 && percent <= 0.1) }' || fail "$mib MiB, $percent %"
stop_daemon
equal "$daemon_status" 0 "exit status"
finish
