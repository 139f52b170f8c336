# site.sh -- for tests with a site whose scheduler is three shell scripts, and whose jobs are `unbaked node` on this machine;
# on top of client.sh: `. tests/api/site.sh BUILD`.
#
# site_make NAME SCRIPT [KEY=VALUE]...   $work/executors.d/NAME.conf; SCRIPT goes before the command in the job's script.
#                                        Keys replace those of the file. $url must be set
# $site_flags                            for daemon_start
# submit EXECUTOR ITERATIONS [ARGUMENT]...   a job of $work/room; sets $job
# is JQ-FILTER VALUE                     of the job
# node_pid                               of the newest attempt of the job
# await STATE                            of the job; seldom, since asking costs more than the job
# has_part                               the job's first attempt has sent a checkpoint
# same WHAT ATTEMPT                      the job succeeds, with what lies in $work/home, in that attempt
# shellcheck shell=bash disable=SC2034,SC2154
. tests/api/client.sh "$@"
site=$work/site
site_flags="--set executors_dir=$work/executors.d --set checkpoint_interval_sec=1"
mkdir -p "$site" "$work/executors.d"

cat >"$site/submit" <<SH2
#!/bin/bash
cat >"$site/\$1.sh"
setsid bash "$site/\$1.sh" >>"$work/nodes.log" 2>&1 &
echo \$! >"$site/\$1.pid"
cat "$site/\$1.pid"
SH2
cat >"$site/status" <<SH2 # without a process for each job: it is asked often, of all jobs that ever were
#!/bin/bash
for file in "$site"/*.pid; do
    read -r pid 2>/dev/null <"\$file" || continue
    name=\${file##*/} state=ended
    { read -r line <"/proc/\$pid/stat"; } 2>/dev/null && line=\${line##*) } && [ "\${line%% *}" != Z ] && state=running
    echo "\$pid \${name%.pid} \$state -"
done
SH2
cat >"$site/cancel" <<SH2
#!/bin/bash
kill -TERM "\$(cat "$site/\$1.pid")"
SH2
chmod +x "$site"/*

site_make() {
    local file=$work/executors.d/$1.conf script=$2 pair
    shift 2
    cat >"$file" <<CONF
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
export UNBAKE_NODE_TOKEN={token} TMPDIR=$work
$script
exec {command}
CONF
    for pair in "$@"; do sed -i "s|^${pair%%=*} = .*|${pair%%=*} = ${pair#*=}|" "$file"; done
}

submit() {
    local executor=$1 iterations=$2
    shift 2
    # shellcheck disable=SC2086
    run 0 submit -q "$work/room" ${tiny/iterations=3/iterations=$iterations} --set executor="$executor" "$@"
    job=$out
}
is() { [ "$("$build/unbake" show "$job" --json | jq -r "$1")" = "$2" ]; }
node_pid() { cat "$site/unbake-$job-"*.pid | tail -1; }
await() {
    local i
    for i in $(seq 240); do
        is .state "$1" && return
        sleep 0.5
    done
    fail "job $job is $("$build/unbake" show "$job" --json | jq -c '[.state, .reason]'), not $1"
}
has_part() { ls "$data/jobs/$job/attempt-1/checkpoint/" | grep -q part-; }
same() {
    await succeeded
    run 0 get "$job" -o "$work/out-$job"
    for name in base_color.exr roughness.exr emission.exr scene.ply; do
        cmp -s "$work/home/$name" "$work/out-$job/$name" || fail "job $job, $1: $name differs"
    done
    is .attempt "$2" || fail "$1: attempt $("$build/unbake" show "$job" --json | jq .attempt), wanted $2"
}
