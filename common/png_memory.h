/* png_memory.h -- libpng on our allocator: out of memory is not a damaged picture. Private to the PNG codec. */
#ifndef UNBAKE_COMMON_PNG_MEMORY_H
#define UNBAKE_COMMON_PNG_MEMORY_H

#include <png.h>

#include "common/mem.h"

static inline png_voidp png_memory_new(png_structp png, png_alloc_size_t bytes) {
    (void)png;
    return mem_alloc(bytes);
}

static inline void png_memory_free(png_structp png, png_voidp memory) {
    (void)png;
    mem_free(memory);
}

#endif
