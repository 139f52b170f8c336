#!/bin/bash
# The example files of config/executors.d against fakes of their commands, which take what the real ones take, nothing else,
# and print what they print (with the time limit of `time_min` in each one's own unit): `unbaked executor test` submits a job, follows it to its end, submits another and cancels it.
# Then each status command prints garbage, which must not be taken for a listing.
# HTCondor 23 (condor_submit, condor_q, condor_rm), OpenPBS 23 (qsub, qstat, qdel), kubectl 1.31, OpenSSH.
. tests/api/lib.sh "$@"
build=$(realpath "$build")
mkdir -p "$work/bin" "$work/executors.d" "$work/jobs" "$work/host"

cat >"$work/bin/fake" <<'SH'
#!/bin/bash
# What all have in common: a job is a file jobs/ID with name, process, time of submission. It waits for a second.
cd "$FAKE/jobs" || exit 1
[ -e "$FAKE/garbage" ] && [[ "$0 $*" == *q\ * || "$0 $*" == *qstat* || "$*" == *get\ jobs* ]] && { echo "Error: cannot connect"; echo "-- Failed to fetch ads"; exit 0; }
usage() { echo "$(basename "$0"): unexpected: $*" >&2; exit 1; }
number() { flock "$FAKE/number" sh -c 'n=$(cat "$0"); echo $((n + 1)) >"$0"; echo $n' "$FAKE/number"; }
add() { # ID NAME COMMAND...
    local id=$1 name=$2
    shift 2
    setsid "$@" </dev/null >/dev/null 2>&1 &
    echo "$name $! $(date +%s)" >"$id"
}
state() { # ID WAITING RUNNING ENDED
    local name pid at
    read -r name pid at <"$1"
    if ! kill -0 "$pid" 2>/dev/null; then echo "$4"; elif [ $(($(date +%s) - at)) -lt 1 ]; then echo "$2"; else echo "$3"; fi
}
end() { kill -TERM -- -"$(cut -d' ' -f2 "$1")" 2>/dev/null; rm -f "$1"; }

