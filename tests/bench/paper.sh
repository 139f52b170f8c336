#!/bin/bash
# The experiments of the paper (Nimier-David et al. 2021) with this implementation, on the demo room,
# which is its section 6 rebuilt, and on the room staircase2 where the test data is. Prints a table,
# writes BUILD/paper.json and under BUILD/paper all outputs with side-by-sides.
#
# PAPER       short: small photographs and textures, seconds instead of minutes, to see that
#             everything runs. Its figures say little. draft: half of the photographs, each a quarter of the size,
#             textures of 512, meshes as in the long form: a minute or two a reconstruction, on a quiet machine.
#             Otherwise the long form: hours.
# PAPER_QUALITY  setting quality of a reconstruction (standard; short, draft: draft)
# PAPER_SEC   longest time limit that "speed" tries (600; short: 5)
# PAPER_ONLY  some of "fig4 fig7 fig8 table1 dense fig5 speed ablations"; dense: Table 1 as a scanner would have it; fig4
#             takes numpy, OpenEXR and pillow from PyPI into BUILD/retinex
#
# usage: paper.sh BUILD
set -u
build=$1
. tests/bench/lib.sh
dir=$build/paper
rows=$build/paper.tsv
if [ "${PAPER:-}" = short ]; then
    seconds=${PAPER_SEC:-5} quality=${PAPER_QUALITY:-draft} samples=4 size=512 edge=0.2 dense_edge=0.1
    views=(--width 80 --height 60 --frames 24 --test-frames 6 --spp 16 --test-spp 32)
elif [ "${PAPER:-}" = draft ]; then
    seconds=${PAPER_SEC:-600} quality=${PAPER_QUALITY:-draft} samples=16 size=512 edge=0.1 dense_edge=0.03
    views=(--width 160 --height 120 --frames 40 --test-frames 15 --spp 64 --test-spp 256)
else
    seconds=${PAPER_SEC:-600} quality=${PAPER_QUALITY:-standard} samples=16 size=2048 edge=0.1 dense_edge=0.03
    views=(--width 320 --height 240 --frames 80 --test-frames 30 --spp 64 --test-spp 256)
fi
mkdir -p "$dir"
: >"$rows"

row() { # NAME VALUE GOAL BETTER
    printf '%s\t%s\t%s\t%s\n' "$@" >>"$rows"
}

# The demo room with given radiance of the emitters on the wall and at the ceiling: $room is set.
demo_room() { # WALL CEILING [option]
    room=$dir/room-$1-$2${3:-}
    local made
    made="$* ${views[*]}"
    [ "$(cat "$room.made" 2>/dev/null)" = "$made" ] && return
    rm -rf "$room"
    "$build/unbaked" demo-room "$room" --wall-radiance "$1" --ceiling-radiance "$2" ${3:+"$3"} \
        "${views[@]}" >/dev/null &&
        echo "$made" >"$room.made"
}

# As lib.sh has it, with this form's size, samples and quality where none are given.
run() { # ROOM OUT [name=value ...]
    local from=$1 to=$2 default
    shift 2
    for default in "texture_size=$size" "report_samples=$samples" "quality=$quality"; do
        [[ " $* " == *" ${default%%=*}="* ]] || set -- "$@" "$default"
    done
    reconstruct "$from" "$to" "$@"
}

# MSRE of the held-out views as the reconstruction itself reports it, on the mesh that it was given.
reported_msre() { # OUT
    jq .metrics.msre "$1/report.json" 2>/dev/null || echo null
}

# Root of the mean square from a PSNR of values up to 1.
root_mean_square() {
    awk -v db="$1" 'BEGIN { if (db == "null") print db; else print 10 ^ (-db / 20) }'
}

# Fig. 7: the same room and cameras under three lightings. Base colour, roughness, specular: root of
# the mean squared error over the pixels of the held-out views. Emission: mean squared error of
# log(1 + radiance).
fig7() {
    local light wall ceiling base rough spec emission first=null third=null out name error
    while read -r wall ceiling base rough spec emission; do
        light="($wall, $ceiling)"
        demo_room "$wall" "$ceiling" || return
        out=$dir/fig7-$wall-$ceiling
        run "$room" "$out" && evaluate "$room" "$out" --spp 0 --pictures "$out/pictures"
        error=$(root_mean_square "$(figure "$out" base_color_psnr_db)")
        [ "$wall" = 15 ] && first=$error
        [ "$wall" = 25 ] && third=$error
        name="Fig. 7, wall and ceiling $light"
        row "$name: base colour, L2 error" "$error" "$base" lower
        row "$name: roughness, L2 error" "$(figure "$out" roughness_rms_error)" "$rough" lower
        row "$name: specular, L2 error" "$(figure "$out" specular_rms_error)" "$spec" lower
        row "$name: emission, log error" "$(figure "$out" emission_log_error)" "$emission" lower
    done <<<"15 15 0.0859 0.0308 0.1183 0.0003
0 20 0.1312 0.0342 0.1147 0.0002
25 3 0.1184 0.0648 0.1338 0.0002"
    row "Fig. 7: base colour error of (25, 3) over that of (15, 15)" "$(quotient "$third" "$first")" 1.1 lower
}

