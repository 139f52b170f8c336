/* clock.h -- the time that only grows. For dates use clock_gettime(CLOCK_REALTIME). */
#ifndef UNBAKE_COMMON_CLOCK_H
#define UNBAKE_COMMON_CLOCK_H

/* Seconds of CLOCK_MONOTONIC, from an arbitrary start that all processes share until a reboot. */
double clock_sec(void);

#endif
