#!/bin/bash
# What is kept for how long: expiry in every listing, pins, dry runs, the collector; and a disk that
# is nearly full, or full.
. tests/api/client.sh "$@"
long="--set method=listing1 --set texture_size=64 --set texels_per_metre=2 --set iterations=1000000000 --set texels_per_iteration=64"
quick=$tiny
tus='Tus-Resumable: 1.0.0'

so() { jq -e "$1" <<<"$out" >/dev/null 2>&1 || fail "not so: $1: $out"; }
field_is() { call GET "$1"; [ "$(field "$2")" = "$3" ]; }
gone() { call GET "$1"; [ "$status" = 404 ]; }
change() { call PATCH "$1" -H 'If-Match: *' -H 'Content-Type: application/json' -d "$2"; }

make_room "$work/room"
make_room "$work/other" 7
daemon_start --set collect_interval_sec=3600

# --- for ever, unless something is said ---
run 0 submit "$work/room" $quick --watch -q
scene=$("$build/unbake" show 1 --json | jq -r .scene)
run 0 list --json; so '.[0].expires_at == null and .[0].pinned == false'
run 0 scenes --json; so '.[0].expires_at == null and .[0].pinned == false'
run 0 collect --dry-run --json; so '.items == [] and .bytes == 0 and .dry_run'

# --- a time of its own; a pin wins over it ---
run 0 edit 1 --keep-days 2 --json; so '(.expires_at | fromdateiso8601? // (.[0:19] + "Z" | fromdateiso8601)) - now | . > 172000 and . < 173000'
run 0 list; has "$out" expires
run 0 scenes keep "${scene:0:8}" --pin --keep-days 1 --json; so '.pinned and .expires_at == null'
run 0 scenes; has "$out" pinned
run 0 scenes keep "$scene" --unpin --json; so '.pinned == false and .expires_at != null'
run 2 scenes keep "$scene"
run 2 scenes show "$scene" --pin
change "/v1/jobs/1" '{"expires_at":"2020-01-01T00:00:00Z","pinned":true}'; expect 200; equal "$(field .expires_at)" null
change "/v1/scenes/$scene" '{"expires_at":"2020-01-01T00:00:00Z","name":"kitchen"}'; expect 200
equal "$(field .name)" kitchen; equal "$(field .expires_at)" 2020-01-01T00:00:00.000Z
for wrong in '{"expires_at":"tomorrow"}' '{"expires_at":5}' '{"pinned":1}' '{"nothing":1}' '{"name":""}'; do
    change "/v1/scenes/$scene" "$wrong"; expect 422 "$wrong"
done
call PATCH "/v1/scenes/$scene" -H 'If-Match: "old"' -H 'Content-Type: application/json' -d '{"pinned":true}'; expect 412
etag=$(call GET "/v1/scenes/$scene"; header etag)
call PATCH "/v1/scenes/$scene" -H "If-Match: $etag" -H 'Content-Type: application/json' -d '{"pinned":false}'; expect 200

# --- what would go, and how many bytes; nothing goes ---
run 0 rm 1 --dry-run --json; so '.files > 5 and .bytes > 1000'
run 0 scenes rm "$scene" --dry-run --json; so '.files > 5 and .bytes > 1000'
run 0 collect --dry-run --json
so '.dry_run and (.items | map(.kind)) == ["scene"] and .bytes > 1000'
call GET "/v1/scenes/$scene"; expect 200 "after dry runs"

# --- then it goes; the pinned job stays ---
call POST /v1/uploads -H "$tus" -H 'Upload-Length: 100'; upload=$(header location)
run 0 uploads keep "${upload##*/}" --keep-days 2 --json; so '.expires_at != null and .pinned == false'
change "$upload" '{"expires_at":"2020-01-01T00:00:00Z"}'; expect 200
run 0 collect --dry-run --json; so '(.items | map(.kind)) == ["upload", "scene"]'
run 0 uploads keep "${upload##*/}" --pin; has "$out" "kept for good"
run 0 uploads show "${upload##*/}"; has "$out" "never: pinned"
run 0 uploads; has "$out" pinned
call HEAD "$upload" -H "$tus"; expect 200; equal "$(header upload-expires)" ""
for wrong in '{"expires_at":5}' '{"pinned":1}' '{"name":"x"}'; do
    change "$upload" "$wrong"; expect 422 "$wrong"
