/* metrics.c -- GET /metrics: values in Prometheus's text format 0.0.4. Counters start at 0 with the daemon; the
 * number of label values does not depend on what users do. */
#include <stdio.h>
#include <time.h>
#include <unistd.h>

#include "common/file.h"
#include "common/protocol.h"
#include "server/events/hub.h"
#include "server/http/handlers.h"
#include "server/http/request_counts.h"
#include "server/transport/listener.h"
#include "server/transport/problem.h"
#include "server/uploads/digests.h"

static void metric(struct buf *b, const char *name, const char *type, const char *help, double value) {
    buf_printf(b, "# HELP unbaked_%s %s\n# TYPE unbaked_%s %s\nunbaked_%s %.17g\n", name, help, name, type, name,
               value);
}

static void metric_head(struct buf *b, const char *name, const char *type, const char *help) {
    buf_printf(b, "# HELP unbaked_%s %s\n# TYPE unbaked_%s %s\n", name, help, name, type);
}

static double resident_bytes(void) {
    unsigned long long total, resident = 0;
    FILE *file = fopen("/proc/self/statm", "re");
    if (!file)
        return 0;
    if (fscanf(file, "%llu %llu", &total, &resident) != 2)
        resident = 0;
    fclose(file);
    return (double)resident * (double)sysconf(_SC_PAGESIZE);
}

static void store_metrics(struct buf *b, const struct store_counts *counts) {
    metric_head(b, "jobs", "gauge", "Jobs by state.");
    for (int i = 0; i < JOB_STATE_COUNT; i++)
        buf_printf(b, "unbaked_jobs{state=\"%s\"} %lld\n", job_state_name((enum job_state)i),
                   (long long)counts->jobs_by_state[i]);
    metric_head(b, "scenes", "gauge", "Scenes by state.");
    for (int i = 0; i < SCENE_STATE_COUNT; i++)
        buf_printf(b, "unbaked_scenes{state=\"%s\"} %lld\n", scene_state_name((enum scene_state)i),
                   (long long)counts->scenes_by_state[i]);
    double now = (double)time(NULL), oldest = (double)counts->oldest_queued_ms * 1e-3;
    metric(b, "queue_oldest_seconds", "gauge", "Age of the oldest job that waits.",
           counts->oldest_queued_ms && now > oldest ? now - oldest : 0.0);
    metric(b, "outbox", "gauge", "Messages of webhooks that are still to be delivered.", (double)counts->outbox);
    metric(b, "attempts", "gauge", "Attempts of the jobs that are kept.", (double)counts->attempts);
    metric(b, "events_total", "counter", "Events ever made.", (double)counts->events);
    metric(b, "wal_bytes", "gauge", "Size of the database's write-ahead log.", (double)counts->wal_bytes);
}

static void work_metrics(struct buf *b, const struct counters *f) {
    static const char *const ends[END_COUNT] = {
        [END_SUCCEEDED] = "succeeded", [END_INPUT] = "input",     [END_CRASHED] = "crashed",
        [END_MEMORY] = "memory",       [END_STOPPED] = "stopped", [END_DISK] = "disk",
        [END_LOST] = "lost",           [END_REFUSED] = "refused", [END_PREEMPTED] = "preempted"};
    metric_head(b, "attempts_ended_total", "counter", "Attempts of jobs that have ended, by how.");
    for (int i = 0; i < END_COUNT; i++)
        buf_printf(b, "unbaked_attempts_ended_total{reason=\"%s\"} %llu\n", ends[i],
                   (unsigned long long)atomic_load(&f->ends[i]));
    metric_head(b, "queue_wait_seconds", "summary", "How long jobs waited for their first attempt.");
    buf_printf(b, "unbaked_queue_wait_seconds_sum %.3f\nunbaked_queue_wait_seconds_count %llu\n",
               (double)atomic_load(&f->first_wait_ms) * 1e-3, (unsigned long long)atomic_load(&f->first_start_count));
    metric_head(b, "checkpoint_seconds", "summary", "How long checkpoints took.");
    buf_printf(b, "unbaked_checkpoint_seconds_sum %.6f\nunbaked_checkpoint_seconds_count %llu\n",
               (double)atomic_load(&f->checkpoint_us) * 1e-6, (unsigned long long)atomic_load(&f->checkpoint_count));
    metric(b, "checkpoint_bytes_total", "counter", "Bytes written to checkpoints.",
           (double)atomic_load(&f->checkpoint_bytes));
    metric(b, "iterations_total", "counter", "Optimiser steps.", (double)atomic_load(&f->iteration_count));
    metric(b, "rays_total", "counter", "Rays traced by the optimiser.", (double)atomic_load(&f->ray_count));
    metric(b, "worker_cpu_seconds_total", "counter", "CPU time of attempts.", (double)atomic_load(&f->cpu_ms) * 1e-3);
}

struct response *system_metrics(struct api *api, struct request *r) {
    struct store_counts counts;
    struct error err;
    uint64_t room = 0;
    if (store_count(api->store, &counts, &err) != STATUS_OK)
        return problem_from(r, &err);
    struct buf b;
    buf_init(&b, (size_t)1 << 20);
    metric_head(&b, "build_info", "gauge", "Always 1; the version is a label.");
    buf_printf(&b, "unbaked_build_info{version=\"%s\"} 1\n", UNBAKE_VERSION);
    store_metrics(&b, &counts);
    metric(&b, "workers", "gauge", "Worker processes alive.", scheduler_running(api->scheduler));
    work_metrics(&b, scheduler_counters(api->scheduler));
    if (api->config.executor_metrics)
        api->config.executor_metrics(api->config.executor_user, &b);
    metric_head(&b, "http_requests_total", "counter", "Requests, by route and status; 0: cut off before a reply.");
    request_counts_print(api->request_counts, "unbaked_http_requests_total", &b);
    metric(&b, "uploaded_bytes_total", "counter", "Bytes of bundles received.",
           (double)atomic_load(&api->uploaded_bytes));
    metric(&b, "hashed_bytes_total", "counter", "Bytes of outputs read for their digests.",
           (double)digests_hashed_bytes(api->digests));
    metric(&b, "event_streams", "gauge", "Open event streams.", (double)hub_count(api->hub));
    if (api->listener) {
        metric(&b, "connections", "gauge", "Open connections.", (double)listener_connections(api->listener));
        metric(&b, "late_connections_total", "counter", "Connections shut for being too slow.",
               (double)listener_late(api->listener));
    }
    if (file_free_bytes(api->config.data_dir, &room, NULL) == STATUS_OK)
        metric(&b, "disk_free_bytes", "gauge", "Free space of the data folder's disk.", (double)room);
    metric(&b, "resident_bytes", "gauge", "Memory of the daemon itself.", resident_bytes());
    size_t length = b.length;
    return response_text(200, "text/plain; version=0.0.4; charset=utf-8", buf_detach(&b), length);
}
