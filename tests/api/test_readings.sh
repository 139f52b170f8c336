#!/bin/bash
# How a scene is to be read, over HTTP: with an upload, by PATCH, its faults, and what keeps it from changing; jobs on a
# scene whose mesh and photographs do not fit. No check and no job runs: tests/api/idle.c ends them.
set -u
. tests/api/lib.sh "$@"
post() { local path=$1 body=$2; shift 2; call POST "$path" -H 'Content-Type: application/json' --data-binary "$body" "$@"; }
patch() { local path=$1 body=$2; shift 2; call PATCH "$path" -H 'Content-Type: application/json' --data-binary "$body" "$@"; }
move() { echo "$*" >&"${idle[1]}"; read -r answer <&"${idle[0]}"; equal "$answer" ok "$*"; }
faults() { field '.invalid_params | map(.name) | sort | join(" ")'; }

coproc idle { exec "$build/tests/api/idle"; }
read -r url scene idle_dir <&"${idle[0]}"

# --- PATCH ---
call GET "/v1/scenes/$scene"; etag=$(header etag); equal "$(field '.reading | tojson')" '{}' "the reading of one that says nothing"
patch "/v1/scenes/$scene" '{"reading":{"axes":"sideways","scale":0,"mesh_axes":"x -z y","colour":1}}'; expect 422
equal "$(faults)" "reading.axes reading.colour reading.scale" "each fault of a reading"
for bad in '[]' '"opencv"' 7; do patch "/v1/scenes/$scene" "{\"reading\":$bad}"; expect 422 "$bad"; equal "$(faults)" reading; done
patch "/v1/scenes/$scene" "{\"reading\":{\"mesh\":\"$(head -c 2000 /dev/zero | tr '\0' m)\"}}"; expect 422 "a name of 2000 bytes"
patch "/v1/scenes/$scene" '{"reading":{}}' -H 'If-Match: "other"'; expect 412
call GET "/v1/scenes/$scene"; equal "$(field .state)" ready "state after refusals"; equal "$(header etag)" "$etag"
patch "/v1/scenes/$scene" '{"reading":{"axes":"opencv","scale":1,"mesh_axes":"x -z y"}}' -H "If-Match: $etag"; expect 200
equal "$(field '[.state, (.reading | tojson), (.facts | tojson)] | join(" ")')" \
    'checking {"axes":"opencv","mesh_axes":"x -z y"} {}' "a scene that is to be read otherwise"
[ "$(header etag)" != "$etag" ] || fail "the same ETag"

# --- what its check found ---
move ready '{"fit":{"verdict":"no","evidence":["93 of 100 rays hit nothing"],"remedy":{"mesh_axes":"x -z y"},"remedy_text":"the mesh is y-up"},"previews":[{"name":"plan.png","caption":"from above"}]}'
call GET "/v1/scenes/$scene"; equal "$(field .state)" ready
equal "$(field '.facts.previews[0].href')" "/v1/scenes/$scene/preview/plan.png" "where the picture is"
for path in '/v1/jobs' '/v1/jobs?dry_run=1'; do
    post "$path" "{\"scene\":\"$scene\"}"; expect 409 "a job on a scene that does not fit"
    field .detail | grep -q '93 of 100' || fail "no evidence: $(cat "$work/body")"
    field .hint | grep -q "the mesh is y-up: .unbake scenes set" || fail "no remedy: $(cat "$work/body")"
    equal "$(field '.remedy | tojson')" '{"mesh_axes":"x -z y"}' "the remedy to PATCH"