done
change "$upload" '[1]'; expect 400
change "${upload%?}x" '{"pinned":true}'; expect 404
run 2 uploads keep "${upload##*/}"
run 2 uploads rm
run 0 collect --json; so '(.items | map(.kind)) == ["scene"] and .items[0].name == "kitchen"'
call GET "$upload"; expect 200 "the pinned upload"; equal "$(field .expires_at)" null
run 0 uploads keep "${upload##*/}" --unpin
run 0 collect --json; so '(.items | map(.kind)) == ["upload"]'
gone "$upload" || fail "the expired upload is there"
gone "/v1/scenes/$scene" || fail "the expired scene is there"
[ ! -e "$data/scenes/$scene" ] || fail "its files are there"
call GET /v1/jobs/1; expect 200 "the pinned job"
change /v1/jobs/1 '{"pinned":false}'
run 0 collect; has "$out" job
gone /v1/jobs/1 || fail "the expired job is there"
[ ! -e "$data/jobs/1" ] || fail "its files are there"
call POST /v1/uploads -H "$tus" -H 'Upload-Length: 1000000'; upload=$(header location)
run 0 uploads --json; so '.[0].expires_at != null and .[0].offset == 0'
run 0 uploads rm "${upload##*/}" --dry-run --json; so '.bytes >= 1000000'
daemon_end TERM || fail "the daemon did not end with 0"

# --- by the configuration: jobs after their end, scenes after their last use, uploads after their last byte ---
# The job is made before: between the scene and its job there would be a second or two only.
daemon_start
run 0 submit "$work/room" $long -q
job=$out
daemon_end TERM || fail "the daemon did not end with 0"
daemon_start --set collect_interval_sec=0.2 --set job_keep_days=0.00001 --set scene_keep_days=0.00002 \
    --set upload_keep_hours=0.0003
wait_for 60 job_is "$job" running
wait_for 60 gone "$upload"
[ -z "$(ls -A "$data/uploads")" ] || fail "the expired upload's file is there"
# By now the job and its scene would have expired, had they not been in use.
sleep 2
job_is "$job" running || fail "a running job is gone"
run 0 list --json; so '.[0].expires_at == null'
scene=$("$build/unbake" show "$job" --json | jq -r .scene)
field_is "/v1/scenes/$scene" .expires_at null || fail "a scene in use expires"
run 0 cancel "$job"
wait_for 60 gone "/v1/jobs/$job"
wait_for 60 gone "/v1/scenes/$scene"
[ -z "$(ls -A "$data/scenes")$(ls -A "$data/jobs")" ] || fail "left: $(ls "$data/scenes" "$data/jobs")"
daemon_end TERM || fail "the daemon did not end with 0"

