#!/bin/bash
# /metrics of a daemon that has done something: the format of Prometheus, line by line, and the
# figures that must have moved. /readyz where the disk takes nothing.
set -u
. tests/api/client.sh "$@"
make_room "$work/room"
daemon_start --set checkpoint_interval_sec=0.1
run 0 submit "$work/room" $tiny --watch -q
run 1 submit "$work/room" --set segmentation=given --watch -q # it has no object_id: the input is at fault
call GET /v1/jobs/4242; call POST /nothing -d '{}'; call DELETE /v1/jobs; call GET "/v1/jobs?x=1"
curl -sN -m 60 "$url/v1/events" >"$work/stream" & background=$!
wait_for 60 sh -c "curl -s $url/metrics | grep -q '^unbaked_event_streams 1$'"
# An attempt is counted when its end has been told.
wait_for 60 sh -c "curl -s $url/metrics | grep -q '^unbaked_attempts_ended_total{reason=\"input\"} 1$'"
call GET /metrics; expect 200
case $(header content-type) in "text/plain; version=0.0.4"*) ;; *) fail "Content-Type is $(header content-type)" ;; esac
cp "$work/body" "$work/first"

# The format: a sample after its HELP and TYPE, all of one name together, no series twice.
check_format() {
    awk '
        function bad(why) { printf "line %d: %s: %s\n", NR, why, $0; failed = 1 }
        /^# HELP / { if ($3 in helped) bad("a second HELP"); helped[$3] = 1; present = ""; next }
        /^# TYPE / {
            if (!($3 in helped)) bad("TYPE before HELP")
            if ($4 !~ /^(counter|gauge|summary)$/) bad("an unknown type")
            type[$3] = $4; present = $3; next
        }
        {
            if (!match($0, /^[a-zA-Z_:][a-zA-Z0-9_:]*/)) { bad("no name"); next }
            name = substr($0, 1, RLENGTH); rest = substr($0, RLENGTH + 1); base = name
            if (type[present] == "summary") sub(/_(sum|count)$/, "", base)
            if (base != present) bad("not below its TYPE")
            if (type[present] == "counter" && name !~ /_total$/) bad("a counter without _total")
            if (rest ~ /^\{/) {
                if (!match(rest, /^\{[a-z_]+="[^"\\]*"(,[a-z_]+="[^"\\]*")*\}/)) { bad("labels"); next }
                series = name substr(rest, 1, RLENGTH); rest = substr(rest, RLENGTH + 1)
            } else series = name
            if (series in seen) bad("a series twice")
            seen[series] = 1
            if (rest !~ /^ -?[0-9]+(\.[0-9]+)?(e[-+]?[0-9]+)?$/) bad("no number")
        }
        END { exit failed }' "$1"
}
check_format "$work/first" >"$work/out" || fail "$(cat "$work/out")"

# value SERIES: its sample; above SERIES LEAST.
value() { awk -v s="$1" '{ at = index($0, " "); if (substr($0, 1, length(s)) == s && substr($0, length(s) + 1, 1) == " ") print substr($0, length(s) + 2) }' "$work/first"; }
above() { awk -v found="$(value "$1")" -v least="$2" 'BEGIN { exit !(found != "" && found + 0 > least) }' || fail "$1 is '$(value "$1")', not above $2"; }
for state in queued running paused cancelled; do equal "$(value "unbaked_jobs{state=\"$state\"}")" 0 "jobs $state"; done
equal "$(value 'unbaked_jobs{state="succeeded"}')" 1; equal "$(value 'unbaked_jobs{state="failed"}')" 1
equal "$(value 'unbaked_attempts_ended_total{reason="succeeded"}')" 1
equal "$(value 'unbaked_attempts_ended_total{reason="input"}')" 1
for reason in crashed memory stopped disk; do equal "$(value "unbaked_attempts_ended_total{reason=\"$reason\"}")" 0 "$reason"; done
equal "$(value unbaked_queue_wait_seconds_count)" 2; above unbaked_queue_wait_seconds_sum -1
equal "$(value unbaked_queue_oldest_seconds)" 0
above unbaked_iterations_total 0; above unbaked_rays_total 1000; above unbaked_worker_cpu_seconds_total 0
above unbaked_checkpoint_seconds_count 0; above unbaked_checkpoint_seconds_sum 0; above unbaked_checkpoint_bytes_total 10000
above unbaked_wal_bytes -1; above unbaked_disk_free_bytes 0; above unbaked_resident_bytes 1000000; above unbaked_events_total 5
equal "$(value 'unbaked_http_requests_total{method="GET",route="/v1/jobs/{job}",code="404"}')" 1 "requests by route and code"
equal "$(value 'unbaked_http_requests_total{method="other",route="none",code="404"}')" 1 "requests that no route takes"
equal "$(value 'unbaked_http_requests_total{method="GET",route="/v1/jobs",code="400"}')" 1
above 'unbaked_http_requests_total{method="POST",route="/v1/jobs",code="201"}' 0
grep -q 'unbaked_build_info{version="' "$work/first" || fail "no version"

# Counters never go back.
call GET /metrics; check_format "$work/body" >"$work/out" || fail "$(cat "$work/out")"
while read -r series number; do
    now=$(awk -v s="$series" '$1 == s { print $2 }' "$work/body")
    awk -v a="$number" -v b="$now" 'BEGIN { exit !(b + 0 >= a + 0) }' || fail "$series went from $number to $now"
done < <(grep '_total' "$work/first" | grep -v '^#')

# --- ready, and not -------------------------------------------------------------------------------
call GET /readyz; expect 200
equal "$(find "$data/trash" -name 'probe*' | wc -l)" 0 "probes left behind"
rmdir "$data/trash"; echo >"$data/trash"
call GET /readyz; expect 503 "no folder to write to"; [ -n "$(header retry-after)" ] || fail "no Retry-After"
rm "$data/trash"; mkdir "$data/trash"
call GET /readyz; expect 200
kill "$background" 2>/dev/null
background=
stop_daemon
finish
