#!/bin/bash
# A room reconstructed on nodes of a real Slurm, interrupted in every way that a site and its failures know, with the same
# textures, byte for byte, as at home: the node's process killed, its worker killed, slurmd killed, the daemon killed and
# started anew, all of them at once; the job requeued and pre-empted by the site. Then one that waits is cancelled, and is
# gone from Slurm. UNBAKE_KILLS sets how often (3); UNBAKE_SEED which, and in which order. In the long form 200 rooms, of six
# interruptions each (UNBAKE_ROOMS).
#
# Skips where there is no Slurm: deploy/install-deps.sh slurm.
set -u
build=$1
here=tests/slurm
if [ -n "${UNBAKE_LONG:-}" ]; then
    unset UNBAKE_LONG
    UNBAKE_HOME_SUMS=$(mktemp)
    export UNBAKE_HOME_SUMS UNBAKE_KILLS="${UNBAKE_KILLS:-6}"
    bad=0
    rooms=${UNBAKE_ROOMS:-200}
    for ((seed = 1; seed <= rooms; seed++)); do
        UNBAKE_SEED=$seed bash "$0" "$build"
        code=$?
        [ "$code" -ne 77 ] || exit 77
        bad=$((bad + (code > 0)))
    done
    rm -f "$UNBAKE_HOME_SUMS"
    printf 'rooms on Slurm with other textures than at home, or none\t%d\t0\tlower\n' "$bad"
    exit $((bad > 0))
fi
kills=${UNBAKE_KILLS:-3}
seed=${UNBAKE_SEED:-1}
dir=$(mktemp -d /tmp/unbake-test-slurm-XXXXXX) || exit 1
daemon=
slurm=$dir/slurm

fail() {
    echo "failed (seed $seed): $*"
    tail -n 40 "$dir"/*.log
    grep -h "error" "$slurm"/*.log 2>/dev/null | tail -n 5
    exit 1
}
# shellcheck disable=SC2317
clean_up() {
    [ -n "$daemon" ] && kill -KILL "$daemon" 2>/dev/null
    for pid in $(nodes); do kill -KILL "$pid" 2>/dev/null; done
    "$here/cluster.sh" stop "$slurm"
    rm -rf "$dir"
}
trap clean_up EXIT

# Process numbers of this test's nodes: their command lines have the folder of their cache.
nodes() { pgrep -f "[u]nbaked node .*--cache $dir/cache" 2>/dev/null; }
# start FOLDER [OPTION]...: the daemon, always on the same port.
start() {
    local folder=$1
    shift
    rm -f "$dir/port"
    "$build/unbaked" --data "$dir/$folder" --listen "127.0.0.1:$port" --port-file "$dir/port" --set threads=1 \
        --set max_attempts=100 --set checkpoint_interval_sec=0.3 --set min_free_mib=0 --set low_disk_mib=0 "$@" \
        >>"$dir/$folder.log" 2>&1 &
    daemon=$!
    for _ in $(seq 600); do
        [ -s "$dir/port" ] && return
        sleep 0.05
    done
    fail "the daemon does not start"
}
start_lab() { start lab --set executors=slurm --set "executors_dir=$dir/executors.d" --set max_running=1; }
submit() {
    "$build/unbake" submit "$dir/room" --set texture_size=128 --set iterations=60 --set gather_samples=64 \
        --set gloss_passes=1 --set texels_per_iteration=2048 --set report_samples=4 --set preview_interval_sec=60 \
        >/dev/null 2>"$dir/submit.log" || fail "submit"
}
textures() {
    (cd "$(dirname "$dir/$1"/jobs/1/attempt-*/out/base_color.exr)" && sha256sum base_color.exr roughness.exr specular.exr \
        emission.exr confidence.exr base_color.png scene.ply scene.glb scene.obj scene.mtl scene.xml scene.serialized) ||
        fail "no textures in $1"
}
shown() { "$build/unbake" show "$1" --json 2>/dev/null | jq -r "$2"; }

"$here/cluster.sh" start "$slurm" 2 >"$dir/cluster.log" 2>&1
code=$?
[ "$code" -eq 77 ] && { cat "$dir/cluster.log"; exit 77; }
[ "$code" -eq 0 ] || fail "Slurm does not start"
# shellcheck disable=SC1091
. "$slurm/env"
port=$(sed -n 's/^SlurmctldPort=//p' "$slurm/slurm.conf")
port=$((port - 10000)) # cluster.sh takes those from 20000 on
export UNBAKE_SERVER=http://127.0.0.1:$port
mkdir "$dir/executors.d"
sed -e "s|^url = .*|url = $UNBAKE_SERVER|; s|^node = .*|node = $(realpath "$build")/unbaked|" \
    -e "s|^cache = .*|cache = $dir/cache|; s|^threads = .*|threads = 1|; s|^memory_mib = .*|memory_mib = 1000|" \
    -e "s|^memory_percent = .*|status_sec = 1\nlease_sec = 4|" config/executors.d/slurm.conf >"$dir/executors.d/slurm.conf"

