#!/bin/sh
# Installs the Debian packages that building, running and testing need, if any is missing.
# Does nothing, and asks for no rights, when all are there.
#
# install-deps.sh bench: also what the benches against Mitsuba 3 need (Mitsuba itself comes from
# PyPI, see tests/bench/run.sh). They can do without: where these packages are not to be had, that
# is said and the exit status is still 0.
set -eu
packages="gcc make pkg-config libc6-dev libembree-dev libopenexr-dev libmicrohttpd-dev libgnutls28-dev libcjson-dev
libsqlite3-dev libarchive-dev libpng-dev libjpeg62-turbo-dev libcurl4-openssl-dev libseccomp-dev
zlib1g-dev curl jq sqlite3 zip zstd ca-certificates"
fuzz_packages="clang libclang-rt-14-dev"
coverage_packages="gcovr"
room_packages="libllvm19 python3-venv sweethome3d-furniture"
bench_packages="libllvm19 python3-venv libmeshoptimizer-dev"

# install PACKAGE...: those that are missing
install() {
    missing=""
    for package in "$@"; do
        state=$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null || true)
        [ "$state" = installed ] || missing="$missing $package"
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
    # shellcheck disable=SC2086
    $run env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends \
        $missing >/dev/null
}

# shellcheck disable=SC2086
install $packages
# shellcheck disable=SC2086
case ${1:-} in
fuzz) install $fuzz_packages ;;
coverage) install $coverage_packages ;;
rooms) install $room_packages ;;
esac
if [ "${1:-}" = bench ]; then
    # shellcheck disable=SC2086
    install $bench_packages ||
        echo "the benches against Mitsuba 3 will be left out: $bench_packages cannot be installed" >&2
fi
