#!/bin/bash
# The disk of a node is full while it fetches the scene, while its worker begins, while that writes a checkpoint, and the
# outputs, some of which have been sent: the job is paused, and says on which machine and what to do; it loses no attempt, and
# goes on from its checkpoint once it is resumed, to the textures of a job at home. The daemon's own disk: tests/chaos/node_kill.c.
set -u
. tests/api/site.sh "$@"
make_room "$work/room"
disk=$work/disk
mkdir "$disk"
if [ "$(id -u)" -ne 0 ] || ! mount -t tmpfs -o size=16k none "$disk" 2>/dev/null; then
    echo "only root may mount a small disk"
    exit 77
fi
mounted=$disk
daemon_start
site_make batch "export TMPDIR=$disk/work" "cache=$disk/cache"
daemon_end TERM
# shellcheck disable=SC2086
daemon_start --set executors=process,batch $site_flags

submit process 2500
await succeeded
run 0 get "$job" -o "$work/home"

submit batch 2500
left=$("$build/unbake" show "$job" --json | jq .attempts_left)
# blocked WHEN PATTERN: the job waits for help, and has lost nothing.
blocked() {
    local shown
    await paused
    shown=$("$build/unbake" show "$job" --json | jq -r '"\(.reason) | \(.hint) | \(.attempts_left)"')
    [[ $shown == "disk full: on the node $(hostname): "*$2*" | Free some space on $(hostname), or keep attempts from it, then resume the job. | $left" ]] ||
        fail "$1: $shown"
    [ -z "$(ls "$disk/work" 2>/dev/null)" ] || fail "$1: $(ls -R "$disk/work") is left"
}
blocked "while it fetches" "$disk/cache/*No space left"

mount -o remount,size=150k "$disk"
run 0 resume "$job"
blocked "while its worker begins" "$disk/work/*No space left"

mount -o remount,size=20m "$disk"
run 0 resume "$job"
has_sent() { ls "$data/jobs/$job/"attempt-*/checkpoint/ | grep -q part-; }
wait_for 60 has_sent
cat /dev/zero >"$disk/filler" 2>/dev/null
blocked "while it writes a checkpoint" "$disk/work/*No space left"
rm "$disk/filler"
# A disk without room for more files, since those that are there may grow: checkpoints are written on, textures sent, and
# then it is full.
mount -o remount,nr_inodes=$(($(df --output=iused "$disk" | tail -1) + 26)) "$disk"
run 0 resume "$job"
blocked "while it writes outputs" "$disk/work/*/out/scene.*No space left"
[ "$("$build/unbake" show "$job" --json | jq '[.outputs[] | select(.attempt == 4) | .name] | contains(["base_color.exr"])')" = true ] ||
    fail "no texture was sent before"
mount -o remount,nr_inodes=10000 "$disk"
run 0 resume "$job"
same "after four full disks" 5
equal "$(ls -d "$data/jobs/$job"/attempt-* | wc -l)" 1 "folders of attempts"
[ $failures = 0 ] || cat "$work/nodes.log"
finish
