/* boot.h -- identifies the current boot: kernel memory outlives a process but not a reboot. */
#ifndef UNBAKE_COMMON_BOOT_H
#define UNBAKE_COMMON_BOOT_H

#define BOOT_ID_SIZE 40 /* 36 characters and the NUL, rounded up */

/* The kernel's boot id, 36 characters. Where it is not to be seen (ProcSubset=pid of a systemd unit), what the
 * environment has as UNBAKED_BOOT_ID, to which the unit gives the same number; else "". */
void boot_id(char id[BOOT_ID_SIZE]);

/* Brings an id with or without its four hyphens, and with or without a newline, into the kernel's form; "" if it is
 * none. */
void boot_id_normalise(const char *text, char id[BOOT_ID_SIZE]);

#endif
