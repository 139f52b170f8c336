/* daemon_options.c -- see daemon_options.h. */
#include "server/daemon_options.h"

#include <math.h>
#include <string.h>
#include <sys/statvfs.h>

#include "server/executor/metrics.h"

static enum api_access read_access(const char *word) {
    return strcmp(word, "open") == 0     ? API_ACCESS_OPEN
           : strcmp(word, "tokens") == 0 ? API_ACCESS_TOKENS
                                         : API_ACCESS_AUTO;
}

/* The smaller of both limits; 0: none. A disk whose size is unknown sets none. */
static uint64_t user_max_bytes(const struct config *c) {
    struct statvfs disk;
    uint64_t limit = (uint64_t)c->user_max_mib << 20, share = 0;
    if (c->user_max_percent > 0 && statvfs(c->data_dir, &disk) == 0)
        share = (uint64_t)disk.f_blocks * disk.f_frsize / 100 * (uint64_t)c->user_max_percent;
    return limit == 0 || (share > 0 && share < limit) ? share : limit;
}

struct scheduler_config daemon_options_scheduler(const struct config *c, const struct executor *executor,
                                                 const struct sites *sites) {
    return (struct scheduler_config){
        .data_dir = c->data_dir,
        .executor = executor,
        .places = sites->executor,
        .place_count = sites->count,
        .max_running = (int)c->max_running,
        .user_max_running = (int)c->user_max_running,
        .small_renders = (int)c->small_renders,
        .small_render_threads = (int)c->small_render_threads,
        .small_render_cost = (double)c->small_render_paths,
        .render_part_cost = (double)c->render_part_paths,
        .max_checks = (int)c->max_checks,
        .thread_count = (int)c->threads,
        .user_max_bytes = user_max_bytes(c),
        .jobs_memory_bytes = (uint64_t)c->jobs_memory_mib << 20,
        .worker_memory_bytes = (uint64_t)c->worker_memory_mib << 20,
        .photograph_memory_bytes = (uint64_t)c->photograph_memory_mib << 20,
        .checkpoint_interval_sec = c->checkpoint_interval_sec,
        .stop_grace_sec = c->stop_grace_sec,
        .event_keep_sec = 3600.0 * c->event_keep_hours,
        .checkpoint_keep_sec = 3600.0 * c->checkpoint_keep_hours,
        .low_disk_bytes = (uint64_t)c->low_disk_mib << 20,
        .webhook_private = c->webhook_private,
        .sandbox = c->sandbox,
    };
}

struct api_config daemon_options_api(const struct config *c, const struct proxies *proxies, const struct sites *sites,
                                     const struct api_library list[LIBRARY_COUNT]) {
    return (struct api_config){
        .data_dir = c->data_dir,
        .max_attempts = (int)c->max_attempts,
        .small_render_cost = c->small_renders > 0 ? (double)c->small_render_paths : 0.0,
        .queue_limit = (size_t)c->queue_limit,
        .user_queue_limit = (size_t)c->user_queue_limit,
        .user_max_jobs = (size_t)c->user_max_jobs,
        .user_max_bytes = user_max_bytes(c),
        .max_upload_bytes = (uint64_t)c->max_upload_mib << 20,
        .admin_free_bytes = (uint64_t)c->admin_free_mib << 20,
        .user_pledge_percent = (unsigned)c->user_pledge_percent,
        .user_max_streams = (size_t)c->user_max_streams,
        .user_max_uploads = (size_t)c->user_max_uploads,
        .user_max_checks = (size_t)c->user_max_checks,
        .empty_upload_ms = (int64_t)(fmin(60e3 * c->upload_start_minutes, 3.6e6 * c->upload_keep_hours)),
        .min_free_bytes = (uint64_t)c->min_free_mib << 20,
        .max_streams = (size_t)c->max_streams,
        .upload_keep_ms = (int64_t)(c->upload_keep_hours * 3.6e6),
        .job_keep_ms = (int64_t)(c->job_keep_days * 86.4e6),
        .scene_keep_ms = (int64_t)(c->scene_keep_days * 86.4e6),
        .keepalive_sec = c->keepalive_sec,
        .access = read_access(c->access),
        .is_tls = *c->tls_certificate != '\0',
        .server_names = c->server_names,
        .executors = c->executors,
        .executor_metrics = executor_metrics,
        .executor_user = sites,
        .proxies = proxies,
        .libraries = list,
        .library_count = LIBRARY_COUNT,
    };
}

struct listener_config daemon_options_listener(const struct config *c, char address[CONFIG_ADDRESS_SIZE],
                                               bool *is_loopback) {
    struct listener_config network = {
        .address = address,
        .connection_max = (unsigned)c->max_connections,
        .address_connection_max = (unsigned)c->address_max_connections,
        .certificate_file = *c->tls_certificate ? c->tls_certificate : NULL,
        .key_file = c->tls_key,
        .limits = {c->head_timeout_sec, c->idle_timeout_sec, c->idle_timeout_sec, (double)c->body_min_bytes_per_sec},
    };
    config_address(c->listen, address, &network.port, is_loopback, NULL); /* was checked with the rest */
    return network;
}