# Fig. 8: everything at once; then, in the long form, 8192 x 8192.
# Fig. 4: one photograph, that of a held-out view, against a single-image method.
fig4() {
    local room=$data/rooms/staircase2 out=$dir/fig4 view=1 frame=014
    if [ ! -e "$room/truth/$frame.exr" ]; then
        echo "no $room: fig4 is left out" >&2
        return
    fi
    picture_python || return
    run "$room" "$out" && rm -rf "$out.view" &&
        "$build/unbaked" relight "$out" --out "$out.view" --set passes=base_color --set format=exr --set view=$view --quiet &&
        "$python" tests/bench/retinex.py "$room/images/$frame.exr" "$room/truth/$frame.exr" \
            "$out.view/00000_base_color.exr" "$dir/single_image.png" >>"$rows"
}

fig8() {
    local out=$dir/fig8 memory total
    demo_room 15 15 || return
    run "$room" "$out" && evaluate "$room" "$out" --spp "$samples" --pictures "$out/pictures"
    row "Fig. 8: emitters found, of 2" "$(figure "$out" emitters_found)" 2 higher
    row "Fig. 8: other objects that emit" "$(figure "$out" emitters_false)" 0 lower
    row "Fig. 8: base colour PSNR of seen surface, dB" "$(figure "$out" base_color_psnr_db)" - higher
    row "Fig. 8: roughness PSNR, dB" "$(figure "$out" roughness_psnr_db)" - higher
    row "Fig. 8: specular PSNR, dB" "$(figure "$out" specular_psnr_db)" - higher
    row "Fig. 8: MSRE" "$(figure "$out" msre)" - lower
    [ -n "${PAPER:-}" ] && return
    out=$dir/fig8-8192
    run "$room" "$out" texture_size=8192
    read -r memory total < <(awk '/^peak memory/ { print $3 / 1024, $6 / 60 }' "$out.log")
    row "Fig. 8, 8192 x 8192: minutes" "${total:-null}" 30 lower
    row "Fig. 8, 8192 x 8192: GiB" "${memory:-null}" 8 lower
}

# MSRE on geometry that is spoiled in the ways of standard input, over that on the unspoiled. All meshes, the unspoiled
# too, have edges longer than EDGE halved and no shading normals. Decimation starts from a mesh with 0.5 mm of noise,
# since no scan is flat to the last bit, and is compared with that.
spoil() { # TITLE EDGE
    local what noise keep goal out flat=null rough=null base msre spoiled=$dir/spoiled title=$1 longest=$2
    while IFS=, read -r what noise keep goal; do
        rm -rf "$spoiled"
        cp -al "$room" "$spoiled" && rm -rf "$spoiled/truth" "$spoiled/mesh.ply"
        "$build/tests/bench/perturb_mesh" "$room/mesh.ply" "$spoiled/mesh.ply" "$longest" "$noise" "$keep" >/dev/null || {
            echo "$title: $what: left out" >&2
            continue
        }
        out=$dir/spoiled-$longest-$noise-$keep
        run "$spoiled" "$out"
        msre=$(reported_msre "$out")
        case $what in
        flat)
            flat=$msre
            row "$title, unspoiled: MSRE" "$msre" - lower
            ;;
        rough) rough=$msre ;;
        *)
            base=$flat
            [ "$keep" = 1 ] || base=$rough
            row "$title, $what: MSRE over the unspoiled" "$(quotient "$msre" "$base")" "$goal" lower
            ;;
        esac
    done
    rm -rf "$spoiled"
}

# Table 1 on the demo room, whose lamps stand out in frames.
table1() {
    demo_room 15 15 || return
    spoil "Table 1" "$edge" <<<"flat,0,1,-
noise of 0.5 cm,0.005,1,1.01
noise of 1 cm,0.01,1,1.02
noise of 3 cm,0.03,1,1.31
rough,0.0005,1,-
decimated to 75 %,0.0005,0.75,1.01
decimated to 50 %,0.0005,0.5,1.02
decimated to 10 %,0.0005,0.1,1.03"
}

