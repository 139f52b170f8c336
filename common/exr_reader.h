/* exr_reader.h -- state of reading an EXR file, shared by exr_header.c and exr_decode.c; private to the codec. */
#ifndef UNBAKE_COMMON_EXR_READER_H
#define UNBAKE_COMMON_EXR_READER_H

#include "common/exr_layers.h"
#include "common/exr_stream.h"

/* Of a part: renders with all passes and Cryptomatte have about a hundred. */
#define EXR_MAX_CHANNELS 512

struct exr_reader {
    exr_context_t context;
    struct exr_stream *stream;
    int part;
    exr_storage_t storage;
    exr_compression_t compression;
    const exr_attr_chlist_t *list;
    exr_attr_box2i_t data, display;
    struct exr_colors colors;     /* only where source->wants_color */
    int grey;                     /* index in `list` of the Y that becomes R, G and B; or -1 */
    int target[EXR_MAX_CHANNELS]; /* channel of the picture for each of `list`; -1: not wanted */
};

/* Chooses part and channels and checks the limits; sets the size (display window) and channel names of *image. */
enum status exr_read_header(struct exr_reader *r, struct image *image, struct image_info *info, struct error *err);

/* One channel of one line of a chunk, from (x, y) in the data window; little-endian, of the channel's type. */
struct exr_row {
    int channel; /* of r->list */
    uint16_t type;
    uint32_t x, y, width;
    const uint8_t *values;
};

/* Passes each row of the part's pixels (level 0) to `take`. All rows lie in the data window. */
enum status exr_decode(const struct exr_reader *r, void (*take)(void *user, const struct exr_row *row), void *user,
                       struct error *err);

/* Sides of the data window. */
static inline uint32_t exr_data_width(const struct exr_reader *r) {
    return (uint32_t)((int64_t)r->data.max.x - r->data.min.x + 1);
}
static inline uint32_t exr_data_height(const struct exr_reader *r) {
    return (uint32_t)((int64_t)r->data.max.y - r->data.min.y + 1);
}

#endif
