#!/bin/bash
# `unbake check` and how a room is said to be read: first against a store that a test moves (idle.c), whose checks find
# what the test says, then against the real daemon.
. tests/api/client.sh "$@"
move() { echo "$*" >&"${idle[1]}"; read -r answer <&"${idle[0]}"; equal "$answer" ok "$*"; }
so() { jq -e "$1" <<<"$out" >/dev/null 2>&1 || fail "not so: $1: $out"; }

coproc idle { exec "$build/tests/api/idle"; }
read -r UNBAKE_SERVER scene idle_dir <&"${idle[0]}"
export UNBAKE_SERVER
picture() { mkdir -p "$idle_dir/scenes/$scene/previews"; printf '\x89PNG %s' "$1" >"$idle_dir/scenes/$scene/previews/$1"; }
picture plan.png
picture overlay_000.png

# --- what was found is shown: told by the exit status, with the command that mends it, pictures fetched ---
# found FACTS: what the next check finds.
found() { curl -s -o "$work/body" -X PATCH -H 'Content-Type: application/json' -d '{"reading":{}}' "$UNBAKE_SERVER/v1/scenes/$scene"; move ready "$1"; }
found '{"fit":{"verdict":"no","evidence":["93 of 100 rays hit nothing"],"remedy":{"mesh_axes":"x -z y"},"remedy_text":"the mesh is y-up"},"warnings":["images/7.png is blurred"],"table":[{"label":"frames used","value":"48 of 52"}],"previews":[{"name":"plan.png","caption":"from above"},{"name":"overlay_000.png"}]}'
run 6 check --scene "${scene:0:10}" --pictures "$work/pictures"
for part in "frames used      48 of 52" "fit              no" "93 of 100 rays" "the mesh is y-up" \
    "unbake scenes set ${scene:0:12} mesh_axes='x -z y'" "warning: images/7.png is blurred"; do has "$out" "$part"; done
cmp -s "$work/pictures/plan.png" "$idle_dir/scenes/$scene/previews/plan.png" || fail "plan.png is not the picture"
equal "$(ls "$work/pictures" | tr '\n' ' ')" "overlay_000.png plan.png "
run 6 check --scene "$scene" --json
so '.facts.fit.verdict == "no"'
equal "$err" ""
run 6 submit --scene "$scene"
has "$err" "the mesh is y-up: \`unbake scenes set"
run 6 submit --scene "$scene" --json
jq -e '.remedy.mesh_axes == "x -z y" and .warnings == ["images/7.png is blurred"]' <<<"$err" >/dev/null || fail "no remedy: $err"
run 0 submit --scene "$scene" --set fit=ignore
has "$err" "warning: images/7.png is blurred"
run 0 cancel last
run 0 scenes
has "$(head -n 1 <<<"$out" | tr -s ' ')" "state fit size"
run 0 scenes show "$scene"
has "$out" "frames used      48 of 52"
[[ $out != *'"verdict"'* ]] || fail "facts are shown twice: $out"
found '{"fit":{"verdict":"doubtful","evidence":["plain walls: it cannot be told"]}}'
run 0 check --scene "$scene"
run 0 submit --scene "$scene" --dry-run
has "$err" "plain walls"
run 0 submit --scene "$scene" --dry-run --json
so '.fit.verdict == "doubtful" and .upload_bytes == 0'
found '{"fit":{"verdict":"yes","remedy":{"scale":0.001},"remedy_text":"the mesh is in millimetres","taken":true},"previews":[{"name":"../x.png"}]}'
run 0 submit --scene "$scene" --dry-run
has "$err" "applied: the mesh is in millimetres"
run 7 check --scene "$scene" --pictures "$work/pictures"
has "$err" "unsafe name"
exec {idle[1]}>&-
wait "$idle_PID"

# --- sent once; read as was said, and checked again for it ---
make_room "$work/room"
mv "$work/room/mesh.ply" "$work/room/walls.ply"
daemon_start
run 2 check "$work/room" --scene-set axes=sideways
has "$err" "opengl-inverse"
run 2 check
run 4 check "$work/room" --scene-set mesh=nothing.ply
has "$err" "sent room"
has "$out" "nothing.ply"
run 4 check "$work/room" --scene-set mesh=nothing.ply --json
so '.state == "rejected" and .reading.mesh == "nothing.ply"'
run 0 check "$work/room" --scene-set mesh=walls.ply
has "$err" "has this room already"
has "$out" "mesh=walls.ply"
run 0 check "$work/room" --json
so '.state == "ready" and .reading == {"mesh": "walls.ply"}'
id=$(jq -r .id <<<"$out")
run 0 scenes set "${id:0:8}" exposures=ignored scale=0.5 --json
so '.state == "ready" and .reading == {"exposures": "ignored", "scale": 0.5}'
# A photograph that was left out is told also where the mesh is the fault.
make_room "$work/broken"
head -c 60 "$work/room/images/1.png" >"$work/broken/images/1.png"
head -c 200 "$work/room/walls.ply" >"$work/broken/mesh.ply"
run 4 submit "$work/broken" --dry-run
has "$err" "mesh.ply: "
has "$err" "warning: images/1.png"
out=$("$build/unbaked" check "$work/broken") && fail "unbaked check: a broken mesh is accepted"
has "$out" "problem: mesh.ply: "
has "$out" "warning: images/1.png"
run 2 scenes set
run 2 scenes set "$id" scale=big
run 2 scenes set "$id" --pin
run 3 scenes set ffffffff scale=2
run 0 submit "$work/room" $tiny --watch
has "$err" "read with scale=0.5 exposures=ignored"
run 0 submit "$work/room" --scene-set scale=0.25 --dry-run --json
so '.dry_run and .upload_bytes == 0 and .scene_state == "ready"'
run 0 scenes show "$id" --json
so '.reading == {"scale": 0.25}'
daemon_end TERM
finish
