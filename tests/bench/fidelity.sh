#!/bin/bash
# How near the default method comes to the truth of rooms that another renderer made: each room from
# its HDR frames and from its 8-bit frames of cycling exposure, 2048 x 2048, everything recovered
# together. Prints a table, writes BUILD/fidelity.json and, under BUILD/fidelity/ROOM-KIND, the outputs
# (out/), and of each held-out view base_color_NNN.png (true | recovered) and view_NNN.png
# (photograph | re-render). The figures are those of `unbaked evaluate`; MSRE is taken against the
# HDR photographs in both cases, free of the re-renders' noise (the product of two renders' errors): what is left is the
# photographs' noise and ours.
#
# FIDELITY_QUALITY  setting quality of a reconstruction (standard)
# FIDELITY_ROOMS  names under the test data's rooms/, or paths ("staircase2 bathroom")
# FIDELITY_CONTRAST  of tones: 0 none, .6 much (.6)
# FIDELITY_KINDS  "hdr sdr scan phone"; also tones: ordinary frames, each of an automatic exposure that is told, of a camera
#                 with contrast (tone_curve.py; takes numpy, OpenEXR and pillow from PyPI into BUILD/retinex)
#
# scan and phone: the mesh that a scan of the room gives, and that with drifting poses and one 8-bit exposure a view of a
# phone (rooms/NAME-scan, rooms/NAME-phone), judged by scan_scores: pixels where the scan has a hole are left out, and
# the capture's own frame is laid over the room's. Ceilings beside them: what fusing the true base colours of the training
# photographs onto that mesh scores, with the poses that the capture tells (scan_ceiling); they need the room's hdr, by
# this run or an earlier one.
#
# usage: fidelity.sh BUILD
set -u
build=$1
quality=${FIDELITY_QUALITY:-standard}
. tests/bench/lib.sh
rows=$build/fidelity.tsv
: >"$rows"

# Goals of base colour PSNR, roughness PSNR, emission overlap, its log error, MSRE. Of the room
# bathroom also for rooms that are not named here.
goals() { # ROOM KIND
    case $1-$2 in
    staircase2-hdr) echo 30 26 0.97 0.005 0.02 ;;
    staircase2-sdr) echo 29 25 0.96 0.01 0.03 ;;
    *-hdr) echo 29 25 0.97 0.005 0.03 ;;
    *) echo 28 24 0.96 0.01 0.04 ;;
    esac
}

row() { # WHAT VALUE GOAL BETTER
    printf '%s (%s)\t%s\t%s\t%s\n' "$1" "$label" "$2" "$3" "$4" >>"$rows"
}

measure() { # ROOM KIND
    local name=${1##*/} dir room from label transforms=transforms.json color roughness overlap log_error msre
    room=$1
    [ "$name" = "$1" ] && room=$data/rooms/$1
    dir=$build/fidelity/$name-$2
    label="$name, $2"
    [ "$2" = sdr ] && transforms=transforms_sdr.json
    if [ ! -e "$room/$transforms" ] || [ ! -d "$room/truth" ]; then
        echo "$label: no $room with $transforms and truth: left out" >&2
        return
    fi
    rm -rf "$dir"
    mkdir -p "$dir"
    echo "== $label" >&2
    from=$room
    if [ "$2" = tones ]; then
        from=$dir/room
        picture_python && "$python" tests/bench/tone_curve.py "$room" "$from" "${FIDELITY_CONTRAST:-0.6}" || return
    fi
    reconstruct "$from" "$dir/out" texture_size=2048 "quality=$quality" \
        "transforms=$transforms" report_samples=1 &&
        evaluate "$room" "$dir/out" --spp 64 --pictures "$dir" &&
        jq -r '[.stages[] | "\(.name) \(.seconds | round) s"] | join(", ")' "$dir/out/report.json" >&2
    # Where that failed the figures are null, and no goal is met.
    value() { figure "$dir/out" "$1"; }
    read -r color roughness overlap log_error msre < <(goals "$name" "$2")
    row "base colour PSNR of seen surface, dB" "$(value base_color_psnr_db)" "$color" higher
    row "base colour PSNR of all surface, dB" "$(value base_color_psnr_all_db)" $((color - 3)) higher
    row "errors within one standard deviation of confidence.exr" "$(value base_color_within_one_deviation)" - higher
    row "spread of base colour on plain surface" "$(value plain_deviation)" - lower
    row "plain pixels off their surroundings by more than .03, share" "$(value plain_specks)" - lower
    row "roughness PSNR, dB" "$(value roughness_psnr_db)" "$roughness" higher
    row "specular PSNR, dB" "$(value specular_psnr_db)" - higher
    row "emission, intersection over union" "$(value emission_iou)" "$overlap" higher
    row "emission, log error" "$(value emission_log_error)" "$log_error" lower
    row "MSRE of held-out views" "$(value msre)" "$msre" lower
    row "MSRE of even places" "$(value msre_even)" - lower
    row "MSRE of even places, the photographs' noise" "$(value msre_even_noise)" - lower
    row "MSRE of views with a flat render" "$(value msre_floor_views)" - lower
    row "MSRE of these, the photographs' noise" "$(value msre_floor)" - lower
    row "time of all stages but the report, minutes" "$(quotient "$(working_sec "$dir/out")" 60)" - lower
}

# Goals of base colour PSNR, the same away from outlines, roughness, specular, emission overlap.
scan_goals() { # ROOM KIND
    case $1-$2 in
    staircase2-scan) echo 21.2 24.6 22 20 0.90 ;;
    *-scan) echo 22.5 25.5 22 20 0.90 ;;
    staircase2-phone) echo 19.5 21.5 19 17 0.85 ;;
    *) echo 20.5 22.5 19 17 0.85 ;;
    esac
}