# --- a disk that is nearly full: work waits, says so, and goes on ---
if [ "$(id -u)" -eq 0 ] && mkdir "$work/disk" && mount -t tmpfs -o size=90m none "$work/disk" 2>/dev/null; then
    mounted=$work/disk
    data=$work/disk/data
    daemon_start --set min_free_mib=0 --set low_disk_mib=30 --set checkpoint_interval_sec=1
    run 0 submit "$work/room" $long -q
    first=$out
    wait_for 60 job_is "$first" running
    waits() { field_is "/v1/jobs/$1" '.reason // "" | startswith("the disk is nearly full")' true && [ "$(field .state)" = queued ]; }
    head -c 55m /dev/zero >"$work/disk/filler"
    [ "$(df --output=avail -B1M "$work/disk" | tail -n 1)" -lt 30 ] || fail "the disk is not as full as the test wants it"
    wait_for 60 waits "$first"
    run 0 submit --scene "$("$build/unbake" show "$first" --json | jq -r .scene)" $long -q
    second=$out
    wait_for 60 waits "$second"
    call GET /readyz; expect 503; [[ $(field .detail) == *"jobs wait"* ]] || fail "/readyz: $(cat "$work/body")"
    run 0 show "$first"; has "$out" "the disk is nearly full"
    out=$(curl -s -H 'Accept: application/x-ndjson' "$url/v1/jobs/$first/events?after=0&follow=0" | jq -s 'map(select(.event == "state").data.reason)')
    has "$out" "the disk is nearly full: less than 30 MiB are free"
    rm "$work/disk/filler"
    wait_for 60 job_is "$first" running
    wait_for 60 field_is "/v1/jobs/$second" .reason null || fail "the waiting job still names the disk"
    call GET /readyz; expect 200
    run 0 cancel "$first" "$second"
    wait_for 60 job_is "$second" cancelled # the first had gone, perhaps, and it ran

    # --- a disk that is full: what runs or waits can be stopped, what is not needed removed all the same ---
    wait_for 60 job_is "$first" cancelled
    for third in 1 2 3; do
        run 0 submit --scene "$("$build/unbake" show "$first" --json | jq -r .scene)" $long -q
        more[third]=$out
    done
    wait_for 60 job_is "${more[1]}" running
    head -c 200m /dev/zero >"$work/disk/filler" 2>/dev/null
    head -c 100k /dev/zero >>"$work/disk/filler" 2>/dev/null
    equal "$(df --output=avail -B1 "$work/disk" | tail -n 1 | tr -d ' ')" 0 "bytes free"
    call POST /v1/uploads -H "$tus" -H 'Upload-Length: 1000000'; expect 507 "an upload on a full disk"
    for action in 1/pause 2/pause 3/cancel 2/cancel 1/cancel; do
        call POST "/v1/jobs/${more[${action%/*}]}/${action#*/}"; expect 202 "$action on a full disk"
        head -c 20m /dev/zero >"$work/disk/filler-${action/\//-}" 2>/dev/null
    done
    for third in 1 2 3; do
        wait_for 60 job_is "${more[third]}" cancelled
        run 0 rm "${more[third]}"
    done
    run 0 rm "$first"
    run 0 rm "$second"
    run 0 scenes rm "$("$build/unbake" scenes -q | head -n 1)"
    [ -z "$(ls -A "$data/scenes")$(ls -A "$data/jobs")" ] || fail "left: $(ls "$data/scenes" "$data/jobs")"
    rm "$work/disk"/filler*

    # --- a room that does not fit when it is unpacked is no faulty room: it waits for more space ---
    make_room "$work/wide"
    head -c 2000000 /dev/urandom | base64 -w 100 | sed "s/\$/$(printf '%1000s')/" >"$work/wide/notes.txt" # 30 MB; packed, 2
    tar -C "$work/wide" -czf "$work/wide.tar.gz" .
    head -c 50m /dev/zero >"$work/disk/filler"
    call POST /v1/scenes -T "$work/wide.tar.gz"; expect 201
    wide=$(field .id)
    short() { field_is "/v1/scenes/$wide" '.state + " " + (.problems[0].reason // "" | .[0:9])' "checking disk full"; }
    wait_for 60 short
    run 0 scenes show "$wide"; has "$out" "notes.txt"
    run 0 submit --scene "$wide" $quick -q
    first=$out
    call DELETE "/v1/scenes/$wide"; expect 409 "a job waits for it"
    field_is "/v1/jobs/$first" .state queued || fail "the job did not wait: $(cat "$work/body")"
    rm "$work/disk/filler"
    run 0 watch "$first" -q
    field_is "/v1/scenes/$wide" .state ready || fail "the scene: $(cat "$work/body")"
    daemon_end TERM || fail "the daemon did not end with 0"
    umount "$mounted" && mounted=
fi
finish
