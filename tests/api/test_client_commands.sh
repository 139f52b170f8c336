#!/bin/bash
# The client against the real daemon: submit, watch, show, get with its resumption, what is asked
# of jobs, exit statuses, --json of every command, mistakes.
. tests/api/client.sh "$@"
quick=$tiny

# so FILTER: $out must be JSON, and FILTER true of it.
so() {
    jq -e "$1" <<<"$out" >/dev/null 2>&1 || fail "not so: $1: $out"
}

make_room "$work/room"
daemon_start

# Options that all commands have may come first.
run 0 --json --retry=1 list
so '. == []'
run 0 --server "$UNBAKE_SERVER" -q list
run 2 --jsn list
has "$err" 'unknown command "--jsn"'
run 0 --help list
has "$out" "usage: unbake list"
run 2 --server

# --- a whole job ---------------------------------------------------------------------------------

run 0 submit "$work/room" $quick --dry-run
has "$out" "is on the server (ready)"
run 0 list --json
so '. == []'
run 0 submit "$work/room" $quick --name 'my room' --label who=me --priority 3 --watch
has "$out" "job 1 is queued: my room"
has "$out" "job 1 succeeded"
has "$err" "the server has this room already"
run 0 show last --json
so '.id == 1 and .state == "succeeded" and .name == "my room" and .labels.who == "me" and .priority == 3'
so '.settings.texture_size == 64 and (.outputs | length) > 5'
scene=$(jq -r .scene <<<"$out")
run 0 list
equal "$(head -n 1 <<<"$out" | tr -s ' ')" "job state done stage left age expires name" "the headings of a list"
run 0 show 1
has "$out" "who=me"
has "$out" "base_color.exr"

# The scene's name is the SHA-256 of a tar that anybody can make.
tar_sha=$(cd "$work/room" && find . -type f -printf '%P\n' | LC_ALL=C sort |
    tar --format=gnu --owner=0 --group=0 --numeric-owner --mode=0644 --mtime=@0 -b1 -cf - -T - | sha256sum)
equal "$scene" "${tar_sha%% *}"

# The same room again: nothing is sent. An archive of it is a scene of its own.
touch "$work/room/mesh.ply"
run 0 submit "$work/room" $quick -q
equal "$out" 2
equal "$err" ""
run 0 submit "$work/room" $quick --dry-run --json
so '.dry_run and .scene_state == "ready" and .upload_bytes == 0 and .settings.seed == 1'
tar -C "$work" -czf "$work/packed.tar.gz" room
run 0 submit "$work/packed.tar.gz" $quick --watch --json
equal "$(jq -s 'map(select(.event == "state" and .data.state == "succeeded")) | length' <<<"$out")" 1
equal "$(jq -s '.[0].name' <<<"$out")" '"packed"'
run 0 submit --scene "${scene:0:10}" $quick --watch -q
equal "$out" 4
run 0 submit "$work/room" --set seed=9007199254740991 --dry-run --json
has "$out" '"seed":9007199254740991'

# --- again, for longer, elsewhere in the queue ------------------------------------------------------

run 0 extend 1 --iterations 4
has "$out" "job 1 is "
run 0 watch 1
run 0 watch 1 -q --exec 'echo "$UNBAKE_JOB $UNBAKE_STATE $UNBAKE_NAME:$UNBAKE_REASON"; exit 3'
equal "$out" "1 succeeded my room:"
run 7 watch 1 -q --exec 'exit 127'
run 0 watch 1 --json --all
has "$out" "resumed at iteration 3"
run 0 get 1 report.json -o "$work/longer"
equal "$(jq '.refine.iterations, .settings.iterations' "$work/longer/report.json" | tr '\n' ' ')" "7 7 "
run 4 extend 1 --time 5
has "$err" "iterations is"
so_job() { "$build/unbake" show "$1" --json | jq -e "$2" >/dev/null || fail "job $1: not so: $2"; }
so_job 1 '.state == "succeeded" and .progress == 1'
run 2 extend 1
run 0 retry 1 --from report
run 0 watch 1
run 0 retry 1 --from refine -q
run 0 watch 1
run 4 retry 1 --from lunch
run 0 pause "$("$build/unbake" submit --scene "${scene:0:10}" $endless -q)" -q
wait_for 60 job_is last paused # its worker, if it has one by now, has ended
run 0 edit last --priority 7 --label a=b --name 'new name' --first --json
so '.priority == 7 and .labels == {"a": "b"} and .name == "new name"'
run 0 scenes keep "${scene:0:10}" --keep-days 1
has "$out" "in use, and kept at least as long"
run 0 scenes keep "${scene:0:10}" --keep-days 0
run 2 edit last
run 2 edit last --first --last
run 2 edit last --share --unshare
run 4 edit last --before last
run 0 rm last --dry-run
has "$out" "files"
run 0 rm last

