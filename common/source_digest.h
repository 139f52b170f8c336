/* source_digest.h -- which program this is, more exactly than its version says: of two that were built from the same
 * sources, on whatever machine, both are the same. Made by the Makefile; only in the daemon's program. */
#ifndef UNBAKE_COMMON_SOURCE_DIGEST_H
#define UNBAKE_COMMON_SOURCE_DIGEST_H

/* "0.1.0 (sources 0123456789abcdef)": the version and the beginning of the SHA-256 of common/ and server/. */
extern const char source_version[];

#endif
