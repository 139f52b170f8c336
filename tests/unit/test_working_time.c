/* working_time.h: work counts, by one thread or by all; being stopped does not. */
#include "server/worker/working_time.h"

#include <signal.h>
#include <stdbool.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "tests/check.h"

static double cpu_sec(void) {
    struct timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static double work(double sec) {
    double end = cpu_sec() + sec;
    volatile double x = 1.0;
    while (cpu_sec() < end)
        x = x * 1.0000001;
    return x;
}

/* Of a process of two threads one works, and half the time on the wall nobody does. */
static int working_child(void) {
    struct working_time w;
    working_time_init(&w, 2);
    double begin = cpu_sec();
    work(0.1);
    kill(getpid(), SIGSTOP);
    double worked = working_time_sec(&w), used = cpu_sec() - begin;
    bool good = worked >= 0.1 && worked <= used + 1e-3 && working_time_sec(&w) >= worked;
    if (!good)
        fprintf(stderr, "%g s of work, of which %g s were told\n", used, worked);
    return !good;
}

int main(void) {
    const struct timespec pause = {0, 300000000};
    int status;
    pid_t pid = fork();
    if (pid == 0)
        _exit(working_child());
    CHECK(waitpid(pid, &status, WUNTRACED) == pid && WIFSTOPPED(status));
    nanosleep(&pause, NULL);
    CHECK(kill(pid, SIGCONT) == 0 && waitpid(pid, &status, 0) == pid);
    CHECK(WIFEXITED(status) && WEXITSTATUS(status) == 0);
    return check_result();
}
