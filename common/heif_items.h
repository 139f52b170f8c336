/* heif_items.h -- whether the items of a HEIF file refer to each other within reason. Private to its codec. */
#ifndef UNBAKE_COMMON_HEIF_ITEMS_H
#define UNBAKE_COMMON_HEIF_ITEMS_H

#include "common/image_codec.h"

/* NULL, or what is wrong: an image that is derived from itself, which libheif 1.15 decodes until its stack ends; or one
 * of absurdly many parts. */
const char *heif_items_fault(struct image_source *source);

#endif