case $(basename "$0") in
condor_submit)
    [ "$*" = "-terse -" ] || usage "$@"
    declare -A set=()
    while read -r line; do
        [ "$line" = queue ] && break
        [[ $line =~ ^\+?([A-Za-z_]+)\ *=\ *(.*)$ ]] || usage "$line"
        set[${BASH_REMATCH[1]}]=${BASH_REMATCH[2]}
    done
    [[ ${set[periodic_remove]} == *"> 60 * 1440)" ]] || usage "periodic_remove ${set[periodic_remove]}"
    [ "$line" = queue ] && [ "${set[universe]}" = vanilla ] && [ "${set[executable]}" = /bin/sh ] || usage submit file
    # the new syntax: all in double quotes, words with blanks in single ones
    [[ ${set[arguments]} =~ ^\"-c\ \'([^\'\"]*)\'\"$ ]] || usage "arguments ${set[arguments]}"
    command=${BASH_REMATCH[1]}
    [[ ${set[request_memory]},${set[request_cpus]} =~ ^[0-9]+,[0-9]+$ ]] || usage request
    [[ ${set[environment]} =~ ^\"UNBAKE_NODE_TOKEN=([0-9a-f-]*)\"$ ]] || usage "environment ${set[environment]}"
    n=$(number)
    add "$n.0" "${set[batch_name]}" env UNBAKE_NODE_TOKEN="${BASH_REMATCH[1]}" /bin/sh -c "$command"
    echo "$n.0 - $n.0"
    ;;
condor_q)
    [ "$1 $2 $3" = '-nobatch -constraint regexp("^unbake-", JobBatchName)' ] && [ "${*:4}" = "-af:j JobBatchName JobStatus HoldReason" ] || usage "$@"
    for id in *.0; do
        [ -e "$id" ] || continue
        s=$(state "$id" 1 2 4)
        [ "$s" = 4 ] || echo "$id $(cut -d' ' -f1 "$id") $s undefined"
    done
    ;;
condor_rm)
    [[ $# = 2 && $1 = -constraint && $2 =~ ^JobBatchName==\"(unbake-[a-z0-9-]+)\"$ ]] || usage "$@"
    for id in *.0; do grep -q "^${BASH_REMATCH[1]} " "$id" && end "$id" && echo "Jobs matching constraint have been marked for removal"; done
    ;;
qsub)
    [[ "$*" =~ ^-N\ (unbake-[a-z0-9-]+)\ -q\ workq\ -r\ y\ -j\ oe\ -o\ /dev/null\ -l\ select=1:ncpus=[0-9]+:mem=[0-9]+mb\ -l\ walltime=86400$ ]] || usage "$@"
    name=${BASH_REMATCH[1]} id=$(number).head
    cat >"$FAKE/$id.sh"
    head -1 "$FAKE/$id.sh" | grep -q '^#!' || usage script
    chmod +x "$FAKE/$id.sh"
    add "$id" "$name" "$FAKE/$id.sh"
    echo "$id"
    ;;
qstat)
    [ "$*" != "-q workq" ] || exit 0
    [ "$*" = "-x -w -u $(id -un)" ] || usage "$@"
    printf '\nhead: \n%-98s %s\n' "" "Req'd  Req'd   Elap"
    f='%-30s %-15s %-15s %-15s %-8s %-4s %-5s %-6s %-5s %s %s\n'
    printf "$f" "Job ID" Username Queue Jobname SessID NDS TSK Memory Time S Time
    printf "$f" ------------------------------ --------------- --------------- --------------- -------- ---- ----- ------ ----- - -----
    for id in *.head; do
        [ -e "$id" ] || continue
        s=$(state "$id" Q R F)
        name=$(cut -d' ' -f1 "$id")
        [ ${#name} -le 30 ] || name=${name:0:29}*
        [ "$s" = Q ] && session=-- elapsed=-- || session=4711 elapsed=00:00
        printf "$f" "$id" unbaked workq "$name" $session 1 4 8192mb 24:00 $s $elapsed
    done
    ;;
qdel) [[ $# = 1 && $1 = *.head && -e $1 ]] || usage "$@"; end "$1" ;;
kubectl)
    [ "$1" = --namespace=unbake ] || usage "$@"
    shift
    case "$*" in
    "create --output=name -f -")
        manifest=$(cat)
        python3 - "$manifest" <<'PY' >"$FAKE/parsed" || usage manifest
import sys, yaml
job = yaml.safe_load(sys.argv[1])
pod = job["spec"]["template"]["spec"]
box = pod["containers"][0]
assert job["apiVersion"] == "batch/v1" and job["kind"] == "Job" and job["metadata"]["labels"] == {"app": "unbake"}
assert job["spec"]["backoffLimit"] == 0 and pod["restartPolicy"] == "Never" and box["command"][:2] == ["/bin/sh", "-c"]
assert job["spec"]["activeDeadlineSeconds"] == 86400
assert isinstance(box["env"][0]["value"], str) and box["resources"]["requests"]["cpu"] == "4"
print(job["metadata"]["name"]); print(box["command"][2])
PY
        name=$(sed -n 1p "$FAKE/parsed")
        add "$name" "$name" /bin/sh -c "$(sed -n 2p "$FAKE/parsed")"
        echo "job.batch/$name"
        ;;
    "get jobs --selector=app=unbake --no-headers --output=custom-columns=ID:.metadata.uid,NAME:.metadata.name,STATE:.status.conditions[*].type")
        for id in unbake-*; do
            [ -e "$id" ] && printf '%-38s %-30s %s\n' "0b5c7a52-3f6e-4d0e-9a3e-$(echo "$id" | md5sum | cut -c1-12)" "$id" "$(state "$id" '<none>' '<none>' SuccessCriteriaMet,Complete)"
        done
        true
        ;;
    "delete job "*" --wait=false --ignore-not-found") [ ! -e "$3" ] || { end "$3"; echo "job.batch \"$3\" deleted from unbake namespace"; } ;;
    "get nodes --no-headers") echo "node1   Ready   <none>   1d   v1.31.0" ;;
    *) usage "$@" ;;
    esac
    ;;
ssh)
    [ "$1 $2 $3 $4" = "-o BatchMode=yes -o ConnectTimeout=10" ] && [ "$5" = host1 ] || usage "$@"
    [ ! -e "$FAKE/garbage" ] || { echo "ssh: connect to host host1 port 22: Connection refused" >&2; exit 255; }
    shift 5
    cd "$FAKE/host" && HOME=$FAKE/host exec sh -c "$*"
    ;;
