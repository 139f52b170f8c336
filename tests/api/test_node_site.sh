#!/bin/bash
# The real daemon, a site whose scheduler is two shell scripts, and `unbaked node` as its jobs: results are those of a job
# at home, whether nothing happens, or the node is killed, or stands still for longer than its lease, or the daemon is killed
# and started again, or stopped for so long.
set -u
. tests/api/site.sh "$@"
make_room "$work/room"
daemon_start
site_make batch "export LD_DEBUG=statistics" lease_sec=4
daemon_end TERM
# shellcheck disable=SC2086
start() { daemon_start --set executors=process,batch $site_flags; }
start

submit process 2500
await succeeded
run 0 get "$job" -o "$work/home"

# A node that stands still while its site believes that it runs: at the end of this test it goes on, after its lease.
submit batch 2500
frozen=$job
wait_for 60 has_part
frozen_pid=$(node_pid)
kill -STOP "$frozen_pid"

submit batch 2500
same "undisturbed" 1
# What the worker has printed there is where that of workers here is.
grep -q "runtime linker statistics" "$data/jobs/$job/worker.log" || fail "the worker's log: $(ls -R "$data/jobs/$job")"
[ ! -e "$data/jobs/$job/attempt-1/worker.log" ] || fail "the log of the attempt is left over"

submit batch 2500
wait_for 60 has_part
kill -KILL "$(node_pid)"
same "node killed" 2

submit batch 2500
wait_for 60 has_part
daemon_end KILL
start
same "daemon killed" 1

submit batch 2500
wait_for 60 has_part
kill -STOP "$daemon_pid"
wait_for 60 bash -c "! kill -0 $(node_pid)"
kill -CONT "$daemon_pid"
same "daemon silent for a lease" 2
grep -q 'has not answered for 4 s' "$work/nodes.log" || fail "the node did not give up"

job=$frozen
is_told() { is .reason "$(hostname) has been silent for 6 s; batch still has the job"; }
wait_for 60 is_told
is .attempt 1 || fail "the attempt was given up while its site had it"
kill -CONT "$frozen_pid"
same "node stood still" 2
[ $failures = 0 ] || cat "$work/nodes.log" "$work/log"
finish
