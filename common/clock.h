/* clock.h -- the time that only grows, and Unix time. */
#ifndef UNBAKE_COMMON_CLOCK_H
#define UNBAKE_COMMON_CLOCK_H

#include <stdint.h>

/* Seconds of CLOCK_MONOTONIC, from an arbitrary start that all processes share until a reboot. */
double clock_sec(void);

/* Milliseconds since 1970-01-01 UTC, by the system's clock, which may be set back. */
int64_t clock_unix_ms(void);

#define CLOCK_TEXT_SIZE 32 /* 24 characters and the NUL, rounded up */
/* Such a time as 2026-11-21T12:00:00.123Z. */
void clock_text(int64_t unix_ms, char text[CLOCK_TEXT_SIZE]);
/* The time, with or without a fraction (which is left out); 0 where it is malformed. */
int64_t clock_read(const char *text);

#endif
