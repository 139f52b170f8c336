#!/bin/bash
# Many rooms and settings in one command: submit ROOM... --matrix, their group, list --label, compare.
. tests/api/client.sh "$@"
quick=${tiny/--set iterations=3 /}

# so FILTER: $out must be JSON, and FILTER true of it.
so() {
    jq -e "$1" <<<"$out" >/dev/null 2>&1 || fail "not so: $1: $out"
}
all_are() { # JOBS STATE
    [ "$("$build/unbake" list --label group --limit 0 --json | jq "[.[] | select(.state == \"$2\")] | length")" = "$1" ]
}

make_room "$work/kitchen"
make_room "$work/hall" 7
daemon_start

# --- mistakes: nothing is sent ----------------------------------------------------------------------

run 2 submit
run 2 submit "$work/kitchen" --scene 12345678
run 2 submit "$work/kitchen" --matrix seed
has "$err" "is not of the form key=value,value"
run 2 submit "$work/kitchen" --matrix seed=1,,2
run 2 submit "$work/kitchen" --matrix seed=1,2 --matrix seed=3
has "$err" "given twice"
run 2 submit "$work/kitchen" --matrix seed=1,2 --set seed=3
has "$err" "in --set and in --matrix"
run 2 submit "$work/kitchen" --matrix "seed=$(seq -s, 40)" --matrix "max_depth=$(seq -s, 2 32)"
has "$err" "more than 1024 combinations"
run 4 submit "$work/kitchen" --matrix texture_sise=64,128
has "$err" "texture_size"
run 4 submit "$work/kitchen" "$work/hall" --matrix texture_size=64,63
equal "$(grep -c texture_size <<<"$err")" 1 # the same is wrong for all rooms: it is said once
run 0 scenes --json
so '. == []'

# --- two rooms, two by two settings -----------------------------------------------------------------

run 0 submit "$work/kitchen" "$work/hall" $quick --matrix iterations=1,2 --matrix seed=1,7 --dry-run --json
equal "$(jq -s 'map([.settings.iterations, .settings.seed]) == [[1,1],[1,7],[2,1],[2,7],[1,1],[1,7],[2,1],[2,7]]' <<<"$out")" true
run 0 list --json
so '. == []'
run 0 submit "$work/kitchen" "$work/hall" $quick --matrix iterations=1,2 --matrix seed=1,7 --label group=flat --label who=me
has "$err" "8 jobs are queued. \`unbake compare group=flat\`"
has "$out" "job 1 is queued: kitchen iterations=1 seed=1 ("
has "$out" "job 8 is queued: hall iterations=2 seed=7 ("
equal "$(grep -c "has this room already" <<<"$err")" 2 # the dry run has sent them
run 0 scenes --json
so 'length == 2'

# The same again queues nothing; one more value queues what is new. A job that was cancelled may be tried again.
run 0 submit "$work/kitchen" "$work/hall" $quick --matrix iterations=1,2 --matrix seed=1,7 --label group=flat --label who=me
equal "$out" ""
has "$err" "0 jobs are queued; 8 in the group already"
wait_for 120 all_are 8 succeeded
run 0 submit "$work/kitchen" $quick --matrix iterations=1,2,3 --set seed=1 --label group=flat -q
equal "$out" 9

# --- listed by label ---------------------------------------------------------------------------------

run 0 list --label group=flat --json
so 'length == 9 and .[0].id == 9 and .[0].labels.group == "flat"'
run 0 list --label who -q
equal "$(wc -l <<<"$out")" 8
run 0 list --label group=flat --state cancelled --json
so '. == []'
run 0 list --label group=other -q
equal "$out" ""
run 4 list --label =x
get() { curl -sS -w '\n%{http_code}' "$url$1"; }
equal "$(get '/v1/jobs?label=group%3Dflat&limit=4' | head -n 1 | jq -c '[.items[].id], .next')" $'[9,8,7,6]\n"6"'
equal "$(get '/v1/jobs?label=group%3Dflat&limit=200&cursor=6' | head -n 1 | jq -c '[.items[].id], .next')" $'[5,4,3,2,1]\nnull'
equal "$(get '/v1/jobs?label=' | tail -n 1)" 400
equal "$(get "/v1/jobs?label=$(printf 'x%.0s' {1..300})" | tail -n 1)" 400
run 0 edit 9 --label group=other
run 0 list --label group=other -q
equal "$out" 9
run 0 list --label group=flat -q
equal "$(wc -l <<<"$out")" 8

# --- compared ----------------------------------------------------------------------------------------

run 0 compare group=flat
equal "$(head -n 1 <<<"$out" | tr -s ' ')" "job state iterations seed time psnr_db ssim msre name" "the headings of a comparison"
equal "$(sed -n 4p <<<"$out" | tr -s ' ' | sed 's/^ //' | cut -d' ' -f 1-4)" "3 succeeded 2 1"
equal "$(wc -l <<<"$out")" 9
run 0 compare group=flat 9 1 --json
so 'length == 9 and .[0].id == 1 and .[8].id == 9 and (map(select(.figures.psnr_db > 0)) | length) >= 8'
run 0 get 3 report.json -o "$work/report"
run 0 compare 3 --json
equal "$(jq '.[0].figures.msre' <<<"$out")" "$(jq .metrics.msre "$work/report/report.json")"
run 0 rm 8
run 0 list --label group=flat -q
equal "$(wc -l <<<"$out")" 7
run 3 compare group=nothing
run 3 compare 99
run 2 compare

# --- a room that fails does not keep the others, and the command says so ------------------------------

mkdir "$work/empty"
echo nothing >"$work/empty/README"
run 4 submit "$work/empty" "$work/nowhere" "$work/kitchen" --set texture_size=64 --dry-run
has "$err" "$work/empty: no job is queued for it"
has "$out" "the settings are accepted: kitchen"
run 4 submit "$work/empty" "$work/nowhere" "$work/kitchen" $quick --matrix iterations=1 --json
equal "$(jq -s 'length' <<<"$out")" 1
so '.labels.group | length == 8'
equal "$(jq -s '.[0].room' <<<"$err")" "\"$work/empty\""

# --- a database of before: labels are found -----------------------------------------------------------

daemon_end TERM || fail "the daemon ended with $?"
sqlite3 "$work/data/state.db" "DROP TABLE parts; DROP INDEX jobs_by_executor; DROP TABLE job_labels; DROP TRIGGER job_labels_of_new;
    DROP TRIGGER job_labels_of_changed; ALTER TABLE tokens DROP COLUMN expires_ms;
    PRAGMA user_version = 20" || fail "the database cannot be changed"
daemon_start
run 0 list --label group=flat -q
equal "$(wc -l <<<"$out")" 7
finish