# --- watch, logs -----------------------------------------------------------------------------------

run 0 watch 1
has "$out" "job 1 succeeded"
run 0 watch 1 --json --all
equal "$(jq -s 'map(.event) | contains(["state", "progress", "metric", "output", "log"])' <<<"$out")" true
run 0 logs 1
has "$out" "info: "
[[ $out != *"standard error"* ]] || fail "the worker wrote to its standard error: $out"
run 0 logs 1 --json
equal "$(jq -s 'map(.event) | unique' -c <<<"$out")" '["log"]'
run 0 logs 1 --follow
has "$out" "info: "

# On a terminal a line is drawn in place, in colour; NO_COLOR and TERM=dumb are honoured; what
# others name cannot drive the terminal.
screen() { # ENVIRONMENT... COMMAND
    TERM=xterm script -qec "env $*" /dev/null </dev/null
}
escape=$'\033'
out=$(screen "$build/unbake" watch 1)
has "$out" "$escape[32msucceeded$escape[0m"
out=$(screen NO_COLOR=1 "$build/unbake" watch 1)
has "$out" "job 1 succeeded"
out=$(screen TERM=dumb "$build/unbake" list)
[[ $out != *"$escape"* ]] || fail "escape sequences on a dumb terminal: $out"
run 4 submit --scene "$scene" $quick --name "evil$escape[2Jname" --watch
has "$err" "without control characters"
[[ $out$err != *"$escape"* ]] || fail "escape sequences came through: $out $err"

# --- get -------------------------------------------------------------------------------------------

run 0 get 1 -o "$work/got" --json
so 'length > 5 and all(.[]; .action == "fetched")'
jq -r '.[] | "\(.sha256)  \(.path)"' <<<"$out" | sha256sum --quiet -c - || fail "a file has another SHA-256"
[ -s "$work/got/preview/base_color.png" ] || fail "no preview"
find "$work/got" -name '*.part' | grep . && fail "parts are left"
run 0 get 1 -o "$work/got" --json
so 'all(.[]; .action == "present")'

texture=$work/got/base_color.exr
cp "$texture" "$work/whole"
size=$(stat -c %s "$texture")
head -c $((size / 2)) "$work/whole" >"$texture.part"
rm "$texture"
run 0 get 1 base_color.exr -o "$work/got" --json
so 'length == 1 and .[0].action == "resumed"'
cmp -s "$texture" "$work/whole" || fail "the resumed file differs"

head -c $((size / 2)) /dev/zero >"$texture.part"
rm "$texture"
run 0 get 1 base_color.exr -o "$work/got" --json
so 'length == 1 and .[0].action == "fetched"'
cmp -s "$texture" "$work/whole" || fail "a wrong .part spoilt the file"

echo damaged >"$texture"
run 0 get last 'base_*' 'report.*' -o "$work/got"
run 0 get 1 'base_color.exr' -o "$work/got"
cmp -s "$texture" "$work/whole" || fail "a damaged file was taken for the right one"
(cd "$work" && "$build/unbake" get 1 report.json -q) || fail "get without -o"
[ -s "$work/job-1/report.json" ] || fail "no job-1/report.json"
run 3 get 1 base_colour.exr -o "$work/got"
has "$err" "did you mean base_color.exr?"
ln -s "$work/whole" "$work/got/report.html.part"
rm "$work/got/report.html"
run 7 get 1 report.html -o "$work/got"

# --- what is asked of jobs -------------------------------------------------------------------------

run 0 submit "$work/room" $endless -q
job=$out
wait_for 60 job_is "$job" running
run 6 rm "$job"
run 6 resume 1
run 0 pause "$job" --json
so '.state == "paused" or .wanted == "pause"'
wait_for 60 job_is "$job" paused
run 9 wait "$job" --timeout 0.5
equal "$(grep -c "job $job is paused, and waited for: .*resume" <<<"$err")" 1
run 0 resume "$job"
has "$out" "job $job is"
wait_for 60 job_is "$job" running
run 6 scenes rm "$scene"
run 0 cancel "$job"
wait_for 60 job_is "$job" cancelled
run 1 watch "$job"
has "$out" "cancelled"
run 0 retry "$job"
run 0 cancel last
wait_for 60 job_is "$job" cancelled
run 6 cancel 1 --json
jq -e '.status == 409 and .exit_status == 6 and (.detail | length) > 0' <<<"$err" >/dev/null ||
    fail "no problem in JSON: $err"
