#!/bin/sh
# Installs the Debian packages that building, running and testing need, if any is missing.
# Does nothing, and asks for no rights, when all are there.
#
# install-deps.sh oidn: also Intel Open Image Denoise, which takes the noise out of renders (denoise=true), from PyPI's
# pyoidn into /usr/local/lib/unbake.
#
# install-deps.sh bench: also what the benches against Mitsuba 3 need (Mitsuba itself comes from
# PyPI, see tests/bench/run.sh). They can do without: where these packages are not to be had, that
# is said and the exit status is still 0.
# install-deps.sh slurm: a Slurm for tests/chaos/test_slurm.sh, which starts daemons of its own and leaves the system's alone.
set -eu
packages="gcc make pkg-config libc6-dev libembree-dev libopenexr-dev libmicrohttpd-dev libgnutls28-dev libcjson-dev
libsqlite3-dev libarchive-dev libpng-dev libjpeg62-turbo-dev|libjpeg-dev libtiff-dev libwebp-dev libheif-dev
liblcms2-dev libmeshoptimizer-dev libcurl4-openssl-dev libseccomp-dev libexpat1-dev libunistring-dev zlib1g-dev libjs-three
curl jq sqlite3 zip zstd ca-certificates"
fuzz_packages="clang libclang-rt-14-dev|libclang-rt-19-dev|libclang-rt-18-dev"
coverage_packages="gcovr"
portable_packages="mmdebstrap"
format_packages="clang-format-14|clang-format"
room_packages="libllvm19 python3-venv sweethome3d-furniture"
slurm_packages="slurmctld slurmd slurm-client munge"
bench_packages="libllvm19 python3-venv"

is_installed() {
    [ "$(dpkg-query -W -f '${db:Status-Status}' "$1" 2>/dev/null || true)" = installed ]
}

# any_installed A|B...: whether one of the names that a package has in different releases is
any_installed() {
    for name in $(echo "$1" | tr '|' ' '); do
        if is_installed "$name"; then return 0; fi
    done
    return 1
}

# choose A|B...: the first that this release has, or A
choose() {
    for name in $(echo "$1" | tr '|' ' '); do
        if apt-cache show "$name" >/dev/null 2>&1; then
            echo "$name"
            return
        fi
    done
    echo "${1%%|*}"
}

# install PACKAGE...: those that are missing; A|B: whichever of the two names this release has
install() {
    missing=""
    for package in "$@"; do
        any_installed "$package" || missing="$missing $package"
    done
    [ -n "$missing" ] || return 0

    echo "installing:$missing"
    run=""
    if [ "$(id -u)" -ne 0 ]; then
        if ! command -v sudo >/dev/null 2>&1; then
            echo "these packages are missing and neither root nor sudo is at hand:$missing" >&2
            return 1
        fi
        run="sudo"
    fi
    $run apt-get update -qq || return 1
    chosen=""
    for package in $missing; do
        chosen="$chosen $(choose "$package")"
    done
    # shellcheck disable=SC2086
    $run env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends \
        $chosen >/dev/null
}

# shellcheck disable=SC2086
install $packages
# Decoders of HEIC and AVIF, which are packages of their own since libheif 1.16 (Debian 13).
case $(dpkg-query -W -f '${Version}' libheif1 2>/dev/null) in
1.?.* | 1.1[0-5].*) ;;
*) install libheif-plugin-libde265 libheif-plugin-aomdec ;;
esac
# shellcheck disable=SC2086
case ${1:-} in
fuzz) install $fuzz_packages ;;
coverage) install $coverage_packages ;;
portable) install $portable_packages ;;
format) install $format_packages ;;
rooms) install $room_packages ;;
slurm) install $slurm_packages ;;
esac
# The library and what it loads for processors; root or sudo.
install_oidn() {
    to=/usr/local/lib/unbake
    [ -e "$to/libOpenImageDenoise.so.2" ] && return 0
    run=""
    [ "$(id -u)" = 0 ] || run=sudo
    install python3-venv || return 1
    work=$(mktemp -d) || return 1
    python3 -m venv "$work/venv" && "$work/venv/bin/pip" -q install --no-deps pyoidn || { rm -rf "$work"; return 1; }
    lib=$(echo "$work"/venv/lib/python3*/site-packages/pyoidn/oidn/lib)
    $run mkdir -p "$to" && $run cp "$lib"/libOpenImageDenoise.so.2 "$lib"/libOpenImageDenoise_core.so.* \
        "$lib"/libOpenImageDenoise_device_cpu.so.* "$lib"/libtbb.so.12 "$to"
    status=$?
    rm -rf "$work"
    return $status
}
if [ "${1:-}" = oidn ]; then install_oidn; fi
if [ "${1:-}" = bench ]; then
    # shellcheck disable=SC2086
    install $bench_packages ||
        echo "the benches against Mitsuba 3 will be left out: $bench_packages cannot be installed" >&2
fi
