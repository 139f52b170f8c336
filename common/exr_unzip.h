/* exr_unzip.h -- chunks of EXR files that say they are stored raw and are not; private to the EXR codec. */
#ifndef UNBAKE_COMMON_EXR_UNZIP_H
#define UNBAKE_COMMON_EXR_UNZIP_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Writers on OpenEXRCore before 3.4.7 (Blender's and our own first files among them) stored the zlib stream where it had
 * just the size of the pixels, which readers take for pixels (OpenEXR issue 2306). True where the `size` bytes are such a
 * stream, whole and with the right checksum: out[size] gets the pixels. Pixels pass for one by chance once in 2^40 or
 * more. */
bool exr_unzip(const uint8_t *data, size_t size, uint8_t *out);

#endif