condor_status) echo "Total 8 0 8" ;;
*) usage "$@" ;;
esac
SH
chmod +x "$work/bin/fake"
for name in condor_submit condor_q condor_rm condor_status qsub qstat qdel kubectl ssh; do ln -s fake "$work/bin/$name"; done
echo 17 >"$work/number"
cp config/executors.d/* "$work/executors.d"
sed -i -e "s,^node = .*,node = $build/unbaked," -e "s,^cache = .*,cache = $work/cache," \
    -e "s,/etc/unbaked/executors.d,$work/executors.d,g" "$work"/executors.d/*.conf
echo "host1 8" >"$work/executors.d/ssh-hosts.list"
export FAKE=$work PATH=$work/bin:$PATH

examples="htcondor pbs ssh"
python3 -c 'import yaml' 2>/dev/null && examples+=" kubectl" || echo "no yaml for python3: kubectl.conf is left out"
try() { timeout 100 "$build/unbaked" executor test "$1" --data "$work/data" --set executors_dir="$work/executors.d" --wait 20 >"$work/$1.log" 2>&1; }
for name in $examples; do try "$name" & done
wait
for name in $examples; do
    said=$(cut -c1-14 "$work/$name.log" | tr -s ' ' | tr '\n' ';')
    for step in submit running ended submit cancel gone; do
        [[ $said == *"ok $step"* ]] || fail "$name: no $step: $(cat "$work/$name.log")"
    done
    ! grep -q ^FAIL "$work/$name.log" || fail "$name: $(cat "$work/$name.log")"
done
touch "$work/garbage"
for name in $examples; do try "$name" && touch "$work/$name.taken" & done
wait
for name in $examples; do
    [ ! -e "$work/$name.taken" ] || fail "$name: garbage is taken for a listing: $(cat "$work/$name.log")"
    grep -q '^FAIL' "$work/$name.log" || fail "$name, garbage: $(cat "$work/$name.log")"
done

# What doctor finds out without a job: everything is in place; then the status command prints garbage, the program of the nodes
# is an older one, nothing can be written to the folder that they share, its clock is another, a program is gone.
rm "$work/garbage"
mkdir "$work/shared"
sed -i "1i shared = $work/shared" "$work/executors.d/pbs.conf"
sed -i "s,^url = .*,url = http://127.0.0.1:1," "$work/executors.d/pbs.conf"
doctor() { # WANTED-LINE... of those about the executor
    local line
    "$build/unbaked" doctor --data "$work/data" --set executors=process,pbs --set executors_dir="$work/executors.d" |
        grep ' executor ' >"$work/doctor"
    for line; do grep -qE "^$line" "$work/doctor" || fail "doctor has no line '$line': $(cat "$work/doctor")"; done
}
doctor 'ok +executor +pbs: qstat answers; [0-9]+ jobs' "ok +executor +pbs: $build/unbaked, .* is of this version" \
    "ok +executor +pbs: the shared folder $work/shared takes files" 'warn +executor +pbs: from here, .*127.0.0.1:1' \
    'ok +executor +pbs: .unbaked executor test pbs. tells the version and the clock'
if ! ldd "$build/unbaked" | grep -q 'lib[at]san'; then
    printf '\x64\0\0\0\0\0\0\0' >"$work/clock" # 100 s
    UNBAKE_CLOCK=$work/clock LD_PRELOAD=$build/tests/chaos/preload/clock.so \
        doctor "warn +executor +pbs: the shared folder .* its clock and this machine's are 100.0 s apart"
fi
printf '#!/bin/sh\necho "unbaked 0.0.9 (sources 0123456789abcdef)"\n' >"$work/bin/older"
chmod +x "$work/bin/older"
sed -i "s,^node = .*,node = $work/bin/older,; s,^shared = .*,shared = /proc/none," "$work/executors.d/pbs.conf"
touch "$work/garbage"
doctor 'warn +executor +pbs: .* qstat has no line as status_line says' \
    "warn +executor +pbs: $work/bin/older, .* is 0.0.9 .sources 0123456789abcdef., and this is .*: nodes of another" \
    'warn +executor +pbs: nothing can be written to the shared folder /proc/none'
rm "$work/bin/qdel"
doctor 'warn +executor +pbs: there is no program qdel'
finish
