#!/bin/bash
# The real daemon, a site whose scheduler is two shell scripts, and `unbaked node` as its jobs: results are those of a job
# at home, whether nothing happens, or the node is killed, the daemon killed and started again, or stopped for longer than
# the lease.
set -u
. tests/api/site.sh "$@"
make_room "$work/room"
daemon_start
site_make batch "export LD_DEBUG=statistics"
daemon_end TERM
# shellcheck disable=SC2086
start() { daemon_start --set executors=process,batch $site_flags; }
start

submit process 2500
await succeeded
run 0 get "$job" -o "$work/home"

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
grep -q 'has not answered for 6 s' "$work/nodes.log" || fail "the node did not give up"
[ $failures = 0 ] || cat "$work/nodes.log" "$work/log"
finish
