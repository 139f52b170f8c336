/* bench_executors.c -- what 2,000 jobs on 64 nodes cost the daemon: the real executor and store with a fake cluster in
 * virtual time (tests/chaos/executor_model.h), nothing going wrong. A node reports every 6 s on average, two lines each
 * time. Prints processor time in all and by report, the number of status commands, and memory. HTTP is not in it. */
#define JOBS_MAX 2000
#define CLUSTER_MAX 2100
#include <sys/resource.h>

#include "tests/chaos/executor_model.h"
#include "tests/figures.h"

#define NODES 64

static double cpu_sec(void) {
    struct rusage used;
    getrusage(RUSAGE_SELF, &used);
    return (double)used.ru_utime.tv_sec + 1e-6 * (double)used.ru_utime.tv_usec + (double)used.ru_stime.tv_sec +
           1e-6 * (double)used.ru_stime.tv_usec;
}

static int64_t add_one(void) {
    const struct job_new new = {.scene_id = SCENE_A, .name = "n", .labels = "{}", .settings = "{}", .max_attempts = 2};
    int64_t id = 0;
    bool replayed;
    OK(store_job_add(model.store, &new, JOBS_MAX + 1, &id, &replayed, &err));
    return id;
}

int main(void) {
    struct rusage used;
    log_set_level(LOG_ERROR);
    model_open();
    model.running_max = NODES;
    model.is_calm = true;
    model.random = 1;
    model.job_count = JOBS_MAX;
    for (size_t i = 0; i < model.job_count; i++)
        model.job[i] = (struct model_job){.id = add_one(), .request = -1};
    daemon_begins();
    double begun = cpu_sec();
    while (!all_over() && model.now < 100000.0) {
        model.now += 1.0;
        cluster_turn();
        for (size_t i = 0; i < model.job_count;
             i++) /* those that run, and as many of the others as there is room for */
            if (!model.job[i].is_over && (model.job[i].run || model.running < NODES))
                job_turn(&model.job[i]);
    }
    const struct remote_figures *f = remote_figures(model.remote);
    double spent = cpu_sec() - begun;
    long reports = (WORK_REPORTS + 2) * model.claims;
    getrusage(RUSAGE_SELF, &used);
    printf("%d jobs on %d nodes in %.0f s of their time: %ld ends, %ld claims, reports and last words\n", JOBS_MAX,
           NODES, model.now, model.ends, reports);
    printf("CPU %.2f s, %.0f us a report; %llu submit commands, %llu status commands; %ld MiB resident\n", spent,
           1e6 * spent / (double)reports, atomic_load(&f->submissions), atomic_load(&f->queries), used.ru_maxrss >> 10);
    figure("daemon, us of CPU for a report of a node", 1e6 * spent / (double)reports, 500, "lower");
    figure("status commands an hour, 64 nodes", 3600.0 * (double)atomic_load(&f->queries) / model.now, 240, "lower");
    CHECK(all_over() && model.ends == JOBS_MAX);
    remote_free(model.remote);
    model_close();
    return check_result();
}