"$build/unbaked" demo-room "$dir/room" --frames 8 --test-frames 1 --spp 4 --test-spp 4 --width 64 --height 48 \
    >"$dir/room.log" 2>&1 || fail "the demo room"
if [ -n "${UNBAKE_HOME_SUMS:-}" ] && [ -s "$UNBAKE_HOME_SUMS" ]; then
    cp "$UNBAKE_HOME_SUMS" "$dir/home.sums"
else
    start home
    submit
    "$build/unbake" watch 1 >/dev/null 2>&1 || fail "the job at home"
    kill "$daemon" && wait "$daemon"
    daemon=
    textures home >"$dir/home.sums"
    [ -z "${UNBAKE_HOME_SUMS:-}" ] || cp "$dir/home.sums" "$UNBAKE_HOME_SUMS"
fi

# --- interruptions ---------------------------------------------------------------------------

job_of_slurm() { squeue --me --noheader --states=RUNNING,PENDING --format='%i %j' | awk '/ unbake-/ { print $1 }' | tail -n 1; }
kill_node() { for pid in $(nodes); do kill -KILL "$pid"; done; }
kill_worker() { for pid in $(nodes); do pkill -KILL -P "$pid"; done; }
kill_slurmd() {
    for node in n1 n2; do
        kill -KILL "$(cat "$slurm/slurmd-$node.job")"
        "$here/cluster.sh" slurmd "$slurm" "$node"
    done
}
kill_daemon() {
    kill -KILL "$daemon"
    wait "$daemon" 2>/dev/null
    sleep "0.$((RANDOM % 10))"
    start_lab
}
stop_daemon() {
    kill "$daemon"
    wait "$daemon" || fail "the daemon does not stop"
    start_lab
}
kill_all() { kill_node; kill_slurmd; kill_daemon; }
requeue() { scontrol requeue "$(job_of_slurm)" 2>/dev/null; }
preempt() { sbatch --partition=urgent --nodes=2 --exclusive --output=/dev/null --wrap 'sleep 1' >/dev/null; }
step() { scancel --signal=KILL --full "$(job_of_slurm)" 2>/dev/null; }
ways=(kill_node kill_worker kill_slurmd kill_daemon stop_daemon kill_all requeue preempt step)

RANDOM=$seed
start_lab
submit
did=""
for ((i = 0; i < kills; i++)); do
    # It runs, and most times it has got further.
    for _ in $(seq 1200); do
        [ -n "$(nodes)" ] && break
        case $(shown 1 .state) in succeeded | failed) break ;; esac
        sleep 0.05
    done
    case $(shown 1 .state) in succeeded | failed) break ;; esac
    sleep "$((RANDOM % 2)).$((RANDOM % 10))"
    way=${ways[$((RANDOM % ${#ways[@]}))]}
    did="$did $way"
    "$way"
done
# Five that are lost in a row end a job: its user starts it again, and it goes on from where it was.
for _ in $(seq 3000); do
    case $(shown 1 .state) in
    succeeded | cancelled | paused) break ;;
    failed) "$build/unbake" retry 1 >/dev/null 2>&1 || fail "retry" ;;
    esac
    sleep 0.1
done
[ "$(shown 1 .state)" = succeeded ] || fail "after$did the job is $(shown 1 .state): $(shown 1 .reason)"
textures lab >"$dir/lab.sums"
cmp "$dir/home.sums" "$dir/lab.sums" || fail "after$did the textures differ from those at home"
echo "$(shown 1 .attempt) attempts:$did"

# --- one that waits --------------------------------------------------------------------------

if [ "$kills" -eq 3 ]; then
    sbatch --partition=urgent --nodes=2 --exclusive --output=/dev/null --wrap 'sleep 60' >/dev/null
    submit
    for _ in $(seq 200); do
        case $(shown 2 .reason) in "waiting in slurm: "*) break ;; esac
        sleep 0.1
    done
    case $(shown 2 .reason) in "waiting in slurm: "*) ;; *) fail "the reason of a job that waits is \"$(shown 2 .reason)\"" ;; esac
    "$build/unbake" list | grep -q '^ *2  running .* waiting ' || fail "the list does not say that it waits: $("$build/unbake" list)"
    "$build/unbake" cancel 2 >/dev/null 2>&1 || fail "cancel"
    for _ in $(seq 200); do
        [ -z "$(job_of_slurm)" ] && [ "$(shown 2 .state)" = cancelled ] && break
        sleep 0.1
    done
    [ -z "$(job_of_slurm)" ] || fail "a cancelled job is still in Slurm"
    [ "$(shown 2 .state)" = cancelled ] || fail "a cancelled job is $(shown 2 .state)"
fi
kill "$daemon" && wait "$daemon" || fail "the daemon did not stop cleanly"
daemon=
