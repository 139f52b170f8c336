/* test_remote_model.c -- attempts on a cluster that misbehaves: 300 random scripts, against the model of remote_model.h.
 * With a number as argument, so many; a second one is the first seed (tests/chaos/executors.sh runs 100,000). */
#include "tests/unit/remote_model.h"

int main(int argc, char **argv) {
    long count = argc > 1 ? strtol(argv[1], NULL, 10) : 300;
    uint64_t first = argc > 2 ? strtoull(argv[2], NULL, 10) : 1;
    log_set_level(LOG_ERROR);
    model_open();
    for (long i = 0; i < count && check_failed_count == 0; i++)
        run_script(first + (uint64_t)i);
    printf("%ld scripts: %ld claims, %ld ends, %ld deaths of the daemon, %ld lost, %ld pre-empted\n", count,
           model.claims, model.ends, model.restarts, model.losses, model.preemptions);
    /* The scripts do what they are for. */
    CHECK(count < 100 ||
          (model.claims > count && model.restarts > count / 2 && model.losses > 0 && model.preemptions > 0));
    model_close();
    return check_result();
}
