#!/bin/bash
# portable.sh BUILD: builds this tree and runs `make check` and api/test_http_head on the next Debian (trixie: Embree 4,
# libmicrohttpd 1.0, its gcc and clang), in a root of its own under BUILD/portable, which later runs use again. Needs root,
# since it mounts and changes root. Warnings are errors. PORTABLE_SUITE and PORTABLE_MIRROR name another release, mirror.
set -eu
build=$1
suite=${PORTABLE_SUITE:-trixie}
root=$PWD/$build/portable/$suite
[ "$(id -u)" -eq 0 ] || { echo "portable: changing root needs root" >&2; exit 1; }
mirror=${PORTABLE_MIRROR:-$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' | grep -E '/debian/?$' | head -n 1)}

if [ ! -e "$root/made" ]; then
    echo "portable: making a root of $suite"
    rm -rf "$root"
    mkdir -p "$root"
    mmdebstrap --quiet --mode=root --variant=minbase --include=make,procps "$suite" "$root" $mirror
    touch "$root/made"
fi

# The tree as it is, committed or not, and the test data where it is.
rm -rf "$root/src"
mkdir -p "$root/src/unbake"
git ls-files -z --cached --others --exclude-standard | tar --null --files-from=- --ignore-failed-read -cf - 2>/dev/null |
    tar -xf - -C "$root/src/unbake"
cp /etc/resolv.conf "$root/etc/resolv.conf" 2>/dev/null || true

export root
exec unshare --mount --propagation private bash -eu -c '
    mount -t proc proc "$root/proc"
    mount --rbind /dev "$root/dev"
    mount -t tmpfs tmpfs "$root/tmp"
    if [ -d ../shared/data ]; then
        mkdir -p "$root/src/shared/data"
        mount --rbind ../shared/data "$root/src/shared/data"
    fi
    exec env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root CI=true LC_ALL=C.UTF-8 chroot "$root" bash -eu -c "
        cd /src/unbake
        deploy/install-deps.sh
        command -v clang >/dev/null || apt-get install -y -qq --no-install-recommends clang >/dev/null
        make check
        make test T=api/test_http_head
        make -s -j\$(nproc) B=build/clang CC=clang all
        build/clang/unbaked --version"'