# Table 1 on a mesh as dense as a scanner's, with edges of 2 cm in the mean, its lamps flush with wall and ceiling, as in
# the paper's offices.
dense() {
    demo_room 15 15 --flush-lamps || return
    spoil "Table 1, dense mesh, flush lamps" "$dense_edge" <<<"flat,0,1,-
noise of 0.5 cm,0.005,1,1.05
noise of 1 cm,0.01,1,1.1
noise of 3 cm,0.03,1,1.5
rough,0.0005,1,-
decimated to 75 %,0.0005,0.75,1.02
decimated to 50 %,0.0005,0.5,1.05
decimated to 10 %,0.0005,0.1,1.1"
}

# Fig. 5: segments found from the shape against those of the mesh.
fig5() {
    local given=$dir/fig5-given automatic=$dir/fig5-automatic
    demo_room 15 15 || return
    run "$room" "$given" segmentation=given
    run "$room" "$automatic" segmentation=automatic
    row "Fig. 5: MSRE with automatic over that with given segments" \
        "$(quotient "$(reported_msre "$automatic")" "$(reported_msre "$given")")" 1.02 lower
}

# The room for comparisons of methods: staircase2, else the demo room.
other_room() {
    room=$data/rooms/staircase2
    [ -d "$room" ] || demo_room 15 15
}

has_setting() { # NAME
    "$build/unbake" settings "$1" -q --retry 0 --server http://127.0.0.1:1 >/dev/null 2>&1
}

# The time in which the default method comes to the base colour that the published one has at last.
speed() {
    local out=$dir/speed wanted took published=(method=listing1) limit note=" (not reached)"
    other_room || return
    run "$room" "$out-published" report_samples=1 "${published[@]}" &&
        evaluate "$room" "$out-published" --spp 0
    wanted=$(figure "$out-published" base_color_psnr_db)
    took=$(working_sec "$out-published")
    echo "published: $took s: $wanted dB" >&2
    for ((limit = seconds / 64 > 0 ? seconds / 64 : 1; limit <= seconds; limit *= 2)); do
        run "$room" "$out-default" report_samples=1 "time_limit_sec=$limit" || return
        evaluate "$room" "$out-default" --spp 0
        echo "default: $(working_sec "$out-default") s: $(figure "$out-default" base_color_psnr_db) dB" >&2
        if at_least "$(figure "$out-default" base_color_psnr_db)" "$wanted"; then
            note=
            break
        fi
    done
    row "time of the default method over the published one's, to its base colour$note" \
        "$(quotient "$(working_sec "$out-default")" "$took")" 0.1 lower
}

# What each part is worth: the default without it, with as much work of the rest. Lines of settings that this
# version does not have are passed over.
ablations() {
    local what changes change out known
    other_room || return
    while IFS=, read -r what changes; do
        known=1
        for change in $changes; do
            has_setting "${change%%=*}" || known=
        done
        [ -n "$known" ] || continue
        out=$dir/ablation-${what// /-}
        # shellcheck disable=SC2086
        run "$room" "$out" report_samples=1 $changes && evaluate "$room" "$out" --spp "$samples"
        row "ablation, $what: base colour PSNR, dB" "$(figure "$out" base_color_psnr_db)" - higher
        row "ablation, $what: MSRE" "$(figure "$out" msre)" - lower
    done <<<"nothing left out,
noise left in,denoise=false
nothing refined,iterations=1
the published method,method=listing1
published; any segment may emit,method=listing1 emitters=any
published; one estimate instead of two,method=listing1 estimates=one
published; pixels instead of texels,method=listing1 choose=pixels
four times the observations,refine_looks=4000
exposures and gains as given,calibrate=false
one photograph a visit,cameras_per_texel=1
paths of 8 segments,max_depth=8
direct light alone,max_depth=2"
}

for part in ${PAPER_ONLY:-fig4 fig7 fig8 table1 dense fig5 speed ablations}; do
    case $part in
    fig4 | fig7 | fig8 | table1 | dense | fig5 | speed | ablations)
        echo "== $part ($SECONDS s)" >&2
        "$part"
        ;;
    *) echo "paper.sh: PAPER_ONLY has no '$part'" >&2 ;;
    esac
done
tests/table.sh "$rows" "$build/paper.json"
echo "outputs and pictures: $dir"
rm -f "$rows"
