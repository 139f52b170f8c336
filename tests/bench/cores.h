/* cores.h -- how much of a program would use many cores, measured on few. The program is linked with
 * --wrap=parallel_for; each item of each loop is timed by the processor time of its thread, and its loop is laid out
 * on `cores` imagined threads as parallel_for would: each takes the next item when it is free. What the main thread
 * does between loops is serial. Memory bandwidth, which cores share, and the time to wake threads are left out.
 *
 * Not thread-safe beyond parallel_for itself; one per program, since the linker's wrapper has no context. */
#ifndef TESTS_BENCH_CORES_H
#define TESTS_BENCH_CORES_H

#include <stdio.h>
#include <string.h>
#include <time.h>

#include "common/mem.h"
#include "common/parallel.h"

#define CORES_STAGES 16
#define CORES_MAX 256 /* imagined threads at most */

struct cores_stage {
    const char *name;
    double serial_sec, parallel_sec; /* processor time outside of loops, and of all loops' items */
    double ideal_sec;                /* of the loops on so many cores: the longest thread of each */
};

static struct {
    int cores; /* 0: nothing is measured */
    size_t count;
    struct cores_stage stage[CORES_STAGES];
    double serial_since; /* processor time of the main thread at the end of the last loop */
} cores;

struct cores_loop {
    void (*body)(void *user, size_t index, int thread);
    void *user;
    float *sec; /* [count] of each item */
};

void __real_parallel_for(struct parallel *pool, size_t count, void (*body)(void *user, size_t index, int thread),
                         void *user);
void __wrap_parallel_for(struct parallel *pool, size_t count, void (*body)(void *user, size_t index, int thread),
                         void *user);

static double cores_thread_sec(void) {
    struct timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* Ends the serial part that is running. */
static void cores_end_serial(void) {
    double now = cores_thread_sec();
    if (cores.count > 0)
        cores.stage[cores.count - 1].serial_sec += now - cores.serial_since;
    cores.serial_since = now;
}

/* What follows is of stage `name`, a literal. */
static void cores_begin_stage(const char *name) {
    if (cores.cores == 0)
        return;
    cores_end_serial();
    if (cores.count < CORES_STAGES)
        cores.stage[cores.count++].name = name;
}

static void cores_item(void *user, size_t index, int thread) {
    struct cores_loop *loop = user;
    double begin = cores_thread_sec();
    loop->body(loop->user, index, thread);
    loop->sec[index] = (float)(cores_thread_sec() - begin);
}

/* Adds a loop of items that took `sec` to a stage. */
static void cores_lay_out(struct cores_stage *stage, size_t count, const float *sec) {
    double busy[CORES_MAX] = {0.0}, longest = 0.0;
    for (size_t i = 0; i < count; i++) {
        int first = 0;
        for (int k = 1; k < cores.cores; k++)
            first = busy[k] < busy[first] ? k : first;
        busy[first] += (double)sec[i];
        stage->parallel_sec += (double)sec[i];
        longest = busy[first] > longest ? busy[first] : longest;
    }
    stage->ideal_sec += longest;
}

void __wrap_parallel_for(struct parallel *pool, size_t count, void (*body)(void *user, size_t index, int thread),
                         void *user) {
    if (cores.cores == 0 || cores.count == 0) {
        __real_parallel_for(pool, count, body, user);
        return;
    }
    cores_end_serial();
    struct cores_loop loop = {body, user, mem_array(count + 1, sizeof *loop.sec)};
    __real_parallel_for(pool, count, cores_item, &loop);
    cores_lay_out(&cores.stage[cores.count - 1], count, loop.sec);
    mem_free(loop.sec);
    cores.serial_since = cores_thread_sec();
}

static void cores_print_row(const struct cores_stage *s) {
    double all = s->serial_sec + s->parallel_sec, least = s->serial_sec + s->ideal_sec;
    printf("cores %-10s %8.2f s, serial %6.2f s (%4.1f %%), on %d cores %7.2f s: %5.2f times as fast, %.2f of ideal\n",
           s->name, all, s->serial_sec, all > 0.0 ? 100.0 * s->serial_sec / all : 0.0, cores.cores, least,
           least > 0.0 ? all / least : 0.0, least > 0.0 ? all / least / cores.cores : 0.0);
}

/* Prints each stage, solve and refine together, and all. */
static void cores_print(void) {
    struct cores_stage solved = {.name = "solve+refine"}, all = {.name = "all"};
    if (cores.cores == 0)
        return;
    cores_end_serial();
    for (size_t i = 0; i < cores.count; i++) {
        const struct cores_stage *s = &cores.stage[i];
        struct cores_stage *sum[2] = {&all, &solved};
        bool is_solved = strcmp(s->name, "solve") == 0 || strcmp(s->name, "refine") == 0;
        for (int k = 0; k < (is_solved ? 2 : 1); k++) {
            sum[k]->serial_sec += s->serial_sec;
            sum[k]->parallel_sec += s->parallel_sec;
            sum[k]->ideal_sec += s->ideal_sec;
        }
        cores_print_row(s);
    }
    cores_print_row(&solved);
    cores_print_row(&all);
}

#endif
