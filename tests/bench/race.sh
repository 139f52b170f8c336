#!/bin/bash
# Time to a base-colour PSNR of RACE_DB (25 dB) on the room staircase2: ours over that of a script
# for Mitsuba 3 (mitsuba_inverse.py), to which emission, roughness and specular are given. Both have
# all cores and 2048 x 2048 texels, one after the other, and RACE_SEC (600) at most.
#
# Ours: whole runs of the default method, everything recovered together, whose time limit is doubled
# until the quality is reached; the time that counts is that of all stages but the report. Theirs:
# snapshots of one run; the first that is good enough counts. A side that never is good enough has
# the most that it may take for its time, and the line says so. Prints a line "name value goal
# better". usage: race.sh BUILD PYTHON
set -u
build=$1 python=$2
. tests/bench/lib.sh
limit=${RACE_SEC:-600} wanted=${RACE_DB:-25}
room=$data/rooms/staircase2
dir=$build/bench/race
if [ ! -d "$room" ]; then
    echo "no test data: the line on time to a quality is left out"
    exit 77
fi
rm -rf "$dir"
mkdir -p "$dir"

ours=$limit our_note=" (not reached)"
for ((seconds = 10; seconds <= limit; seconds *= 2)); do
    reconstruct "$room" "$dir/ours" texture_size=2048 report_samples=1 "time_limit_sec=$seconds" || exit 1
    evaluate "$room" "$dir/ours" --spp 0 || exit 1
    took=$(working_sec "$dir/ours")
    quality=$(figure "$dir/ours" base_color_psnr_db)
    printf 'ours: %.0f s: %.2f dB\n' "$took" "$quality"
    if at_least "$quality" "$wanted"; then
        ours=$took our_note=
        break
    fi
done

theirs=$limit their_note=" (not reached: an upper bound)"
"$python" tests/bench/mitsuba_inverse.py "$room" "$dir/ours" "$dir/snapshots" "$limit" \
    >"$dir/theirs.log" 2>&1 || { tail -n 3 "$dir/theirs.log"; exit 1; }
for snapshot in "$dir"/snapshots/*.exr; do
    cp "$snapshot" "$dir/ours/base_color.exr" # the rest of the outputs has no part in this figure
    evaluate "$room" "$dir/ours" --spp 0 || exit 1
    quality=$(figure "$dir/ours" base_color_psnr_db)
    seconds=$((10#$(basename "$snapshot" .exr)))
    printf 'Mitsuba: %d s: %.2f dB\n' "$seconds" "$quality"
    if at_least "$quality" "$wanted"; then
        theirs=$seconds their_note=
        break
    fi
done
rm -rf "$dir/snapshots"
printf '%s\t%s\t0.1\tlower\n' "time to $wanted dB$our_note over a Mitsuba 3 script's$their_note" \
    "$(quotient "$ours" "$theirs")"
