# browser.sh -- for tests of the page: `. tests/api/browser.sh` after client.sh. Sets $chromium and $modules, where
# axe-core and puppeteer-core are; both come from npm into BUILD/axe, once. The test is skipped where that cannot be.
# shellcheck shell=bash disable=SC2034,SC2154
chromium=$(command -v chromium || command -v chromium-browser || command -v google-chrome) || { echo "there is no Chromium"; exit 77; }
command -v node >/dev/null || { echo "there is no node"; exit 77; }
modules=$build/axe/node_modules
install_modules() {
    [ ! -d "$modules/axe-core" ] || [ ! -d "$modules/puppeteer-core" ] || return 0
    command -v npm >/dev/null || { echo "there is no npm"; exit 77; }
    echo '{"private": true}' >"$build/axe/package.json"
    (cd "$build/axe" && timeout 120 npm install --no-audit --no-fund --ignore-scripts axe-core@4.14.1 puppeteer-core@24.43.1) >"$work/npm" 2>&1 ||
        { echo "npm cannot install axe-core and puppeteer-core: $(tail -n 1 "$work/npm")"; exit 77; }
}
mkdir -p "$build/axe/pictures"
exec 8>"$build/axe/lock" # two tests may run at once
flock 8
install_modules
flock -u 8
