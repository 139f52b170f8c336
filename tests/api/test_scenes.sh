#!/bin/bash
# Uploads: once for the same content, checked digests, refusals that store nothing, full disks.
set -u
. tests/api/lib.sh "$@"
scene_state() { call GET "/v1/scenes/$1"; [ "$(field .state)" = "$2" ]; }

start_daemon --set max_upload_mib=4
head -c 300000 /dev/urandom >"$work/one"
one=$(sha256sum <"$work/one" | cut -c 1-64)

call GET "/v1/scenes/$one"; expect 404 "a scene that is not there"
call POST '/v1/scenes?name=my+room' -T "$work/one"; expect 201 "first upload"
equal "$(header location)" "/v1/scenes/$one" Location
equal "$(field .id)" "$one" id; equal "$(field .name)" "my room" name; equal "$(field .bytes)" 300000 bytes
cmp -s "$work/one" "$data/scenes/$one/archive" || fail "the archive is not what was sent"
call POST /v1/scenes -T "$work/one"; expect 200 "second upload"
equal "$(field .name)" "my room" "name after the second upload"
call POST /v1/scenes -T - <"$work/one"; expect 200 "chunked upload"
call HEAD "/v1/scenes/$one"; expect 200
call GET "/v1/scenes/${one:0:10}"; expect 200 "by the id's beginning"; equal "$(field .id)" "$one"
call GET "/v1/scenes/${one:0:7}"; expect 404 "by too short a beginning"
call GET "/v1/scenes/..%2f..%2fetc"; expect 400
call GET "/v1/scenes/${one^^}"; expect 404 "an id in capitals"

# --- what was uploaded is no archive: the check says so, the daemon is unharmed ---
wait_for 60 scene_state "$one" rejected
[ "$(field '.problems | length')" -ge 1 ] && [ -n "$(field '.problems[0].reason')" ] || fail "no reason: $(cat "$work/body")"
call POST /v1/jobs -H 'Content-Type: application/json' -d "{\"scene\":\"$one\"}"; expect 422 "a job on a rejected scene"
equal "$(field '.invalid_params[0].name')" scene

# --- photographs of another colour space: their profile is read inside the sandbox, and what was done is said ---
p3=${UNBAKE_TEST_DATA:-../shared/data}/captures/icc_p3
if [ -d "$p3" ]; then
    (cd "$p3" && zip -q -r "$work/p3.zip" .)
    call POST /v1/scenes -T "$work/p3.zip"; expect 201 "photographs of Display P3"
    id=$(field .id)
    wait_for 60 scene_state "$id" ready
    equal "$(field .facts.photographs)" "Display P3, converted to Rec. 709 (6 of 6)" "what was converted"
    call DELETE "/v1/scenes/$id"; expect 204 "deletion of these"
else
    echo "test data captures/icc_p3 is not here"
fi
etag=$(call GET "/v1/scenes/$one"; header etag)
call GET "/v1/scenes/$one" -H "If-None-Match: $etag"; expect 304

# --- digests ---
base64=$(openssl dgst -sha256 -binary "$work/one" 2>/dev/null | base64 -w 0)
call POST /v1/scenes -T "$work/one" -H "X-Content-SHA256: $one"; expect 200 "right X-Content-SHA256"
[ -z "$base64" ] || { call POST /v1/scenes -T "$work/one" -H "Repr-Digest: sha-256=:$base64:"; expect 200 "right Repr-Digest"; }
head -c 1000 /dev/urandom >"$work/two"
call POST /v1/scenes -T "$work/two" -H "X-Content-SHA256: $one"; expect 422 "wrong X-Content-SHA256"
call POST /v1/scenes -T "$work/two" -H "Repr-Digest: sha-256=:ungWv48Bz+pBQUDeXa4iI7ADYaOWF3qctBD/YfIAFa0=:"; expect 422 "wrong Repr-Digest"
call POST /v1/scenes -T "$work/two" -H "X-Content-SHA256: 12"; expect 400 "half a digest"
call GET /v1/scenes; equal "$(field '.items | length')" 1 "scenes after refusals"

