#!/bin/bash
# Peak memory of a reconstruction from 300 photographs of 12 megapixels. They are reduced as a job of draft quality does (1.6
# megapixels); with photograph_megapixels=0 in MANY_SETTINGS their pixels (40 GB with what is found of them) lie on the disk, and
# it takes hours. Prints lines "name value goal better". MANY_FACTOR: size of the photographs, 10 for
# 4000 x 3000; MANY: their number; MANY_MIB: memory for pixels; all smaller for a trial, with MANY_SETTINGS for the job, as
# MANY=60 MANY_FACTOR=4 MANY_MIB=400 MANY_SETTINGS="texture_size=512 iterations=2 report_samples=1". usage: many_photographs.sh BUILD
set -u
build=$1
. tests/bench/lib.sh
factor=${MANY_FACTOR:-10}
count=${MANY:-300}
mib=${MANY_MIB:-4096}
small=$build/bench/many_small
room=$build/bench/many_room
out=$build/bench/many
rm -rf "$small" "$room"
"$build/unbaked" demo-room "$small" --sdr --width 400 --height 300 --frames 20 --test-frames 1 --spp 8 --test-spp 8 >/dev/null &&
    "$build/tests/bench/enlarge_room" "$small" "$room" "$factor" $((count / 20)) && cp "$small"/mesh.* "$room/" || exit 1
# shellcheck disable=SC2086
ROOM_PIXEL_MIB=$mib reconstruct "$room" "$out" ${MANY_SETTINGS:-quality=draft texture_size=2048 report_samples=1} || exit 1
rm -rf "$out" "$small" "$room"
awk -v size="$((factor * 400)) x $((factor * 300))" -v count="$count" '
    /^peak memory/ {
        printf "peak memory of %d photographs of %s, GiB\t%.3f\t8\tlower\n", count, size, $3 / 1024
        printf "  and time, s\t%.0f\t\t\n", $6
    }
    /^pixels in a file/ { printf "  and pixels on the disk, GiB\t%.3f\t\t\n", $5 / 1024 }' "$out.log"
