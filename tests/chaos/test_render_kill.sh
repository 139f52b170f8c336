#!/bin/bash
# Renders in parts whose workers, and whose daemon, are killed at random moments; in the long form parts run at a site, too,
# and nodes are killed. Every job succeeds with the bytes of a render in one part, and leaves nothing behind but its outputs.
# A render takes its time over its files, not over its paths: `hold slow`. UNBAKE_KILLS sets how often (6; in the long form 150); UNBAKE_SEED which moments.
set -u
. tests/api/site.sh "$@"
lamp="--set lamp.1.kind=sphere --set lamp.1.position=0,1,0 --set lamp.1.radius=0.3"
many="$lamp --set cameras=photographs --view all --size 64x48 --spp 8 --set format=both"
if [ -n "${UNBAKE_LONG:-}" ]; then kills=150 places=process,batch; else kills=6 places=process; fi
kills=${UNBAKE_KILLS:-$kills}
RANDOM=${UNBAKE_SEED:-1}
make_room "$work/room" 8
daemon_start
site_make batch "export LD_PRELOAD=$preload UNBAKE_FAULTS=$work/faults ASAN_OPTIONS=verify_asan_link_order=0"
daemon_end TERM
hold new "$work" || exit 1
start() {
    # shellcheck disable=SC2086
    held daemon_start --set threads=2 --set max_running=2 --set small_render_paths=100000 --set max_attempts=100 \
        $site_flags --set executors=$places
}
start
# shellcheck disable=SC2086
run 0 submit "$work/room" $tiny --watch
# shellcheck disable=SC2086
run 0 render 1 $many --set parts=1 -q -o "$work/whole"

# Processes that render for the job: its workers here, and nodes.
victims() {
    pgrep -f "unbaked worker $data/jobs/$id/"
    for file in "$site/unbake-$id-"*.pid; do
        [ -e "$file" ] && kill -0 "$(cat "$file")" 2>/dev/null && cat "$file"
    done
}
strike() {
    local list
    sleep "$((RANDOM % 2)).$((RANDOM % 10))"
    if [ $((RANDOM % 4)) = 0 ]; then
        daemon_end KILL
        start
    else
        mapfile -t list < <(victims)
        [ ${#list[@]} -gt 0 ] || return
        kill -KILL "${list[RANDOM % ${#list[@]}]}" 2>/dev/null || return
    fi
    killed=$((killed + 1))
}
killed=0 jobs=0
while [ $killed -lt "$kills" ] && [ "$failures" = 0 ]; do
    # shellcheck disable=SC2086
    run 0 render 1 $many --set parts=$((2 + RANDOM % 4)) -q
    id=$out
    before=$killed
    hold slow 20
    while [ $killed -lt "$kills" ] && [ $((killed - before)) -lt 12 ] && ! job_is "$id" succeeded; do strike; done
    hold go
    wait_for 200 job_is "$id" succeeded
    run 0 get "$id" -q -o "$work/out-$id"
    diff -r -x preview "$work/whole" "$work/out-$id" || fail "job $id: after $((killed - before)) kills it differs"
    rows=$("$build/unbake" show "$id" --json | jq -r '.outputs[].name' | sort)
    files=$(cd "$data/jobs/$id" && find . -path '*/out/*' -type f | sed 's|.*/out/||' | sort)
    equal "$files" "$rows" "job $id: what its folders hold"
    rm -r "$work/out-$id"
    jobs=$((jobs + 1))
done
daemon_end TERM
equal "$(sqlite3 "$data/state.db" 'PRAGMA integrity_check; SELECT count(*) FROM attempts WHERE phase < 2')" $'ok\n0' "the database"
echo "$jobs jobs, $killed kills"
finish
