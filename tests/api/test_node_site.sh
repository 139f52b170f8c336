#!/bin/bash
# The real daemon, a site whose scheduler is two shell scripts, and `unbaked node` as its jobs: results are those of a job
# at home, whether nothing happens, or the node is killed, the daemon killed and started again, or stopped for longer than
# the lease.
set -u
. tests/api/client.sh "$@"
make_room "$work/room"
site=$work/site
mkdir -p "$site" "$work/executors.d"

cat >"$site/submit" <<SH
#!/bin/bash
cat >"$site/\$1.sh"
setsid bash "$site/\$1.sh" >>"$work/nodes.log" 2>&1 &
echo \$! >"$site/\$1.pid"
cat "$site/\$1.pid"
SH
cat >"$site/status" <<SH
#!/bin/bash
for file in "$site"/*.pid; do
    [ -e "\$file" ] || continue
    name=\$(basename "\$file" .pid)
    state=ended
    [ "\$(ps -o stat= -p "\$(cat "\$file")" | cut -c1)" = Z ] || kill -0 "\$(cat "\$file")" 2>/dev/null && state=running
    echo "\$(cat "\$file") \$name \$state -"
done
SH
cat >"$site/cancel" <<SH
#!/bin/bash
kill -TERM "\$(cat "$site/\$1.pid")"
SH
chmod +x "$site"/*

daemon_start
cat >"$work/executors.d/batch.conf" <<CONF
url = $url
node = $build/unbaked
cache = $work/cache
submit = $site/submit {name}
submit_id = {id}
status = $site/status
status_line = {id} {name} {state} {reason}
cancel = $site/cancel {name}
waiting = waiting
running = running
ended = ended
status_sec = 1
lease_sec = 6
[script]
export UNBAKE_NODE_TOKEN={token} TMPDIR=$work LD_DEBUG=statistics
exec {command}
CONF
daemon_end TERM
start() { daemon_start --set executors=process,batch --set executors_dir="$work/executors.d" --set checkpoint_interval_sec=1; }
start

# submit EXECUTOR ITERATIONS: sets $job.
submit() {
    # shellcheck disable=SC2086
    run 0 submit -q "$work/room" ${tiny/iterations=3/iterations=$2} --set executor="$1"
    job=$out
}
is() { [ "$("$build/unbake" show "$job" --json | jq -r "$1")" = "$2" ]; }
node_pid() { cat "$site/unbake-$job-"*.pid | tail -1; }
# Seldom, since asking costs more than the job.
await_success() {
    local i
    for i in $(seq 240); do
        is .state succeeded && return
        sleep 0.5
    done
    fail "job $job does not succeed"
}
# What it has made is what was made at home.
same() {
    await_success
    run 0 get "$job" -o "$work/out-$job"
    for name in base_color.exr roughness.exr emission.exr scene.ply; do
        cmp -s "$work/home/$name" "$work/out-$job/$name" || fail "job $job, $1: $name differs"
    done
    is .attempt "$2" || fail "$1: attempt $(("$build/unbake" show "$job" --json) 2>&1 | jq .attempt), wanted $2"
}
# Until the node of the job has sent a checkpoint.
has_part() { ls "$data/jobs/$job/attempt-1/checkpoint/" | grep -q part-; }

submit process 2500
await_success
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
