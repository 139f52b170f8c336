#!/bin/bash
# A backup with outputs while the daemon runs a job and things are removed, and a daemon on what is restored from it: it
# serves the same bytes. What is damaged, and what is in the way, is told.
. tests/api/client.sh "$@"
unbaked() { "$build/unbaked" "$@" >"$work/out" 2>"$work/err"; }
refused() { # WANTED-STATUS PART COMMAND...
    local wanted=$1 part=$2
    shift 2
    "$@"
    equal $? "$wanted" "exit status of $*"
    grep -qF -- "$part" "$work/err" || fail "$*: $(cat "$work/err")"
}
quick=$tiny

mkdir -m 750 "$data"
make_room "$work/room"
daemon_start --set max_running=2
run 0 submit "$work/room" $quick --watch
run 0 submit --scene "$("$build/unbake" show 1 --json | jq -r .scene)" $quick --watch
run 0 submit --scene "$("$build/unbake" show 1 --json | jq -r .scene)" $endless
wait_for 60 job_is 3 running
head -c 300000 /dev/urandom >"$work/part"
call POST /v1/uploads -H 'Tus-Resumable: 1.0.0' -H 'Upload-Length: 1000000' -H 'Content-Length: 0'; expect 201
mkdir "$work/before"; run 0 get 1 -q -o "$work/before"
reference=$(cd "$work/before" && find . -type f | sort | xargs sha256sum)

# --- jobs come and go while it is made: what the copy's database names is there, nothing else is ---
churn() {
    local id i
    for i in 1 2; do
        id=$("$build/unbake" submit --scene "$(jq -r .scene <<<"$1")" $quick -q) || return
        "$build/unbake" watch "$id" -q >/dev/null
        "$build/unbake" rm "$id" -q
    done
}
churn "$("$build/unbake" show 1 --json)" & background=$!
for n in 1 2; do
    unbaked backup --with-outputs "$work/copy$n" --data "$data" || fail "backup $n: $(cat "$work/err")"
    (cd "$work/copy$n" && sha256sum --quiet -c SHA256SUMS) || fail "backup $n is not what its list says"
    wanted=$(sqlite3 "$work/copy$n/state.db" "SELECT job_id || '/attempt-' || outputs.attempt || '/out/' || outputs.name FROM outputs JOIN jobs ON jobs.id = job_id
        WHERE jobs.state IN (3, 4, 5) ORDER BY 1")
    for name in $wanted; do [ -e "$work/copy$n/jobs/$name" ] || fail "backup $n lacks $name"; done
    for id in $(ls "$work/copy$n/jobs"); do
        [ "$(sqlite3 "$work/copy$n/state.db" "SELECT count(*) FROM jobs WHERE id = $id")" = 1 ] || fail "backup $n has job $id"
    done
done
wait "$background"; background=
grep -q 'outputs; .* files with .* bytes' "$work/out" || fail "backup says: $(cat "$work/out")"
equal "$(stat -c %a "$work/copy1")" 700 "mode of a backup"
equal "$(ls -d "$work"/copy*part* 2>/dev/null)" "" "parts of backups"
[ ! -e "$work/copy1/jobs/3/attempt-1/checkpoint/checkpoint.db" ] || fail "the checkpoint of a job that runs is in the backup"
[ -e "$work/copy1/jobs/1/attempt-1/checkpoint/checkpoint.db" ] || fail "a checkpoint is not in the backup"
[ "$data/jobs/1/attempt-1/checkpoint/checkpoint.db" -ef "$work/copy1/jobs/1/attempt-1/checkpoint/checkpoint.db" ] && fail "a checkpoint is linked"
refused 1 'is there already' unbaked backup --with-outputs "$work/copy1" --data "$data"

# --- removed here, served there ---
run 0 rm 1
[ ! -e "$data/jobs/1" ] || fail "job 1 is still there"
daemon_end TERM
refused 1 'is not empty' unbaked restore "$work/copy1" "$data"
refused 2 'is not a folder that' unbaked restore "$work/copy1/state.db" "$work/new"
refused 2 'usage' unbaked restore "$work/copy1"
unbaked restore "$work/copy1" "$work/restored" || fail "restore: $(cat "$work/err")"
grep -q 'all digests match' "$work/out" || fail "restore says: $(cat "$work/out")"
old=$data data=$work/restored
daemon_start --set max_running=2
run 0 show 1
mkdir "$work/after"; run 0 get 1 -q -o "$work/after"
equal "$(cd "$work/after" && find . -type f | sort | xargs sha256sum)" "$reference" "the outputs of the restored job"
wait_for 60 job_is 3 running # anew
run 0 extend 2 --iterations 1
run 0 watch 2 -q
daemon_end TERM
grep -qi "warning\|error" <(grep -v 'min_free\|low_disk' "$work/log") && fail "the log: $(grep -i 'warning\|error' "$work/log")"

# --- damage ---
cp -a "$work/copy2" "$work/damaged"
target=$work/damaged/jobs/2/attempt-1/out/report.json
cp --remove-destination "$target" "$work/whole"; rm "$target"; sed 's/0/1/' "$work/whole" >"$target"
rm "$work/damaged/jobs/2/attempt-1/out/scene.glb"
refused 1 '2 files' unbaked restore "$work/damaged" "$work/none"
grep -q "report.json is damaged" "$work/err" || fail "$(cat "$work/err")"
equal "$(ls -A "$work/none")" "" "what is left of a restore that failed"
refused 1 'scene.glb is missing' unbaked restore --skip-damaged "$work/damaged" "$work/none"
grep -q 'without those named above' "$work/out" || fail "restore says: $(cat "$work/out")"
[ ! -e "$work/none/jobs/2/attempt-1/out/report.json" ] && [ -e "$work/none/jobs/2/attempt-1/out/base_color.exr" ] && [ -e "$work/none/state.db" ] ||
    fail "what --skip-damaged restored"
echo "$(printf '0%.0s' $(seq 64))  ../escaped" >>"$work/damaged/SHA256SUMS"
refused 2 'SHA256SUMS:' unbaked restore "$work/damaged" "$work/climbed"
[ ! -e "$work/escaped" ] || fail "a path led out"
# In the data folder itself: told, and the rest is kept. A link in the place of an output is not followed.
data=$old
rm "$data/jobs/2/attempt-1/out/report.html"; ln -s /etc/passwd "$data/jobs/2/attempt-1/out/report.html"
refused 1 'report.html is missing' unbaked backup --with-outputs "$work/copy4" --data "$data" # without a daemon
[ -e "$work/copy4/jobs/2/attempt-1/out/base_color.exr" ] && [ ! -e "$work/copy4/jobs/2/attempt-1/out/report.html" ] || fail "a backup of damage"
finish
