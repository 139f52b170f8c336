#!/bin/bash
# A data folder as versions before 17 of state.db left it, with the files of all attempts of a job in one folder: what
# has ended is served as before, and a job that ran when that daemon was killed goes on from its checkpoint. Then, what all that has taken of the processors.
. tests/api/client.sh "$@"
said() { "$build/unbake" logs 2 2>/dev/null | grep -q "$1"; }

make_room "$work/room"
daemon_start --set checkpoint_interval_sec=1
run 0 submit "$work/room" $tiny --watch
run 0 submit --scene "$("$build/unbake" show 1 --json | jq -r .scene)" $endless
wait_for 60 said "checkpoint at iteration"
mkdir "$work/before"; run 0 get 1 -q -o "$work/before"
reference=$(cd "$work/before" && find . -type f | sort | xargs sha256sum)
daemon_end KILL

# --- back to what it was ---
for job in 1 2; do
    folder=$data/jobs/$job
    [ -s "$folder/attempt-1/checkpoint/checkpoint.db" ] || fail "job $job has no checkpoint: $(find "$folder")"
    mv "$folder"/attempt-1/checkpoint/* "$folder/attempt-1/out" "$folder/attempt-1/job.json" "$folder"
    rm -r "$folder/attempt-1"
done
sqlite3 "$data/state.db" "DROP TABLE attempts; DROP TABLE usage_months; DROP TABLE remote; DROP TABLE attempt_lines; DROP TABLE parts;
    DROP INDEX jobs_by_executor; DROP TRIGGER job_labels_of_new; DROP TRIGGER job_labels_of_changed;
    DROP TABLE job_labels; DROP TABLE job_files; DROP INDEX jobs_by_source; ALTER TABLE jobs DROP COLUMN executor;
    ALTER TABLE jobs DROP COLUMN kind; ALTER TABLE jobs DROP COLUMN source_id; ALTER TABLE jobs DROP COLUMN cost;
    ALTER TABLE tokens DROP COLUMN expires_ms;
    UPDATE outputs SET attempt = 7; PRAGMA user_version = 16" || fail "sqlite3"

daemon_start --set checkpoint_interval_sec=1
mkdir "$work/after"; run 0 get 1 -q -o "$work/after"
equal "$(cd "$work/after" && find . -type f | sort | xargs sha256sum)" "$reference" "the outputs of a job that had ended"
wait_for 60 said "resumed at iteration"
run 0 extend 1 --iterations 1 # from its checkpoint, too
wait_for 60 job_is 2 running
equal "$(ls "$data/jobs/1" | tr '\n' ' ')" "attempt-1 worker.log " "the folder of a job that had ended"
equal "$(ls "$data/jobs/2" | tr '\n' ' ')" "attempt-1 attempt-2 worker.log " "the folder of the job that goes on"
[ -e "$data/jobs/2/attempt-2/checkpoint/checkpoint.db" ] || fail "the second attempt has no checkpoint"
run 0 cancel 2
wait_for 60 job_is 2 cancelled
wait_for 60 job_is 1 succeeded
grep -q "the files of 2 jobs now lie in folders of their attempts" "$work/log" || fail "the log: $(cat "$work/log")"
grep -i 'warning\|error' "$work/log" | grep -v 'min_free\|low_disk' && fail "the log"
usage() { "$build/unbaked" usage --data "$data" "$@"; }
usage | awk -F, 'NR == 1 { ok = $0 == "month,user,cpu_hours" } NR > 1 { ok = ok && $1 ~ /^20[0-9][0-9]-[01][0-9]$/ && $2 == "" && $3 > 0 }
    END { exit !(ok && NR > 1) }' || fail "usage: $(usage)"
[ "$(usage --json | jq '[.items[].cpu_sec] | add > 0.1')" = true ] || fail "usage: $(usage --json)"
daemon_end TERM
equal "$(sqlite3 "$data/state.db" "SELECT job_id || ' ' || number || ' ' || executor || ' ' || phase || ' ' || ending FROM attempts ORDER BY 1" | tr '\n' ';')" \
    "1 1 process 2 ;1 2 process 2 succeeded;2 1 process 2 restarted;2 2 process 2 stopped;" "the attempts"
finish
