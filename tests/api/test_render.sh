#!/bin/bash
# Renders and evaluations of a reconstruction: what is refused, files that come with a job, what is kept as long as it is
# read, a crash in the middle of several pictures, and the lane of small renders.
set -u
. tests/api/client.sh "$@"
lamp="--set lamp.1.kind=sphere --set lamp.1.position=0,1,0 --set lamp.1.radius=0.3"
make_room "$work/room" 8
mkdir "$work/lib"
ln -s "$build/tests/chaos/preload/oidn.so" "$work/lib/libOpenImageDenoise.so.2"
export LD_LIBRARY_PATH=$work/lib # of the daemon
hold new "$data" || exit 1
held daemon_start --set threads=2 --set small_render_paths=100000 --set max_attempts=9
unset LD_LIBRARY_PATH
# shellcheck disable=SC2086
run 0 submit "$work/room" $tiny --watch
scene=$("$build/unbake" show 1 --json | jq -r .scene)

post() { # post STATUS JSON
    call POST "/v1/jobs${3:-}" -H 'Content-Type: application/json' --data-binary "$(json "$2")"
    expect "$1" "POST of $2"
}
names() { field '[.invalid_params[].name] | sort | join(" ")'; }

# --- what is refused, all of it at once ---
post 422 '{"kind":"draw","settings":{}}'; equal "$(names)" "kind scene"
post 422 '{"kind":"render","scene":"0123456789","settings":{"spp":0,"nothing":1,"environment":"../sky.hdr"},"priority":1000}'
equal "$(names)" "priority scene settings.environment settings.nothing settings.spp source"
post 422 '{"kind":"render","source":4711}'; equal "$(names)" "source"
post 422 '{"kind":"reconstruct","scene":"'"$scene"'","source":1}'; equal "$(names)" "source"
post 422 '{"kind":"evaluate","source":1,"settings":{"spp":1}}'; equal "$(names)" "settings"
post 409 '{"kind":"evaluate","source":1}'; has "$(field .detail)" "no truth"
call GET '/v1/jobs?kind=nothing'; expect 400
call GET '/v1/settings?kind=render'; expect 200; equal "$(field '[.items[].name] | index("light.#") != null')" true
call GET '/v1/settings?kind=evaluate'; expect 400
run 4 render 1 --set nothing=1 --spp 0
has "$err" "settings.nothing"; has "$err" "settings.spp"
post 422 '{"kind":"render","source":1,"settings":{"executor":"nowhere","parts":1001}}'
equal "$(names)" "settings.executor settings.parts"
run 7 render 1 --environment "$work/none.hdr"
# what the room has not
post 422 '{"kind":"render","source":1,"settings":{"light.99":"off","segment.77.specular":0.5,"remove":"door","view":"0,99"}}'
equal "$(names)" "settings.light.99 settings.remove settings.segment.77.specular settings.view"
post 422 '{"kind":"render","source":1,"settings":{"cameras":"photographs","path":"0,8"}}'; equal "$(names)" "settings.path"

# --- a picture, and what it is beforehand ---
# shellcheck disable=SC2086
run 0 render 1 $lamp --spp 16 --dry-run --json
equal "$(jq -c '[.kind, .source, .paths, .small, .files]' <<<"$out")" '["render",1,12288,true,[]]' "dry run"
run 0 render 1 $lamp --spp 16 -q -o "$work/a"
[ -s "$work/a/00000_radiance.png" ] && [ -s "$work/a/views.json" ] || fail "no picture: $(ls "$work/a")"
run 0 list --kind render --json
equal "$(jq -c 'map([.id, .kind, .source])' <<<"$out")" '[[2,"render",1]]' "list of renders"
post 409 '{"kind":"render","source":2}'; has "$(field .detail)" "its kind is render"
call POST /v1/jobs/2/extend -H 'Content-Type: application/json' -d '{"looks":1}'; expect 409
call POST '/v1/jobs/2/retry?from=solve'; expect 400
run 0 retry 2 --from render -q
wait_for 60 job_is 2 succeeded
run 0 get 2 -q -o "$work/b"
cmp "$work/a/00000_radiance.png" "$work/b/00000_radiance.png" || fail "done again it differs"

# --- files, and what stays as long as it is read ---
cp "$work/room/images/1.png" "$work/sky.png"
post 201 '{"kind":"render","source":1,"settings":{"environment":"sky.png","spp":4}}'
equal "$(field .state)" paused; has "$(field .reason)" "waits for its files"
equal "$(field '.files[0].name + " \(.files[0].bytes)"')" "sky.png null" "the files"
call DELETE /v1/jobs/1; expect 409 "removing what is read"; has "$(field .detail)" "job 3 reads the outputs of job 1"
call DELETE '/v1/jobs/1?dry_run=1'; expect 409
call POST '/v1/jobs/1/retry?from=report'; expect 409 "a retry of what is read"
call POST /v1/jobs/3/resume; expect 409; has "$(field .detail)" "sky.png"
call PUT /v1/jobs/3/files/other.png -T "$work/sky.png"; expect 404; has "$(field .hint)" "sky.png"
call PUT /v1/jobs/3/files/sky.png -T "$work/sky.png" -H "X-Content-SHA256: $(sha256sum </dev/null | cut -c 1-64)"; expect 422
call PUT /v1/jobs/3/files/sky.png -T "$work/sky.png"; expect 200; [ "$(field .state)" != paused ] || fail "it still waits"
equal "$(field '.files[0].sha256')" "$(sha256sum <"$work/sky.png" | cut -c 1-64)" "its digest"
wait_for 60 job_is 3 succeeded
call PUT /v1/jobs/3/files/sky.png -T "$work/sky.png"; expect 409
mkdir "$work/maps"; cp "$work/sky.png" "$work/maps/day.png"
run 0 render 1 --environment day.png --file "$work/maps/day.png" --spp 4 -q -o "$work/c"
run 0 render 1 --environment "$work/maps/day.png" --spp 4 -q -o "$work/d"
cmp "$work/c/00000_radiance.png" "$work/d/00000_radiance.png" || fail "--file and a path differ"
run 2 render 1 --spp 4 --file "$work/sky.png"

