#!/bin/bash
# A render in parts: at once on this machine and as jobs of a site, with a part's worker, a node and the daemon killed in
# the middle. The pictures and views.json are those of a render in one part. What is killed is slow by its files, not by
# its paths: `hold slow`.
set -u
. tests/api/site.sh "$@"
lamp="--set lamp.1.kind=sphere --set lamp.1.position=0,1,0 --set lamp.1.radius=0.3"
many="$lamp --set cameras=photographs --view all --size 64x48 --spp 8 --set format=both"
make_room "$work/room" 8
flags="--set threads=2 --set max_running=2 --set small_render_paths=100000 --set max_attempts=3"
daemon_start
site_make batch "export LD_PRELOAD=$preload UNBAKE_FAULTS=$work/faults ASAN_OPTIONS=verify_asan_link_order=0
echo {memory_mib} >>$work/memory"
daemon_end TERM
hold new "$work" || exit 1
start() { held daemon_start $flags $site_flags --set executors=process,batch; } # shellcheck disable=SC2086
start
# shellcheck disable=SC2086
run 0 submit "$work/room" $tiny --watch
field_of() { "$build/unbake" show "$1" --json | jq -c "$2"; }
# shellcheck disable=SC2086
run 0 render 1 $many --set parts=1 -q -o "$work/whole"
equal "$(field_of 2 '[.attempt, .parts]')" '[1,null]' "a render in one part"

same() { # same JOB NAME
    run 0 get "$1" -q -o "$work/$2"
    diff -r -x preview "$work/whole" "$work/$2" || fail "$2: it differs from the render in one part"
}
rendered() { [ "$("$build/unbake" show "$id" | grep -c "radiance\.exr")" -ge "$1" ]; }
workers() { grep -c "job $id: attempt [0-9]* runs as process" "$work/log"; }
pid_of() { grep "job $id: attempt $1 runs as process" "$work/log" | sed 's/.*process \([0-9]*\) .*/\1/'; }

# --- at once on this machine; the worker of one part is killed ---
hold slow 20
# shellcheck disable=SC2086
run 0 render 1 $many --set parts=2 --set executor=process -q; id=$out
wait_for 60 test -s "$data/jobs/$id/attempt-2/out/views.jsonl"
[ "$(workers)" -ge 3 ] || fail "its parts do not run at once"
equal "$(field_of "$id" '[.state, .parts.count]')" '["running",2]' "a job in parts"
kill -KILL "$(pid_of 2)"
wait_for 60 test -s "$data/jobs/$id/attempt-4/job.json"
[ "$(jq .part.done "$data/jobs/$id/attempt-4/job.json")" -ge 1 ] || fail "what the killed part had done is done again"
hold go
wait_for 120 job_is "$id" succeeded
same "$id" local
run 0 show "$id"; has "$out" "2 of 2 done"
equal "$(field_of "$id" '[.attempts_left, .parts]')" '[3,{"count":2,"done":2}]' "the job at its end"
call GET "/v1/jobs/$id/events" -H 'Last-Event-ID: 0'
has "$(cat "$work/body")" "part 1 of 2 is tried again: killed from outside"
has "$(cat "$work/body")" "part 2 of 2 is done"
equal "$(sed -n 's/^data: {"state":"\([a-z]*\)".*/\1/p' "$work/body" | xargs)" "queued running succeeded" "its states"
equal "$(curl -s "$url/v1/jobs/$id/log" | grep -c 'unbaked worker')" 0 "faults in its log"

# --- as jobs of a site: what they read is fetched, and a node is killed ---
cp "$work/room/images/1.png" "$work/sky.png"
sky="--environment $work/sky.png"
hold go
# shellcheck disable=SC2086
run 0 render 1 $many $sky --set parts=1 -q -o "$work/whole"
hold slow 20
# shellcheck disable=SC2086
run 0 render 1 $many $sky --set parts=2 --set executor=batch -q; job=$out id=$out
wait_for 60 grep -q "job $id: attempt 3 runs on" "$work/log"
kill -KILL "$(node_pid)"
hold go
wait_for 120 job_is "$id" succeeded
same "$id" at-site
[ "$(grep -c "job $id: attempt [0-9]* is lost" "$work/log")" = 1 ] || fail "no attempt, or more than one, was lost"
equal "$(find "$work/cache" -name '*.use' | wc -l)" 1 "what the cache has of its two parts"
# 125 % of what a render of so small a room takes: 64 MiB and a little, not what is asked where nothing is foretold
[ "$(sort -nu "$work/memory" | tail -1)" -lt 120 ] && [ "$(sort -nu "$work/memory" | head -1)" -gt 80 ] ||
    fail "the site is asked for $(sort -nu "$work/memory" | xargs) MiB"
cat "$work/cache/"*/files/sky.png | cmp - "$work/sky.png" || fail "the cache has no sky"

# --- in both places, and the daemon dies: parts at the site go on without it ---
hold slow 20
# shellcheck disable=SC2086
run 0 render 1 $many $sky --set parts=4 -q; job=$out id=$out
wait_for 60 rendered 2
daemon_end KILL
start
hold go
wait_for 120 job_is "$id" succeeded
same "$id" both

# --- a user's wishes are for all parts; what is done stays ---
hold slow 20
# shellcheck disable=SC2086
run 0 render 1 $many $sky --set parts=4 -q; job=$out id=$out
wait_for 60 rendered 2
run 0 pause "$id" -q
wait_for 60 job_is "$id" paused
[ -z "$(pgrep -f "unbaked worker $data/jobs/$id/")" ] || fail "a part runs though the job is paused"
run 0 resume "$id" -q
wait_for 60 job_is "$id" running
run 0 cancel "$id" -q
wait_for 60 job_is "$id" cancelled
run 0 rm "$id" -q
[ ! -e "$data/jobs/$id" ] || wait_for 20 test ! -e "$data/jobs/$id"
daemon_end TERM
[ $failures = 0 ] || cat "$work/nodes.log"
finish