done
# --- its pictures ---
mkdir -p "$idle_dir/scenes/$scene/previews"
printf '\x89PNG and so on' >"$idle_dir/scenes/$scene/previews/plan.png"
cp "$idle_dir/scenes/$scene/previews/plan.png" "$idle_dir/scenes/$scene/previews/other.png"
preview=/v1/scenes/${scene:0:10}/preview
call GET "$preview/plan.png"; expect 200; equal "$(header content-type)" image/png; equal "$(wc -c <"$work/body")" 14 "bytes"
equal "$(header content-security-policy)" "sandbox allow-same-origin; script-src 'none'"
etag=$(header etag); equal "$etag" "\"sha256-$(sha256sum <"$work/body" | cut -c 1-64)\"" ETag
call GET "$preview/plan.png" -H "If-None-Match: $etag"; expect 304
call GET "$preview/plan.png" -H 'Range: bytes=1-3'; expect 206; equal "$(cat "$work/body")" PNG
call HEAD "$preview/plan.png"; expect 200
for name in other.png plan.pn archive ..%2Farchive .. overlay.png; do call GET "$preview/$name"; [[ $status = 40[04] ]] || fail "$name: $status"; done
call GET /v1/scenes/ffffffff/preview/plan.png; expect 404

post /v1/jobs "{\"scene\":\"$scene\",\"settings\":{\"fit\":\"ignore\"}}"; expect 201 "one that was told to take it"; job=$(field .id)
for verdict in yes doubtful; do
    patch "/v1/scenes/$scene" '{"reading":null}'; expect 200; equal "$(field '.reading | tojson')" '{}' "null takes it back"
    move ready "{\"fit\":{\"verdict\":\"$verdict\"}}"
    post '/v1/jobs?dry_run=1' "{\"scene\":\"$scene\"}"; expect 200 "a job on a scene whose fit is $verdict"
done

# --- a job that has begun ---
move start "$job"
patch "/v1/scenes/$scene" '{"reading":{"scale":2},"name":"other"}'; expect 409
field .hint | grep -q Cancel || fail "no hint: $(cat "$work/body")"
call GET "/v1/scenes/$scene"; equal "$(field '.name + (.reading | tojson)')" 'room{}' "what was refused changes nothing"
call POST "/v1/jobs/$job/cancel"; move stop "$job" 1
patch "/v1/scenes/$scene" '{"reading":{"scale":2}}'; expect 200

# --- with an upload ---
echo "a bundle" >"$work/one"
reading=$(jq -rn '{axes: "opengl"} | tojson | @uri')
call POST "/v1/scenes?reading=%7B%22axes%22%3A7%7D" -T "$work/one"; expect 422; equal "$(faults)" reading.axes
call POST "/v1/scenes?reading=nothing" -T "$work/one"; expect 422; equal "$(faults)" reading
call POST "/v1/scenes?reading=$reading" -T "$work/one"; expect 201; equal "$(field '.reading | tojson')" '{"axes":"opengl"}'
call POST /v1/scenes -T "$work/one"; expect 200 "again, and nothing said"; equal "$(field .reading.axes)" opengl
call POST "/v1/scenes?reading=%7B%7D" -T "$work/one"; expect 200; equal "$(field '.reading | tojson')" '{}' "said otherwise"

# --- with one in parts ---
echo "another bundle" >"$work/two"
create() {
    call POST /v1/uploads -H 'Tus-Resumable: 1.0.0' -H "Upload-Length: $(stat -c %s "$work/two")" \
        -H "Upload-Metadata: reading $(printf %s "$1" | base64 -w 0)"
}
create '{"axes":"up"}'; expect 400; field .detail | grep -q 'axes must be' || fail "which fault: $(cat "$work/body")"
create '{'; expect 400
create '{"scale":0.001}'; expect 201; upload=$(header location)
call GET "$upload"; equal "$(field .reading.scale)" 0.001 "the reading of an upload"
call PATCH "$upload" -H 'Tus-Resumable: 1.0.0' -H 'Content-Type: application/offset+octet-stream' -H 'Upload-Offset: 0' \
    --data-binary "@$work/two"
expect 204; two=$(header link | sed 's/^<\(.*\)>.*/\1/')
call GET "$two"; equal "$(field '.reading | tojson')" '{"scale":0.001}' "the reading of its scene"
finish