# --- a mesh with its own materials, which are in a file of their own ---
printf 'mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n' >"$work/m.obj"
printf 'newmtl red\nKd 1 0 0\nd 0.5\n' >"$work/m.mtl"
# shellcheck disable=SC2086
run 0 render 1 $lamp --spp 4 --set insert.1.file="$work/m.obj" --set attach.1="$work/m.mtl" -q; id=$out
wait_for 60 job_is "$id" succeeded
run 0 get "$id" -q -o "$work/m"
equal "$(jq -c '[.settings["insert.1.file"], .settings["attach.1"]]' "$work/m/views.json")" '["m.obj","m.mtl"]' "files"
run 0 logs "$id"; has "$out" 'not rendered: transparency (1)'

# --- a denoiser's library, where there is one: guided by base colour and normals, and said in the files ---
# shellcheck disable=SC2086
run 0 render 1 $lamp --spp 4 --set denoise=true --set format=exr --set passes=radiance,direct -q -o "$work/smooth"
equal "$(jq -c '[.denoiser, .frames[].denoised]' "$work/smooth/views.json")" '["Open Image Denoise 2.99.1",true]' "the denoiser"
for pass in radiance direct; do
    grep -aq "Open Image Denoise 2.99.1" "$work/smooth/00000_$pass.exr" || fail "$pass does not say that it is denoised"
    # of 32 x 24 equal pixels
    [ "$(stat -c %s "$work/smooth/00000_$pass.exr")" -lt 1024 ] || fail "$pass is not what the library made of it"
done

# --- a worker dies in the middle of several pictures: those that are done stay, and all bytes are the same ---
many="--set cameras=photographs --view all --size 64x48 --spp 10 --set format=both"
hold slow 10 # a picture takes some eighty operations on files
# shellcheck disable=SC2086
run 0 render 1 $lamp $many -q; id=$out
rendered() { [ "$("$build/unbake" show "$id" --json | jq '[.outputs[] | select(.name | test("radiance.exr"))] | length')" -ge "$1" ]; }
attempt() { "$build/unbake" show "$id" --json | jq .attempt; }
worker() { grep "job $id: attempt $(attempt) runs as process" "$work/log" | sed 's/.*process \([0-9]*\) .*/\1/'; }
wait_for 60 rendered 2
# what has happened is told in its order, not what is so now before it
"$build/unbake" watch "$id" --all >"$work/told" &
background=$!
wait_for 60 test -s "$work/told"
kill "$background"
has "$(head -n 1 "$work/told")" queued
kill -KILL "$(worker)"
died() { [ "$(attempt)" = 2 ]; }
wait_for 60 died
run 0 pause "$id" -q # at the next picture
wait_for 60 job_is "$id" paused
daemon_end KILL
daemon_start --set threads=1 --set small_render_paths=100000 --set max_attempts=9
run 0 resume "$id" -q
wait_for 120 job_is "$id" succeeded
run 0 get "$id" -q -o "$work/broken"
# shellcheck disable=SC2086
run 0 render 1 $lamp $many -q -o "$work/whole"
diff -r -x preview "$work/broken" "$work/whole" || fail "broken off and gone on with, it differs"
equal "$(find "$work/whole" -name '*.exr' | wc -l)" 8 "pictures"

# --- what is wrong with the room, or not in it, is said once, and without where it lies here ---
cannot() { # cannot PART ARGUMENT...: the render fails with its first attempt
    local part=$1
    shift
    run 1 render 1 "$@" -o "$work/none"
    has "$out" "$part"
    [ ! -e "$work/none" ] || fail "a render that failed has left files"
    equal "$("$build/unbake" list --kind render --json | jq -c '.[0] | [.attempt, .attempts_left]')" '[1,9]' "attempts of what cannot be"
}
cannot "Nothing shines" --lights off --environment none
call GET "/v1/jobs?kind=render"; has "$(field '.items[0].hint')" "add a lamp"
printf '{"w":8,"h":6,"fl_x":8,"fl_y":8,"frames":[{"file_path":"a","transform_matrix":[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}]}' \
    >"$work/cameras.json"
# shellcheck disable=SC2086
cannot 'setting view: cameras.json has no view "99" among its 1' $lamp --set cameras="$work/cameras.json" --view 99

# --- a small render does not wait behind a reconstruction, a large one does ---
run 0 submit "$work/room" $endless -q
room=$out
wait_for 60 job_is "$room" running
# shellcheck disable=SC2086
run 0 render 1 $lamp --spp 2000 -q; large=$out
# shellcheck disable=SC2086
run 0 render 1 $lamp --spp 16 -q -o "$work/e"
job_is "$room" running || fail "the reconstruction does not run beside the render"
job_is "$large" queued || fail "a large render runs beside the reconstruction"
cmp "$work/a/00000_radiance.png" "$work/e/00000_radiance.png" || fail "beside a reconstruction it differs"
run 0 cancel "$large" "$room" -q

# --- the reconstruction goes when nothing reads it any more; the pictures stay ---
run 0 rm 1 -q
call GET /v1/jobs/2; expect 200; equal "$(field .source)" 1
call POST '/v1/jobs/2/retry?from=render'; expect 409; has "$(field .detail)" "there is no job 1"
run 4 render 1; has "$err" "there is no job 1"
daemon_end TERM
finish