run 3 rm 99 "$job"
has "$out" "job $job removed"
run 3 show "$job"

# --- lists -----------------------------------------------------------------------------------------

run 0 list --json --limit 2
so 'length == 2 and .[0].id > .[1].id'
run 0 watch 2
run 0 list --state succeeded --json
so 'length == 4 and all(.[]; .state == "succeeded")'
run 0 list
has "$out" "my room"
run 0 list --state failed
equal "$out" ""
run 0 scenes --json
so 'length == 2'
run 0 scenes show "${scene:0:8}" --json
so '.state == "ready" and .facts.triangle_count == 12'
run 0 scenes show "$scene"
has "$out" triangle_count
run 3 scenes show ffffffff
run 0 settings --json
so 'map(.name) | contains(["texture_size", "seed"])'
run 0 settings seed
has "$out" seed
run 0 version --json
so '.client.version == .server.version'

# --- what is refused -------------------------------------------------------------------------------

run 4 submit "$work/room" --set texture_siz=1 --set texture_size=7 --priority 1000
has "$err" "did you mean texture_size?"
has "$err" "settings.texture_size: "
has "$err" "priority: "
run 4 submit "$work/room" --set texture_size=7 --json
equal "$out" ""
jq -e '.status == 422 and (.invalid_params | length) == 1' <<<"$err" >/dev/null || fail "no invalid_params: $err"

echo "this is no archive" >"$work/bad.zip"
run 4 submit "$work/bad.zip" --watch
has "$err" "cannot be read as a zip"
has "$err" "the room was rejected, for the reasons above"
[[ $err != *GET\ /v1* ]] || fail "a request where the reason is printed: $err"
run 4 submit -q "$work/bad.zip"
has "$err" "was rejected (GET /v1/scenes/"
bad=$("$build/unbake" scenes -q | head -n 1)
run 4 submit --scene "$bad" --json
jq -e --arg id "$bad" '.invalid_params[0].hint | startswith("GET /v1/scenes/" + $id)' <<<"$err" >/dev/null || fail "no hint that names the scene: $err"
run 0 scenes show "$bad" --json
so '.state == "rejected" and (.problems | length) > 0'
make_room "$work/broken"
head -c 200 "$work/room/mesh.ply" >"$work/broken/mesh.ply"
run 4 submit "$work/broken" --watch
has "$err" "mesh.ply: "
run 4 submit "$work/broken" --json
jq -e '.exit_status == 4 and (.problems | length) > 0' <<<"$err" >/dev/null || fail "no problems in JSON: $err"
mkdir "$work/text"
echo "nothing but text" >"$work/text/readme.txt"
run 4 submit "$work/text" --dry-run
has "$err" "was rejected"

run 2 submit "$work/nothing-here"
run 2 submit "$work/room" --set novalue
run 2 sumbit
has "$err" 'did you mean "submit"?'
run 2 list --jsno
has "$err" "did you mean --json?"
run 2 list --state quued
has "$err" "did you mean queued?"
run 2 show
run 2 show one
run 2 settings textur_size
run 2 list --server ftp://127.0.0.1
for command in submit list show watch logs get cancel pause resume retry rm scenes settings version; do
    run 0 "$command" --help
    has "$out" "  unbake $command"
done

# --- the server is away ----------------------------------------------------------------------------

daemon_end TERM || fail "the daemon did not end with 0"
run 5 list --retry 0.2
has "$err" "Connection refused"
run 5 submit "$work/room" --retry 0
run 0 version --json
so '.server == null'

# --- an upload that is too large, and one that is interrupted ---------------------------------------

daemon_start --set max_upload_mib=1
head -c 3000000 /dev/urandom >"$work/large.tar"
run 4 submit "$work/large.tar"
has "$err" "larger than 1048576 bytes"
daemon_end TERM
daemon_start
truncate -s 4G "$work/larger.tar"
env --default-signal=INT "$build/unbake" submit "$work/larger.tar" >/dev/null 2>"$work/interrupted" &
interrupt $!
equal $? 130
has "$(cat "$work/interrupted")" "no job was queued"
run 0 scenes --json
so 'length == 5'
finish
