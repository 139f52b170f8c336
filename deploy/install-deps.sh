#!/bin/sh
# Installs the Debian packages that building, running and testing need, if any is missing.
# Does nothing, and asks for no rights, when all are there.
set -eu
packages="gcc make pkg-config libc6-dev libembree-dev libopenexr-dev libmicrohttpd-dev libgnutls28-dev libcjson-dev
libsqlite3-dev libarchive-dev libpng-dev libjpeg62-turbo-dev libcurl4-openssl-dev libseccomp-dev
zlib1g-dev curl jq sqlite3 zip zstd ca-certificates"

missing=""
for package in $packages; do
    state=$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null || true)
    [ "$state" = installed ] || missing="$missing $package"
done
[ -n "$missing" ] || exit 0

echo "installing:$missing"
run=""
if [ "$(id -u)" -ne 0 ]; then
    if ! command -v sudo >/dev/null 2>&1; then
        echo "these packages are missing and neither root nor sudo is at hand:$missing" >&2
        exit 1
    fi
    run="sudo"
fi
$run apt-get update -qq
# shellcheck disable=SC2086
$run env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $missing >/dev/null
