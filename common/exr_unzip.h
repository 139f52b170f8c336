/* exr_unzip.h -- EXR chunks that claim to be stored raw but are compressed; private to the EXR codec. */
#ifndef UNBAKE_COMMON_EXR_UNZIP_H
#define UNBAKE_COMMON_EXR_UNZIP_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* OpenEXRCore before 3.4.7 (used by Blender, and by our own first files) stores a zlib stream that happens to be
 * exactly as large as the pixels, which readers take for raw pixels (OpenEXR issue 2306). True when the `size` bytes
 * are a complete stream with a valid checksum: out[size] receives the pixels. Raw pixels pass for one with a
 * probability of 2^-40 or less. */
bool exr_unzip(const uint8_t *data, size_t size, uint8_t *out);

#endif
