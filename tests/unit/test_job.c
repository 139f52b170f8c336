/* test_job.c -- the words of states and the arrows between them. */
#include "server/job/job.h"

#include "tests/check.h"

int main(void) {
    /* The diagram of job.h, row by row: Queued Running Paused Succeeded Failed Cancelled. */
    static const char *const arrows[JOB_STATE_COUNT] = {
        [JOB_QUEUED] = ".RP..C",    [JOB_RUNNING] = "Q.PSFC", [JOB_PAUSED] = "Q....C",
        [JOB_SUCCEEDED] = "Q.....", [JOB_FAILED] = "Q.....",  [JOB_CANCELLED] = "Q.....",
    };
    for (int from = 0; from < JOB_STATE_COUNT; from++) {
        for (int to = 0; to < JOB_STATE_COUNT; to++)
            CHECK_THAT(job_may_become((enum job_state)from, (enum job_state)to) == (arrows[from][to] != '.'),
                       "%s -> %s", job_state_name((enum job_state)from), job_state_name((enum job_state)to));
        enum job_state parsed;
        CHECK(job_state_parse(job_state_name((enum job_state)from), &parsed) && (int)parsed == from);
    }
    enum job_state state;
    CHECK(!job_state_parse("sleeping", &state));
    CHECK(job_is_terminal(JOB_SUCCEEDED) && job_is_terminal(JOB_FAILED));
    CHECK(job_is_terminal(JOB_CANCELLED) && !job_is_terminal(JOB_PAUSED));
    CHECK_STRING(job_wanted_name(JOB_WANT_PAUSE), "pause");
    return check_result();
}
