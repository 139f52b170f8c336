#!/bin/bash
# run.sh NAME BUILD...: runs the tests that were built under each BUILD, all of them or those with
# NAME in their names, TEST_LANES (processors + 2) at a time. One line a test; a failing test's output follows its line.
# Last: "N passed, N failed, N skipped". Tests of build/asan and build/tsan have asan/ or tsan/ before
# their names. Of several builds these two run only what is worth its time there, and are built here, beside the tests of
# the first. With TEST_SET=check only what a change needs while it is written: unit, gradient and closed forms, and one
# small job.
#
# run.sh --slow asan|tsan: the names of those that do not run under this sanitizer.
set -u
only=$1
shift

# Too slow under a sanitizer for every day, or with nothing for it to find; `make asan` and
# `make tsan` run them all the same.
slow_asan="gradient/test_path render/test_conformance render/test_rooms render/test_listing1 api/test_demo_room
render/test_calibrate_poses render/test_emission_pattern render/test_environment render/test_specular
render/test_held_out_light render/test_large_held_out render/test_saturated_light render/test_short_time_limit render/test_sky_room
render/test_fireflies_left_out render/test_grey_card render/test_sun render/test_split api/test_resume api/test_readme
render/test_emitters render/test_hidden_lamp render/test_openings render/test_changing_light render/test_sky_doubt
render/test_reflection render/test_holes render/test_panel render/test_pose_registration
unit/test_outputs_read_back unit/test_fit unit/test_check_pictures api/test_http_faults chaos/test_clock
api/test_backup api/test_axe api/test_page api/test_page_check api/test_webhook_library unit/test_many_photographs
chaos/test_start_faults chaos/test_worker_calls chaos/test_worker_kill chaos/test_node api/test_node_site api/test_node_disk chaos/test_slurm
api/test_render api/test_render_parts chaos/test_render_kill api/test_retention render/test_calibrate_light unit/test_atlas unit/test_inverse_uv
unit/test_worker_faults chaos/test_disk_faults unit/test_attempt_faults api/test_client_sweep chaos/test_daemon_kill
chaos/test_power_cut unit/test_scheduler_faults unit/test_scheduler_retries unit/test_delivery render/test_detail
api/test_client_commands api/test_client_scripts render/test_sampling api/test_admin unit/test_user_corrections
unit/test_luminance_unit api/test_older_data"
# Names of the tests that begin no thread but those of a pool (common/parallel.h): neither they nor a header that they
# include begin one, nor does the unit of such a header.
without_own_threads() {
    local begins='pthread_create|background_start|thrd_create' headers
    headers=$({
        grep -lE "$begins" tests/*.h tests/*/*.h
        grep -rlE --include='*.c' "$begins" common server client | grep -v '^common/parallel' | sed 's/c$/h/'
    } | tr '\n' '|')
    grep -LE "$begins|${headers%|}" tests/unit/test_*.c tests/gradient/test_*.c tests/render/test_*.c |
        grep -v unit/test_parallel | sed 's|^tests/||; s|\.c$||' | tr '\n' ' '
}

# The thread sanitizer has nothing to find in one thread either, nor in the engine's loops and whole reconstructions what
# the reconstruction of a small room in api/test_webhooks does not tell.
slow_tsan="$slow_asan render/test_relight_forms render/test_sun_caustics
unit/test_checkpoint_faults unit/test_checkpoint_parts unit/test_checkpoint_damage unit/test_export unit/test_export_objects
unit/test_export_pictures unit/test_store_faults render/test_relight_runs unit/test_bundle_bad unit/test_bundle_rooms
api/test_one_job render/test_gather unit/test_checkpoint unit/test_captures api/test_client_check unit/test_bundle unit/test_segment
unit/test_evaluate api/test_metrics api/test_usd
api/test_http_durable api/test_http_threads render/test_inserts unit/test_demo
chaos/test_memory_faults api/test_node_tls api/test_scenes render/test_furnace
$(cd tests && echo fuzz/test_*.c | sed 's/\.c//g') $(without_own_threads)"

if [ "$only" = --slow ]; then
    case $1 in asan) echo $slow_asan ;; tsan) echo $slow_tsan ;; esac
    exit
fi

# What takes longest, by far: it starts before the others, so that no lane works on at the end while the rest are idle.
long="api/test_executor_examples render/test_saturated_light api/test_demo_room api/test_axe api/test_render
chaos/test_memory_faults api/test_node_site chaos/test_slurm api/test_readme render/test_rooms render/test_listing1
chaos/test_disk_faults api/test_page render/test_sky_room api/test_resume api/test_webhooks"

# What `make check` runs, as patterns of names, and what of it takes longer than the rest together.
check="unit/* gradient/* render/test_furnace render/test_principled api/test_one_job"
slow_check="unit/test_worker_faults unit/test_client_request unit/test_atlas"

# Whether a test belongs to the set that was asked for.
is_wanted() { # NAME
    local pattern
    [ "${TEST_SET:-all}" = check ] || return 0
    [[ " $slow_check " != *" $1 "* ]] || return 1
    for pattern in $check; do
        # shellcheck disable=SC2053
        [[ $1 != $pattern ]] || return 0
    done
    return 1
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
        TEST_TIMEOUT=3600 run_one "$build" make -s -j$((($(nproc) + 1) / 2)) "$name-build" SANITIZED_TESTS=quick T="$only" &&
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
    prefix= slow= sanitizer=
    case $build in
    */asan) sanitizer=asan slow=$slow_asan ;;
    */tsan) sanitizer=tsan slow=$slow_tsan ;;
    esac
    if [ -n "$sanitizer" ]; then
        prefix=$sanitizer/
        while [ $several -eq 1 ] && [ ! -e "$state/$sanitizer" ]; do sleep 0.2; done
        [ $several -eq 0 ] || [ -e "$state/$sanitizer.built" ] || continue
    fi
    while read -r name source; do
        [[ $several -eq 0 || " "${slow//$'\n'/ }" " != *" $name "* ]] || continue
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
