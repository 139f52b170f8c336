/* job.c -- see job.h. */
#include "server/job/job.h"

#include <stddef.h>
#include <string.h>

#include "common/mem.h"
#include "common/protocol.h"

static const char *const job_names[JOB_STATE_COUNT] = {
    [JOB_QUEUED] = JOB_STATE_QUEUED,       [JOB_RUNNING] = JOB_STATE_RUNNING, [JOB_PAUSED] = JOB_STATE_PAUSED,
    [JOB_SUCCEEDED] = JOB_STATE_SUCCEEDED, [JOB_FAILED] = JOB_STATE_FAILED,   [JOB_CANCELLED] = JOB_STATE_CANCELLED,
};

static const char *const scene_names[SCENE_STATE_COUNT] = {
    [SCENE_RECEIVING] = SCENE_STATE_RECEIVING,
    [SCENE_CHECKING] = SCENE_STATE_CHECKING,
    [SCENE_READY] = SCENE_STATE_READY,
    [SCENE_REJECTED] = SCENE_STATE_REJECTED,
};

const char *job_state_name(enum job_state state) {
    return (unsigned)state < JOB_STATE_COUNT ? job_names[state] : "unknown";
}

bool job_state_parse(const char *name, enum job_state *state) {
    for (unsigned i = 0; i < JOB_STATE_COUNT; i++) {
        if (strcmp(name, job_names[i]) == 0) {
            *state = (enum job_state)i;
            return true;
        }
    }
    return false;
}

static const char *const kind_names[JOB_KIND_COUNT] = {
    [JOB_RECONSTRUCT] = JOB_KIND_RECONSTRUCT, [JOB_RENDER] = JOB_KIND_RENDER, [JOB_EVALUATE] = JOB_KIND_EVALUATE};

const char *job_kind_name(enum job_kind kind) { return (unsigned)kind < JOB_KIND_COUNT ? kind_names[kind] : "unknown"; }

bool job_kind_parse(const char *name, enum job_kind *kind) {
    for (unsigned i = 0; i < JOB_KIND_COUNT; i++) {
        if (strcmp(name, kind_names[i]) == 0) {
            *kind = (enum job_kind)i;
            return true;
        }
    }
    return false;
}

const char *job_wanted_name(enum job_wanted wanted) {
    static const char *const names[] = {"run", "pause", "cancel"};
    return (unsigned)wanted < 3 ? names[wanted] : "unknown";
}

const char *scene_state_name(enum scene_state state) {
    return (unsigned)state < SCENE_STATE_COUNT ? scene_names[state] : "unknown";
}

bool job_is_terminal(enum job_state state) {
    return state == JOB_SUCCEEDED || state == JOB_FAILED || state == JOB_CANCELLED;
}

bool job_may_become(enum job_state from, enum job_state to) {
    static const bool arrow[JOB_STATE_COUNT][JOB_STATE_COUNT] = {
        [JOB_QUEUED] = {[JOB_RUNNING] = true, [JOB_PAUSED] = true, [JOB_CANCELLED] = true},
        [JOB_RUNNING] = {[JOB_QUEUED] = true,
                         [JOB_PAUSED] = true,
                         [JOB_SUCCEEDED] = true,
                         [JOB_FAILED] = true,
                         [JOB_CANCELLED] = true},
        [JOB_PAUSED] = {[JOB_QUEUED] = true, [JOB_CANCELLED] = true},
        [JOB_SUCCEEDED] = {[JOB_QUEUED] = true},
        [JOB_FAILED] = {[JOB_QUEUED] = true},
        [JOB_CANCELLED] = {[JOB_QUEUED] = true},
    };
    return (unsigned)from < JOB_STATE_COUNT && (unsigned)to < JOB_STATE_COUNT && arrow[from][to];
}

bool job_stage_parse(enum job_kind kind, const char *name, bool *keeps_checkpoint) {
    static const struct {
        enum job_kind kind;
        const char *name;
        bool keeps_checkpoint;
    } stages[] = {
        {JOB_RECONSTRUCT, "load", false},  {JOB_RECONSTRUCT, "prepare", false}, {JOB_RECONSTRUCT, "fuse", false},
        {JOB_RECONSTRUCT, "solve", false}, {JOB_RECONSTRUCT, "refine", false},  {JOB_RECONSTRUCT, "report", true},
        {JOB_RECONSTRUCT, "export", true}, {JOB_RENDER, "render", false},       {JOB_EVALUATE, "evaluate", false}};
    for (size_t i = 0; i < sizeof stages / sizeof *stages; i++) {
        if (stages[i].kind == kind && strcmp(name, stages[i].name) == 0) {
            *keeps_checkpoint = stages[i].keeps_checkpoint;
            return true;
        }
    }
    return false;
}

const char *job_stages(enum job_kind kind) {
    return kind == JOB_RENDER     ? "render"
           : kind == JOB_EVALUATE ? "evaluate"
                                  : "load, prepare, fuse, solve, refine, report, export";
}

void job_release(struct job *job) {
    mem_free(job->files);
    mem_free(job->owner);
    mem_free(job->name);
    mem_free(job->labels);
    mem_free(job->settings);
    mem_free(job->stage);
    mem_free(job->restart_from);
    mem_free(job->webhook);
    mem_free(job->delivery);
    mem_free(job->reason);
    mem_free(job->hint);
    *job = (struct job){.eta_sec = -1.0};
}
