/* test_executors.c -- attempts on a cluster that misbehaves: random scripts against the model of executor_model.h; 300,
 * in the long form 100,000. UNBAKE_SCRIPTS sets how many, UNBAKE_SEED the first. */
#include "common/clock.h"
#include "tests/chaos/executor_model.h"
#include "tests/figures.h"

int main(void) {
    long count = figures_count("UNBAKE_SCRIPTS", 300, 100000);
    uint64_t first = (uint64_t)figures_count("UNBAKE_SEED", 1, 1);
    double begun = clock_sec();
    log_set_level(LOG_ERROR);
    model_open();
    for (long i = 0; i < count && check_failed_count == 0; i++)
        run_script(first + (uint64_t)i);
    printf("%ld scripts in %.0f s: %ld claims, %ld ends, %ld deaths of the daemon, %ld lost, %ld pre-empted, "
           "%ld last words\n",
           count, clock_sec() - begun, model.claims, model.ends, model.restarts, model.losses, model.preemptions,
           model.log_tail);
    /* The scripts do what they are for. */
    CHECK(count < 100 || (model.claims > count && model.restarts > count / 2 && model.losses > 0 &&
                          model.preemptions > 0 && model.log_tail > 0));
    if (getenv("UNBAKE_LONG"))
        figure("executor scripts that broke the model", check_failed_count, 0, "lower");
    model_close();
    return check_result();
}