# --- refusals ---
call POST /v1/scenes; expect 400 "no body"
call POST /v1/scenes -T - </dev/null; expect 400 "an empty chunked body"
call POST /v1/scenes -F "file=@$work/two"; expect 415 "a form"
call POST "/v1/scenes?nam=x" -T "$work/two"; expect 400 "an unknown query parameter"
call POST "/v1/scenes?name=" -T "$work/two"; expect 400 "an empty name"
head -c 5000000 /dev/zero >"$work/large"
call POST /v1/scenes -T "$work/large"; expect 413 "too large, said beforehand"; equal "$(field .limit_bytes)" 4194304
call POST /v1/scenes -T - <"$work/large"; expect 413 "too large, seen on the way"
head -c 40000000 /dev/zero | call POST /v1/scenes -T -; expect 413 "far too large"
# A client that goes away in the middle leaves nothing.
curl -s -m 1 --limit-rate 50k -T "$work/one" -X POST "$url/v1/scenes" >/dev/null
no_uploads() { [ -z "$(ls -A "$data/uploads")" ]; }
wait_for 60 no_uploads
equal "$(ls "$data/scenes")" "$one" "scenes on disk"

# --- pages ---
for i in 1 2 3 4 5; do echo "scene $i" >"$work/small"; call POST /v1/scenes -T "$work/small"; expect 201; done
seen= path='/v1/scenes?limit=2' pages=0
while [ -n "$path" ] && [ "$pages" -lt 9 ]; do
    call GET "$path"; expect 200
    seen="$seen $(field '.items[].id' | tr '\n' ' ')"
    path=$(header link | sed -n 's/^<\(.*\)>; rel="next"$/\1/p')
    [ -n "$path" ] || equal "$(field .next)" null "next on the last page"
    pages=$((pages + 1))
done
equal "$pages" 3 pages
equal "$(tr ' ' '\n' <<<"$seen" | grep -c .)" 6 "scenes on all pages"
equal "$(tr ' ' '\n' <<<"$seen" | grep . | sort -u | wc -l)" 6 "different scenes on all pages"
call GET '/v1/scenes?limit=0'; expect 400
call GET '/v1/scenes?limit=x'; expect 400
call GET '/v1/scenes?cursor=garbage'; expect 400 "a cursor of somebody else's"

# --- removal, when nothing is being checked ---
for scene in $(sort -u <<<"${seen// /$'\n'}"); do wait_for 60 scene_state "$scene" rejected; done
call DELETE "/v1/scenes/$one"; expect 204
call GET "/v1/scenes/$one"; expect 404
[ ! -e "$data/scenes/$one" ] || fail "the files are still there"
call DELETE "/v1/scenes/$one"; expect 404
# A thread deletes what was removed.
trash_is_empty() { [ -z "$(ls -A "$data/trash")" ]; }
wait_for 60 trash_is_empty

# --- many at once: the same content by many clients is one scene ---
background=
for i in 1 2 3 4 5 6 7 8; do
    curl -s -m 60 -o /dev/null -w '%{http_code}\n' -T "$work/one" -X POST "$url/v1/scenes" >"$work/code$i" & background="$background $!"
done
for pid in $background; do wait "$pid"; done
background=
equal "$(cat "$work"/code? | sort | uniq -c | tr -s ' ' | tr '\n' ';')" " 7 200; 1 201;" "replies to eight at once"
stop_daemon

# --- low water ---
start_daemon --set min_free_mib=16777216
call POST /v1/scenes -T "$work/two"; expect 507 "upload below the low-water mark"
[ -n "$(field .hint)" ] || fail "no hint"
call POST /v1/scenes -T - <"$work/two"; expect 507 "chunked upload below the low-water mark"
call GET /readyz; expect 503
call DELETE "/v1/scenes/$(sha256sum <"$work/small" | cut -c 1-64)"; [ "$status" = 204 ] || [ "$status" = 409 ] || fail "delete: $status"
stop_daemon

# --- a disk that is really full ---
if [ "$(id -u)" -eq 0 ] && mkdir "$work/small-disk" && mount -t tmpfs -o size=6m none "$work/small-disk" 2>/dev/null; then
    mounted=$work/small-disk
    data=$work/small-disk/data
    start_daemon --set min_free_mib=0 # with less room than the database keeps for itself: how else could something go
    call GET /v1/scenes; expect 200 "on a disk that was full at the start"
    stop_daemon
    equal "$daemon_status" 0
    mount -o remount,size=14m "$mounted"
    start_daemon --set min_free_mib=0 --set max_upload_mib=100
    head -c 20000000 /dev/urandom >"$work/large"
    call POST /v1/scenes -T "$work/large"; expect 507 "larger than the disk, said beforehand"
    call POST /v1/scenes -T - <"$work/large"; expect 507 "larger than the disk, seen on the way"
    equal "$(ls -A "$data/uploads")" "" "left in uploads/ of the full disk"
    call POST /v1/scenes -T "$work/two"; expect 201 "an upload that fits, afterwards"
    stop_daemon
    equal "$daemon_status" 0
    umount "$mounted" && mounted=
fi
finish