# The bundle of a scan, which may lack photographs: those of the room, in $dir/room.
lay_out() { # ROOM KIND
    mkdir -p "$dir/room"
    cp -r "$1-$2/." "$dir/room"
    [ -e "$dir/room/transforms.json" ] || cp -r "$1/transforms.json" "$1/images" "$dir/room"
}

# Of the capture in $dir/room, into $dir/ceiling.evaluation.json. OUT: what was recovered on the room's own mesh.
ceiling() { # ROOM OUT
    if [ ! -e "$2/base_color.exr" ]; then
        echo "$label: no ceilings without the room's hdr" >&2
        return
    fi
    "$build/tests/bench/scan_ceiling" "$1" "$2" "$dir/room" "$dir/ceiling" &&
        "$build/tests/bench/scan_scores" "$1" "$dir/ceiling" "" "$dir/ceiling/truth" >"$dir/ceiling.evaluation.json"
    rm -rf "$dir/ceiling"
}

measure_scan() { # ROOM KIND
    local name=${1##*/} dir room label color inside roughness specular overlap
    room=$1
    [ "$name" = "$1" ] && room=$data/rooms/$1
    dir=$build/fidelity/$name-$2
    label="$name, $2"
    if [ ! -e "$room-$2/mesh.ply" ] || [ ! -d "$room/truth" ]; then
        echo "$label: no $room-$2 with a mesh, or no truth of $room: left out" >&2
        return
    fi
    rm -rf "$dir"
    mkdir -p "$dir"
    echo "== $label" >&2
    lay_out "$room" "$2"
    reconstruct "$dir/room" "$dir/out" texture_size=2048 "quality=$quality" report_samples=1 &&
        "$build/tests/bench/scan_scores" "$room" "$dir/out" "$dir" >"$dir/out.evaluation.json"
    ceiling "$room" "$build/fidelity/$name-hdr/out"
    rm -rf "$dir/room"
    value() { figure "$dir/out" "$1"; }
    read -r color inside roughness specular overlap < <(scan_goals "$name" "$2")
    row "base colour PSNR of seen surface, dB" "$(value base_color)" "$color" higher
    row "its ceiling" "$(figure "$dir/ceiling" base_color)" - higher
    row "base colour PSNR away from outlines, dB" "$(value base_color_inside)" "$inside" higher
    row "its ceiling away from outlines" "$(figure "$dir/ceiling" base_color_inside)" - higher
    row "errors within one standard deviation of confidence.exr" "$(value within_one_deviation)" - higher
    row "roughness PSNR, dB" "$(value roughness)" "$roughness" higher
    row "specular PSNR, dB" "$(value specular)" "$specular" higher
    row "emission, intersection over union" "$(value emission_overlap)" "$overlap" higher
    row "lamps missed" "$(value lamps_missed)" 0 lower
    row "false lamps" "$(value false_lamps)" 0 lower
    row "time of all stages but the report, minutes" "$(quotient "$(working_sec "$dir/out")" 60)" - lower
}

for room in ${FIDELITY_ROOMS:-staircase2 bathroom}; do
    for kind in ${FIDELITY_KINDS:-hdr sdr scan phone}; do
        case $kind in
        scan | phone) measure_scan "${room%/}" "$kind" ;;
        *) measure "${room%/}" "$kind" ;;
        esac
    done
done
tests/table.sh "$rows" "$build/fidelity.json"
echo "pictures: $build/fidelity/ROOM-KIND/*.png"
rm -f "$rows"
