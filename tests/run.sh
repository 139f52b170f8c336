#!/bin/bash
# run.sh NAME BUILD...: runs the tests that were built under each BUILD, all of them or those with
# NAME in their names, TEST_LANES (processors + 2) at a time. One line a test; a failing test's output follows its line.
# Last: "N passed, N failed, N skipped". Tests under a sanitizer have asan/ or tsan/ before their names. Of
# several builds the first leaves the fuzz targets to the sanitizers; those run a short list only, and are built here,
# beside the tests of the first. With TEST_SET=check only what a change needs while it is written: unit, gradient and
# closed forms, and one small job.
#
# run.sh --short asan|tsan: that short list, as patterns of names.
set -u
only=$1
shift

# What every run has of the sanitizers, whose whole campaigns are `make asan` and `make tsan`. Of the first: what reads
# bytes from elsewhere, what gives back memory after a call has failed, and one small job. Of the second: the daemon's
# threads, its scheduler, its streams of events and the pool.
short_asan="fuzz/* unit/test_bundle_faults unit/test_image_faults unit/test_photo_faults unit/test_checkpoint_faults
unit/test_store_faults unit/test_admin_faults unit/test_deliver_faults api/test_one_job api/test_uploads"
short_tsan="unit/test_scheduler unit/test_parallel unit/test_checks unit/test_delivery_turns chaos/test_executors
chaos/test_interleavings soak/test_event_streams soak/test_slow_clients api/test_http_life api/test_http_events
api/test_http_outputs api/test_http_many_streams"

if [ "$only" = --short ]; then
    case $1 in asan) printf '%s\n' $short_asan ;; tsan) printf '%s\n' $short_tsan ;; esac
    exit
fi

# What takes longest, by far: it starts before the others, so that no lane works on at the end while the rest are idle.
long="api/test_executor_examples render/test_saturated_light api/test_demo_room api/test_axe api/test_render
chaos/test_memory_faults api/test_node_site chaos/test_slurm api/test_readme render/test_rooms render/test_listing1
chaos/test_disk_faults api/test_page render/test_sky_room api/test_resume api/test_webhooks"

# What `make check` runs, as patterns of names, and what of it takes longer than the rest together.
check="unit/* gradient/* render/test_furnace render/test_principled api/test_one_job"
slow_check="unit/test_worker_faults unit/test_client_request unit/test_atlas"

# matches NAME PATTERN...
matches() {
    local name=$1 pattern
    shift
    for pattern in "$@"; do
        # shellcheck disable=SC2053
        [[ $name != $pattern ]] || return 0
    done
    return 1
}

# Whether a test belongs to the set that was asked for.
is_wanted() { # NAME
    [ "${TEST_SET:-all}" = check ] || return 0
    matches "$1" $check && ! matches "$1" $slow_check
}

# One test: prints its line, with the seconds that it took and those of processor time, in one piece, adds its outcome to
# $outcomes and returns its status.
run_one() {
    local name=$1
    shift
    local log=$logs/${name//\//_}.log code text took used TIMEFORMAT='%R %U %S'
    { time timeout "${TEST_TIMEOUT:-600}" "$@" >"$log" 2>&1 </dev/null; } 2>"$log.time"
    code=$?
    read -r took used < <(awk '{printf "%.0f %.0f\n", $1, $2 + $3}' "$log.time")
    rm -f "$log.time"
    case $code in
    0) printf -v text 'ok    %-40s %4d s %4d s cpu\n' "$name" "$took" "$used" ;;
    77) printf -v text 'skip  %-40s %s\n' "$name" "$(tail -n 1 "$log")" ;;
    *) printf -v text 'FAIL  %-40s %4d s, exit %d\n%s\n' "$name" "$took" "$code" "$(tail -n 40 "$log" | sed 's/^/      /')" ;;
    esac
    printf '%s' "$text"
    echo "${text%% *}" >>"$outcomes"
    return $code
}

# Two more at a time than there are processors: many a test waits for a daemon more than it computes.
lanes=${TEST_LANES:-$(($(nproc) + 2))}
start_one() {
    while [ "$(jobs -pr | wc -l)" -ge "$lanes" ]; do wait -n; done
    run_one "$@" &
}

# Makes the sanitizer builds one after the other, in one lane and on half of the processors: the first's tests run beside
# it. $state/NAME is there when one has ended, and $state/NAME.built when it went well.
build_sanitized() { # BUILD...
    local build name
    for build in "$@"; do
        name=${build##*/}
        TEST_TIMEOUT=3600 run_one "$build" make -s -j$((($(nproc) + 1) / 2)) "$name-build" SANITIZED_TESTS=short &&
            touch "$state/$name.built"
        touch "$state/$name"
    done
}

count() { grep -c "^$1\$" "$outcomes"; }

# What of the sources is a test that was asked for, as "NAME SOURCE" a line, the longest first.
list_tests() {
    local source name
    for source in tests/unit/test_*.c tests/gradient/test_*.c tests/render/test_*.c \
        tests/api/test_*.c tests/api/test_*.sh tests/chaos/test_*.c tests/chaos/test_*.sh \
        tests/soak/test_*.c tests/soak/test_*.sh tests/fuzz/test_*.c tests/fuzz/test_*.sh; do
        [ -e "$source" ] || continue
        name=${source#tests/}
        name=${name%.*}
        [[ -z $only || $name == *"$only"* ]] || continue
        is_wanted "$name" || continue
        [[ " ${long//$'\n'/ } " == *" $name "* ]] && echo "0 $name $source" || echo "1 $name $source"
    done | sort -s -n -k1,1 | cut -d' ' -f2-
}

state=$(mktemp -d)
outcomes=$state/outcomes
touch "$outcomes"
trap 'rm -rf "$state"' EXIT
several=$(($# > 1))
logs=$1/logs
mkdir -p "$logs"
[ -n "$only" ] || { start_one includes tests/includes.sh; start_one format tests/format.sh; }
[ $several -eq 0 ] || build_sanitized "${@:2}" &
for build in "$@"; do
    export UNBAKE_BUILD=$build
    logs=$build/logs
    mkdir -p "$logs"
    prefix= short= sanitizer=
    case $build in
    */asan) sanitizer=asan short=$short_asan ;;
    */tsan) sanitizer=tsan short=$short_tsan ;;
    esac
    if [ -n "$sanitizer" ]; then
        prefix=$sanitizer/
        while [ $several -eq 1 ] && [ ! -e "$state/$sanitizer" ]; do sleep 0.2; done
        [ $several -eq 0 ] || [ -e "$state/$sanitizer.built" ] || continue
    fi
    while read -r name source; do
        [[ $several -eq 0 || -z $sanitizer ]] || matches "$name" $short || continue
        [[ $several -eq 0 || -n $sanitizer || $name != fuzz/* ]] || continue # under a sanitizer only
        case $source in
        *.c) start_one "$prefix$name" "$build/tests/$name" ;;
        *.sh) start_one "$prefix$name" bash "$source" "$build" ;;
        esac
    done < <(list_tests)
done

wait

if [ ! -s "$outcomes" ]; then
    echo "no test is named like '$only'" >&2
    exit 2
fi
echo "$(count ok) passed, $(count FAIL) failed, $(count skip) skipped"
[ "$(count FAIL)" -eq 0 ]
