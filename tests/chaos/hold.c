/* hold PAGE new ROOT | count | at N | is | await | slow MS | go -- for shell tests: workers under preload/files.so are
 * held up, so that what a test does to them does not depend on how fast they are. new: makes the page of faults.h for
 * what happens below ROOT, and counts; count: prints how many operations on files workers did; at: the N-th from now on
 * holds each worker up; is: whether one is; await: waits until one is; slow: each operation takes MS longer; go: they
 * go on. */
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "tests/chaos/faults.h"

#define TRIES 30000 /* of 2 ms */

int main(int argc, char **argv) {
    const char *what = argc > 2 ? argv[2] : "", *word = argc > 3 ? argv[3] : "";
    struct faults *f = strcmp(what, "new") == 0 ? faults_new(argv[1], word, NULL)
                       : argc > 2               ? faults_map(argv[1])
                                                : NULL;
    if (!f)
        return 2;
    if (strcmp(what, "new") == 0)
        faults_arm(f, FAULTS_WORKER, 0, 0, false);
    else if (strcmp(what, "count") == 0)
        printf("%ld\n", atomic_load(&f->count));
    else if (strcmp(what, "at") == 0)
        faults_arm(f, FAULTS_WORKER, strtol(word, NULL, 10), FAULTS_HOLD, true);
    else if (strcmp(what, "slow") == 0) {
        atomic_store(&f->delay_ms, (int)strtol(word, NULL, 10));
        faults_arm(f, FAULTS_WORKER, 1, FAULTS_SLOW, true);
    } else if (strcmp(what, "is") == 0)
        return atomic_load(&f->failed) == 0;
    else if (strcmp(what, "go") == 0)
        faults_lift(f);
    else
        for (int i = 0; atomic_load(&f->failed) == 0; usleep(2000))
            if (++i == TRIES)
                return 1;
    return 0;
}
