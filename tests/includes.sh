#!/bin/bash
# Fails when a folder includes what the design forbids it, a library's header is included by another
# file than the one that owns it, or units (x.c with x.h) include each other in a circle; and when a test
# forgets to tell whether its checks held.
set -u
bad=0

# forbid WHERE PATTERN WHY: no file under WHERE may include what matches PATTERN.
forbid() {
    local found
    # shellcheck disable=SC2086
    found=$(grep -rnE "^#include [\"<]$2" $1 --include='*.[ch]' 2>/dev/null)
    [ -z "$found" ] && return
    printf '%s\n%s\n' "$3:" "$found"
    bad=1
}
# own PATTERN FILE...: only these files may include what matches PATTERN.
own() {
    local pattern=$1 found
    shift
    found=$(grep -rlE "^#include <$pattern" common client server 2>/dev/null | grep -vxF "$(printf '%s\n' "$@")")
    [ -z "$found" ] && return
    printf '%s is included by:\n%s\n' "$pattern" "$found"
    bad=1
}

# The engine, lowest first: each folder includes only those before it (and common).
engine_order='scene render capture holes gather state material light refine reconstruct'
engine="server/($(echo "$engine_order" | tr ' ' '|')|ingest|export)/"
daemon='http|events|transport|net|uploads|data|store|job|admin|node'
above=" $engine_order "
for folder in $engine_order; do
    above=${above#* "$folder" }
    above=" $above"
    forbid "server/$folder" "server/($(echo "$above" | xargs | tr ' ' '|')|ingest|export)/" \
        "$folder sees only what comes before it in: $engine_order"
done
# A function says what it reads and what it writes: only the stages and server/light (which fits light to everything)
# have the whole state in hand.
forbid "server/material server/refine" 'server/state/reconstruction\.h' 'material and refine see parts of the state, not the whole'
forbid "server/ingest server/export" "server/($(echo "$engine_order" | cut -d' ' -f2- | tr ' ' '|'))/" \
    'ingest and export see only scene'
forbid server/ingest 'server/export/' 'ingest does not see export'
forbid server/export 'server/ingest/' 'export does not see ingest'
forbid server/check "server/($(echo "$engine_order" | cut -d' ' -f4- | tr ' ' '|' | sed 's/state|//')|export|$daemon|worker)/" \
    'check sees scene, render, capture, state and ingest'
forbid "$(for folder in $engine_order ingest export ${daemon//|/ }; do echo "server/$folder"; done)" \
    'server/check/' 'only the worker sees check'
forbid "$(for folder in $engine_order ingest export; do echo "server/$folder"; done)" \
    "server/($daemon|worker)/" 'the engine never sees http, SQL or jobs'

forbid common 'server/|client/' 'common depends on nothing of ours'
forbid client 'server/' 'the client knows only common'
# The daemon: http -> uploads -> data -> store; store knows of data only the paths. Below http, net: connections and the
# syntax of what comes over them, which knows of nothing else; transport: requests and replies, whatever they mean;
# events: streams of what changes in the store.
forbid server/net 'server/[^n]' 'net sees only common'
forbid server/transport "$engine|server/(http|events|uploads|data|job|worker|admin)/|server/store/[^u]" \
    'transport sees net, and of store only users.h'
forbid server/events "$engine|server/(http|net|uploads|data|worker|admin)/" 'events see transport and store'
forbid server/http "$engine|server/worker/" 'http never sees the engine or the worker'
# Within http: jobs and nodes, the resources of several files, stand on what all resources share.
forbid "$(ls server/http/*.[ch] | grep -v '/routes\.c$' | xargs)" 'server/http/(jobs|nodes)/' \
    'of http only the route table sees its folders'
forbid server/http/jobs 'server/http/(nodes/|routes|service|metrics|page)' 'http/jobs sees what resources share'
forbid server/http/nodes 'server/http/(jobs/|routes|service|metrics|page)' 'http/nodes sees what resources share'
forbid server/uploads "$engine|server/(http|events|transport|net|job|worker|admin)/" 'uploads see only data and store'
forbid server/data "$engine|server/(http|events|transport|net|uploads|job|worker|admin)/" 'data sees only store'
forbid server/admin "$engine|server/(uploads|job|http|events|transport)/|server/net/[^t]" \
    'admin sees data and store, and of net only tls.h'
forbid server/store "$engine|server/(http|events|transport|net|uploads|worker|admin)/|server/data/[^l]" \
    'store sees only job.h and data/layout.h'
forbid server/job "$engine|server/(http|events|transport|net|uploads|admin)/" 'job never sees the engine, http or uploads'
forbid server/job 'server/worker/[^p]' 'job sees only worker/progress.h'
# A node runs a worker as the job layer does and talks to the daemon over HTTP: of the daemon's memory it sees nothing.
forbid server/node "$engine|server/(http|events|transport|uploads|store|admin|check)/|server/net/[^f]|server/data/[^lw]|server/worker/[^p]" \
    'node sees run.h and process.h of job, and paths'
forbid server/node 'server/job/[^pr]' 'node sees run.h and process.h of job, and paths'
forbid server/executor "$engine|server/(http|events|transport|net|uploads|admin|worker)/" \
    'executor sees job/run.h, store and data/layout.h'
forbid "server/job server/store server/data server/http" 'server/executor/' 'only the daemon as a whole sees its executors'
forbid server/worker 'server/(http|events|transport|net|uploads|job)/|server/data/[^l]|server/store/(store|internal)' \
    "the worker never sees the daemon's memory"

# Renders read outputs, as they read anything else, and share with export how pictures look.
forbid "$(for folder in $engine_order ingest export check; do echo "server/$folder"; done)" 'server/relight/' \
    'only the worker and the tools see relight'
forbid server/relight "server/(capture|holes|gather|state|material|light|refine|reconstruct|check|$daemon|worker)/" \
    'relight sees scene, render, ingest and export'
forbid "server/demo server/evaluate" "server/($daemon|worker)/" 'tools know only the engine'
forbid server/demo 'server/(ingest|capture|holes|gather|state|material|light|refine|reconstruct|export|evaluate)/' 'demo sees only render and scene'
forbid "$(ls -d server/*/ | grep -vE 'demo|evaluate|worker' | tr '\n' ' ')" 'server/(demo|evaluate)/' \
    'only main.c, and of evaluate the worker, sees the tools'
forbid server/worker 'server/(demo/|evaluate/(evaluate_command|[^e]))' 'the worker sees of the tools evaluate.h'

own 'embree[34]/' server/render/accel.c
own 'microhttpd\.h' server/transport/exchange.h
own 'gnutls/' server/net/tls.c server/worker/deliver.c
own 'sqlite3\.h' server/store/sql.h
own 'curl/' common/request.c
own 'openexr' common/exr_stream.h
own 'png\.h' common/png_memory.h
own 'lcms2' common/color_icc.c
own 'jpeglib\.h' common/jpeg.c
own 'libheif/' common/heif.c
own 'tiffio\.h' common/tiff.h
own 'webp/' common/webp.c
own 'meshoptimizer' server/ingest/mesh/gltf_meshopt.c
own 'expat\.h' server/ingest/source/xml.c
own 'uni(case|norm|string)' server/ingest/name_key.c
own 'seccomp\.h' server/worker/confine_calls.c

# Paths in the data folder are made in one place. (Of the engine's files only worker knows the names.)
paths=$(grep -nE 'file_join\([^"]*, "|"(%s/)?(scenes|jobs|uploads|trash)/[%a-zX]|%s/(out|files|archive|previews)/|"(checkpoint\.db|worker\.log|state\.db|admin\.sock)' \
    server/*.c server/{http,http/jobs,http/nodes,events,transport,net,uploads,data,store,job,node,worker,admin}/*.[ch] | grep -vE '^server/data/layout\.|/manual\.c')
[ -z "$paths" ] || { printf 'only server/data/layout.c makes paths in the data folder:\n%s\n' "$paths"; bad=1; }

# Each unit and one that it includes, a pair a line.
units() {
    grep -roE '^#include "[^"]+"' common client server --include='*.[ch]' |
        sed -E 's|^(.*)\.[ch]:#include "(.*)\.h"|\1 \2|' | awk '$1 != $2'
}
if ! circle=$(units | tsort 2>&1 >/dev/null); then
    printf 'these include each other:\n%s\n' "$circle"
    bad=1
fi
# A reader who searches for a struct, an enum or a union (their tags share one name space), or for a constant of a header,
# finds one. (test_deploy.sh: client and server share no global name.)
tags=$(grep -rhoE '\b(struct|enum|union) [a-z_0-9]+ \{' common client server --include='*.[ch]' |
    sed -E 's/.* ([a-z_0-9]+) \{/\1/' | sort | uniq -d | xargs)
[ -z "$tags" ] || { printf 'tags of more than one struct, enum or union: %s\n' "$tags"; bad=1; }
constants=$(grep -roE '^#define [A-Za-z_0-9]+' common client server --include='*.h' | sort -u | sed 's/.*://' | sort |
    uniq -d | xargs)
[ -z "$constants" ] || { printf 'defined in more than one header: %s\n' "$constants"; bad=1; }
silent=$(grep -L 'check_result()' tests/{unit,gradient,render,api,chaos,soak}/test_*.c 2>/dev/null)
[ -z "$silent" ] || { printf 'cannot fail, for want of check_result:\n%s\n' "$silent"; bad=1; }
exit $bad
