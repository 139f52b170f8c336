#!/bin/bash
# How much results move with each constant of the engine: every `#define NAME NUMBER` of the folders is made a quarter
# larger (a whole number by one at least), in a copy of the tree, the small demo room is reconstructed with a fixed amount of work and
# compared with its truth. One line a constant, to BUILD/sensitivity.tsv: what it changed to, and by how many dB base
# colour, roughness and specular moved against the tree as it is; "same" where not a byte of base_color.exr did (the
# room does not exercise it), "broken" where nothing came out. Some ten seconds a constant; a run that was stopped goes
# on where it was.
#
# SENSITIVITY           folders ("server/capture server/gather server/material server/refine")
# SENSITIVITY_ROOM      a room with its truth instead: server/light wants lamps, sky and sun (make rooms), of which the demo
#                       room has none that is hidden
# SENSITIVITY_SETTINGS  of the job; refine moves little in two iterations, and its listing1 wants method=listing1
#
# usage: sensitivity.sh BUILD
set -u
build=$(realpath "$1")
folders=${SENSITIVITY:-server/capture server/gather server/material server/refine}
tree=$build/sensitivity/tree
room=${SENSITIVITY_ROOM:-$build/sensitivity/room}
table=$build/sensitivity.tsv
settings=${SENSITIVITY_SETTINGS:-texture_size=256 gather_samples=64 gloss_passes=1 iterations=2 report_samples=1}

[ -d "$room" ] || "$build/unbaked" demo-room "$room" --width 96 --height 72 --frames 32 --test-frames 4 --spp 16 \
    --test-spp 64 --texture-size 512 >/dev/null || exit 1
mkdir -p "$tree"
git ls-files -z common server tests client Makefile config | xargs -0 cp --parents -t "$tree" || exit 1

# measure OUT: dB of base colour, roughness, specular, and the sum of base_color.exr
measure() {
    rm -rf "$1"
    mkdir -p "$1"
    # shellcheck disable=SC2086
    make -s -C "$tree" build/tests/bench/reconstruct_room >"$1.log" 2>&1 &&
        "$tree/build/tests/bench/reconstruct_room" "$room" "$1" $settings >>"$1.log" 2>&1 &&
        "$build/unbaked" evaluate "$room" "$1" --spp 0 --json |
        jq -r '"\(.base_color_psnr_db)\t\(.roughness_psnr_db)\t\(.specular_psnr_db)"' | tr '\n' '\t' &&
        sha256sum <"$1/base_color.exr" | cut -c1-12
}

constants() {
    # shellcheck disable=SC2086
    grep -nE '^#define [A-Z][A-Z0-9_]* +\(?-?[0-9.]+(e-?[0-9]+)?[fF]?\)?( |$)' -r $folders --include='*.[ch]' |
        sed -E 's/^([^:]+):([0-9]+):#define ([A-Z0-9_]+) +\(?(-?[0-9.e-]+)[fF]?\)?.*/\1 \2 \3 \4/' | sort
}

base=$(measure "$build/sensitivity/out") || { echo "the tree as it is does not reconstruct its room" >&2; exit 1; }
read -r color roughness specular sum <<<"$base"
[ -s "$table" ] || printf 'file\tconstant\tvalue\tchanged to\tbase colour, dB\troughness, dB\tspecular, dB\n' >"$table"
while read -r file line name value; do
    grep -qP "^\Q$file\E\t$name\t" "$table" && continue
    larger=$(awk -v v="$value" -v name="$name" 'BEGIN {
        if (name ~ /BETA/) printf "%.6g", 1 - (1 - v) * 0.75 # a decay is below 1: a time constant a third longer
        else if (v ~ /[.e]/) printf "%.6g", v * 1.25
        else print v + (v >= 4 ? int(v / 4) : 1) }')
    [[ $value =~ [.e] && ! $larger =~ [.e] ]] && larger=$larger.0
    sed -i -E "${line}s/(#define $name +\(?)-?[0-9.]+(e-?[0-9]+)?/\1$larger/" "$tree/$file"
    moved=$(measure "$build/sensitivity/changed")
    cp "$file" "$tree/$file"
    awk -v OFS='\t' -v file="$file" -v name="$name" -v value="$value" -v larger="$larger" -v moved="$moved" -v c="$color" \
        -v r="$roughness" -v s="$specular" -v sum="$sum" 'BEGIN {
            n = split(moved, m, "\t")
            if (n < 4) print file, name, value, larger, "broken", "", ""
            else if (m[4] == sum) print file, name, value, larger, "same", "", ""
            else print file, name, value, larger, sprintf("%+.2f", m[1] - c), sprintf("%+.2f", m[2] - r), sprintf("%+.2f", m[3] - s)
        }' | tee -a "$table"
done < <(constants)
echo "wrote $table"
