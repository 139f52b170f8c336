#!/bin/bash
# Uploads in parts (tus 1.0.0): creation, going on, checksums, cut connections, killed daemons, two
# at once, expiry, a full disk. What has arrived is never asked for again.
set -u
. tests/api/lib.sh "$@"
tus='Tus-Resumable: 1.0.0'
octets='Content-Type: application/offset+octet-stream'

b64() { base64 -w 0; }
offset() { call HEAD "$1" -H "$tus"; expect 200 "where it stands"; header upload-offset; }
# create LENGTH [METADATA]: sets $upload.
create() {
    call POST /v1/uploads -H "$tus" -H "Upload-Length: $1" ${2:+-H "Upload-Metadata: $2"}
    upload=$(header location)
}
# patch OFFSET FILE [curl argument...]
patch() {
    local at=$1 file=$2
    shift 2
    call PATCH "$upload" -H "$tus" -H "$octets" -H "Upload-Offset: $at" --data-binary "@$file" "$@"
}
part() { tail -c "+$(($2 + 1))" "$1" | head -c "$3" >"$work/part"; echo "$work/part"; }
# send_some OFFSET LENGTH FILE BYTES: a PATCH that announces LENGTH bytes and sends BYTES; the
# connection stays open as descriptor 3.
send_some() {
    exec 3<>"/dev/tcp/127.0.0.1/${url##*:}"
    printf 'PATCH %s HTTP/1.1\r\nHost: localhost\r\n%s\r\n%s\r\nUpload-Offset: %s\r\nContent-Length: %s\r\n\r\n' \
        "$upload" "$tus" "$octets" "$1" "$2" >&3
    tail -c "+$(($1 + 1))" "$3" | head -c "$4" >&3
}
arrived() { [ "$(stat -c %s "$data/uploads/${upload##*/}")" -ge "$1" ]; }
scene_is() { cmp -s "$data/scenes/$1/archive" "$2" || fail "the scene $1 is not what was sent"; }

start_daemon --set max_upload_mib=64
head -c 3000000 /dev/urandom >"$work/room"
sha=$(sha256sum <"$work/room" | cut -c 1-64)
metadata="name $(printf 'my room' | b64), sha256 $(printf %s "$sha" | b64),extra"

# --- what is spoken ---
call OPTIONS /v1/uploads; expect 204
equal "$(header tus-version)" 1.0.0; equal "$(header tus-extension)" creation,termination,expiration,checksum
equal "$(header tus-checksum-algorithm)" sha1,sha256; equal "$(header tus-max-size)" $((64 << 20))

# --- from creation to the scene, in three parts ---
create 3000000 "$metadata"; expect 201; equal "$(header tus-resumable)" 1.0.0
date -d "$(header upload-expires)" >/dev/null || fail "Upload-Expires is no date"
equal "$(offset "$upload")" 0
equal "$(header upload-length)" 3000000; equal "$(header upload-metadata)" "$metadata"; equal "$(header cache-control)" no-store
[ "$(($(stat -c %b "$data/uploads/${upload##*/}") * 512))" -ge 3000000 ] || fail "the space is not reserved"
patch 0 "$(part "$work/room" 0 1000000)"; expect 204 "first part"; equal "$(header upload-offset)" 1000000
patch 1000000 "$(part "$work/room" 1000000 1000)" -H "Upload-Checksum: sha1 $(openssl dgst -sha1 -binary "$work/part" | b64)"
expect 204 "second part"; equal "$(header upload-offset)" 1001000; [ -n "$(header upload-expires)" ] || fail "no Upload-Expires"
call GET "/v1/uploads?sha256=$sha"; expect 200; equal "$(field '.items[0].offset')" 1001000
equal "$(field '.items[0].links.self')" "$upload"; equal "$(field '.items[0].scene')" null
patch 1001000 "$(part "$work/room" 1001000 3000000)"; expect 204 "third part"; equal "$(header upload-offset)" 3000000
equal "$(header link)" "</v1/scenes/$sha>; rel=\"related\""
scene_is "$sha" "$work/room"
call GET "/v1/scenes/$sha"; equal "$(field .name)" "my room"; equal "$(field .bytes)" 3000000
equal "$(offset "$upload")" 3000000 "after the end"
call GET "$upload"; equal "$(field .scene)" "$sha"
patch 3000000 /dev/null; expect 409 "going on after the end"
equal "$(ls -A "$data/uploads")" "" "left in uploads/"
call DELETE "$upload" -H "$tus"; expect 204; call HEAD "$upload" -H "$tus"; expect 404 "after its removal"
call GET "/v1/scenes/$sha"; expect 200 "the scene after the removal of its upload"
# The same content again is the same scene.
create 3000000 "$metadata"; patch 0 "$work/room"; expect 204; scene_is "$sha" "$work/room"
# Without PATCH and DELETE.
create 10
call POST "$upload" -H 'X-HTTP-Method-Override: PATCH' -H "$tus" -H "$octets" -H 'Upload-Offset: 0' --data-binary abc; expect 204
call POST "$upload" -H 'X-HTTP-Method-Override: DELETE' -H "$tus"; expect 204; call GET "$upload"; expect 404

# --- refusals; nothing of them counts ---
while IFS='|' read -r wanted what headers; do
    args=()
    while [ -n "$headers" ]; do args+=(-H "${headers%%;*}"); [[ $headers == *\;* ]] && headers=${headers#*;} || headers=; done
    call POST /v1/uploads ${args[@]+"${args[@]}"}; expect "$wanted" "$what"
done <<LIST
412|no version|Upload-Length: 5
412|another version|Upload-Length: 5;Tus-Resumable: 0.2.2
400|no length|$tus
400|a length to come|$tus;Upload-Defer-Length: 1
400|no number|$tus;Upload-Length: 5x
400|a negative length|$tus;Upload-Length: -5
400|nothing|$tus;Upload-Length: 0
413|too much|$tus;Upload-Length: 67108865
413|far too much|$tus;Upload-Length: 999999999999999999
400|a length beyond numbers|$tus;Upload-Length: 99999999999999999999
400|metadata without base64|$tus;Upload-Length: 5;Upload-Metadata: name r@om
400|an empty name|$tus;Upload-Length: 5;Upload-Metadata: name
400|half a digest|$tus;Upload-Length: 5;Upload-Metadata: sha256 $(printf 1234 | b64)
400|a name that is no text|$tus;Upload-Length: 5;Upload-Metadata: name $(printf 'a\xff' | b64)
400|an empty key|$tus;Upload-Length: 5;Upload-Metadata: ,a
LIST
call POST /v1/uploads -H "$tus" -H 'Upload-Length: 5' -H "$octets" --data-binary hello; expect 400 "a body at creation"
create 1000; expect 201
patch 1 "$(part "$work/room" 0 100)"; expect 409 "a wrong offset"
patch x "$work/part"; expect 400 "no offset"
patch 0 "$(part "$work/room" 0 1001)"; expect 413 "more than the whole"
patch 0 "$work/part" -H 'Transfer-Encoding: chunked'; expect 413 "more than the whole, in chunks"
call PATCH "$upload" -H "$tus" -H 'Upload-Offset: 1000' -H 'Content-Type: text/plain' --data-binary a; expect 415
call PATCH "$upload" -H 'Upload-Offset: 0' -H "$octets" --data-binary a; expect 412
patch 0 "$(part "$work/room" 0 100)" -H 'Upload-Checksum: md5 AAAA'; expect 400 "an unknown checksum"
patch 0 "$work/part" -H 'Upload-Checksum: sha1 AAAA'; expect 400 "half a checksum"
call PATCH /v1/uploads/00112233445566778899aabbccddeeff -H "$tus" -H 'Upload-Offset: 0' -H "$octets" --data-binary a; expect 404
call PATCH /v1/uploads/..%2f..%2fstate.db -H "$tus" -H 'Upload-Offset: 0' -H "$octets" --data-binary a; expect 400
create 1000
wrong=$(printf %s 01234567890123456789 | b64)
patch 0 "$(part "$work/room" 0 100)" -H "Upload-Checksum: sha1 $wrong"; expect 460; equal "$(field .type)" urn:unbake:checksum
equal "$(offset "$upload")" 0 "after a wrong checksum"
right=$(openssl dgst -sha256 -binary "$work/part" | b64)
patch 0 "$work/part" -H "Upload-Checksum: sha256 $right"; expect 204; equal "$(offset "$upload")" 100
# The whole is held against what was announced.
create 100 "sha256 $(printf %s "$sha" | b64)"
patch 0 "$work/part"; expect 422 "another content"; call HEAD "$upload" -H "$tus"; expect 404 "the upload of another content"

# --- a connection that breaks: what arrived counts ---
create 3000000
send_some 0 3000000 "$work/room" 700000
wait_for 60 arrived 700000
exec 3>&- 3<&-
equal "$(offset "$upload")" 700000 "after a broken connection"

# --- one that hangs: the newest takes over, what the older still sends is not mixed in ---
send_some 700000 2300000 "$work/room" 300000
wait_for 60 arrived 1000000
patch 1000000 "$(part "$work/room" 1000000 500000)"; expect 204 "taking over"
head -c 1000000 /dev/zero >&3 2>/dev/null
timeout 20 head -n 1 <&3 >"$work/old"
exec 3>&- 3<&-
grep -q '^HTTP/1.1 409' "$work/old" || fail "the older one is told: $(cat "$work/old")"
equal "$(offset "$upload")" 1500000 "after the change of hands"

# --- the daemon is stopped, and killed in the middle of it ---
stop_daemon
start_daemon --set max_upload_mib=64
equal "$(offset "$upload")" 1500000 "after a stop"
send_some 1500000 1500000 "$work/room" 600000
wait_for 60 arrived 2100000
kill -KILL "$daemon_pid"; wait "$daemon_pid" 2>/dev/null
exec 3>&- 3<&-
start_daemon --set max_upload_mib=64
equal "$(offset "$upload")" 2100000 "after SIGKILL"
# Unchecked bytes are not taken for received ones.
part "$work/room" 2100000 900000 >/dev/null
exec 3<>"/dev/tcp/127.0.0.1/${url##*:}"
printf 'PATCH %s HTTP/1.1\r\nHost: localhost\r\n%s\r\n%s\r\nUpload-Offset: 2100000\r\nContent-Length: 900000\r\nUpload-Checksum: sha1 %s\r\n\r\n' \
    "$upload" "$tus" "$octets" "$(openssl dgst -sha1 -binary "$work/part" | b64)" >&3
head -c 300000 "$work/part" >&3
wait_for 60 arrived 2400000
kill -KILL "$daemon_pid"; wait "$daemon_pid" 2>/dev/null
exec 3>&- 3<&-
start_daemon --set max_upload_mib=64
equal "$(offset "$upload")" 2100000 "after SIGKILL within a checked part"
patch 2100000 "$work/part"; expect 204
equal "$(header link)" "</v1/scenes/$sha>; rel=\"related\""
scene_is "$sha" "$work/room"

# --- after a power cut the tail may be anything: it is cut off ---
create 3000000
patch 0 "$(part "$work/room" 0 1000000)"; expect 204
file=$data/uploads/${upload##*/}
stop_daemon
sqlite3 "$data/state.db" "UPDATE uploads SET boot = 'another'" 2>/dev/null && has_sqlite=1 || has_sqlite=
head -c 200000 /dev/zero >>"$file"
start_daemon --set max_upload_mib=64
if [ -n "$has_sqlite" ]; then
    equal "$(offset "$upload")" 1000000 "after a power cut"
    equal "$(stat -c %s "$file")" 1000000 "the file after a power cut"
    patch 1000000 "$(part "$work/room" 1000000 2000000)"; expect 204; scene_is "$sha" "$work/room"
fi
stop_daemon; equal "$daemon_status" 0

# --- whole, but the daemon died before it became a scene: the next one makes it ---
if [ -n "$has_sqlite" ]; then
    sqlite3 "$data/state.db" "UPDATE uploads SET scene_id = ''; DELETE FROM scenes"
    start_daemon --set max_upload_mib=64
    call GET "/v1/scenes/$sha"; expect 200 "the scene of an upload that was whole"
    equal "$(offset "$upload")" 3000000
    stop_daemon
fi

# --- no room ---
start_daemon --set min_free_mib=16777216
call POST /v1/uploads -H "$tus" -H 'Upload-Length: 5'; expect 507 "below the low-water mark"
stop_daemon
if [ "$(id -u)" -eq 0 ] && mkdir "$work/small-disk" && mount -t tmpfs -o size=14m none "$work/small-disk" 2>/dev/null; then
    mounted=$work/small-disk
    data=$work/small-disk/data
    start_daemon --set min_free_mib=0 --set max_upload_mib=100
    create 20000000; expect 507 "larger than the disk"; equal "$(ls -A "$data/uploads")" ""
    room=$(df -B1 --output=avail "$work/small-disk" | tail -n 1)
    create 3000000; expect 201; first=$upload
    create $((room - 1000000)); expect 507 "what the first has reserved"
    head -c 20000000 /dev/zero >"$work/small-disk/rest" 2>/dev/null # the disk is full now
    upload=$first
    patch 0 "$work/room" # the database may find no room to say so, but the bytes have theirs
    [ "$status" = 204 ] || [ "$status" = 507 ] || fail "into reserved space on a full disk: $status"
    rm "$work/small-disk/rest"
    equal "$(offset "$upload")" 3000000 "what arrived while the disk was full"
    scene_is "$sha" "$work/room"
    stop_daemon
    equal "$daemon_status" 0
    umount "$mounted" && mounted=
fi
finish
