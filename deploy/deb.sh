#!/bin/sh
# deb.sh FOLDER VERSION: builds the Debian packages unbake and unbaked from this tree into FOLDER,
# and holds them against Debian's policy with lintian. The changelog's date is that of the last
# commit, so that the same tree gives the same packages.
set -eu
folder=$1 version=$2
missing=""
for package in build-essential debhelper fakeroot lintian; do
    state=$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null || true)
    [ "$state" = installed ] || missing="$missing $package"
done
if [ -n "$missing" ]; then
    echo "building packages needs these:$missing" >&2
    exit 1
fi
tree=$folder/unbake-$version
rm -rf "$folder"
mkdir -p "$tree"
cp -R Makefile README.md LICENSE common client server config deploy "$tree"
mv "$tree/deploy/debian" "$tree/debian"
cp deploy/unbaked.service "$tree/debian/unbaked.service"
SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git log -1 --format=%ct 2>/dev/null || date +%s)}
export SOURCE_DATE_EPOCH
year=$(date -u +%Y -d "@$SOURCE_DATE_EPOCH")
sed -i "s/^Copyright: /&$year /" "$tree/debian/copyright"
cat >"$tree/debian/changelog" <<END
unbake ($version) unstable; urgency=medium

  * This version; README.md says what it does.

 -- $(sed -n 's/^Maintainer: //p' deploy/debian/control)  $(LC_ALL=C date -u -R -d "@$SOURCE_DATE_EPOCH")
END
(cd "$tree" && dpkg-buildpackage --build=binary --no-sign >../build.log 2>&1) || {
    tail -n 40 "$folder/build.log" >&2
    exit 1
}
rm -rf "$tree"
lintian --fail-on error,warning --allow-root "$folder"/*.changes
ls -l "$folder"/*.deb
