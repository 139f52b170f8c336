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

const char *job_wanted_name(enum job_wanted wanted) {
    static const char *const names[] = {"run", "pause", "cancel"};
    return (unsigned)wanted < 3 ? names[wanted] : "unknown";
}

const char *scene_state_name(enum scene_state state) {
    return (unsigned)state < SCENE_STATE_COUNT ? scene_names[state] : "unknown";
}

bool scene_state_parse(const char *name, enum scene_state *state) {
    for (unsigned i = 0; i < SCENE_STATE_COUNT; i++) {
        if (strcmp(name, scene_names[i]) == 0) {
            *state = (enum scene_state)i;
            return true;
        }
    }
    return false;
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

bool job_stage_parse(const char *name, bool *keeps_checkpoint) {
    static const struct {
        const char *name;
        bool keeps_checkpoint;
    } stages[] = {{"load", false},   {"prepare", false}, {"fuse", false}, {"solve", false},
                  {"refine", false}, {"report", true},   {"export", true}};
    for (size_t i = 0; i < sizeof stages / sizeof *stages; i++) {
        if (strcmp(name, stages[i].name) == 0) {
            *keeps_checkpoint = stages[i].keeps_checkpoint;
            return true;
        }
    }
    return false;
}

void job_release(struct job *job) {
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
