/* notify.h -- telling systemd how the daemon is (sd_notify(3)), without its library: a datagram to
 * the Unix socket that $NOTIFY_SOCKET names. Does nothing where there is none. */
#ifndef UNBAKE_SERVER_NOTIFY_H
#define UNBAKE_SERVER_NOTIFY_H

/* "READY=1", "STOPPING=1", "WATCHDOG=1", ...; several with a newline between them. */
void notify(const char *state);

/* Seconds in which systemd wants to hear "WATCHDOG=1" at least once (WatchdogSec=); 0: never. */
double notify_watchdog_sec(void);

#endif
