/* exr_header.c -- chooses the part and channels of an EXR file and checks its sizes.
 *
 * Sizes are checked against image.h's limits and against the file's length before pixels are allocated: a chunk takes
 * at least 8 bytes of table and compresses at most MAX_RATIO : 1, so a small file cannot demand a large picture. */
#include <string.h>

#include "common/exr_reader.h"

/* Deflate reaches 1032 : 1, after PXR24 has dropped a byte of four. */
#define MAX_RATIO 1536

static int find_channel(const exr_attr_chlist_t *list, const char *name) {
    for (int i = 0; i < list->num_channels; i++)
        if (strcmp(list->entries[i].name.str, name) == 0)
            return i;
    return -1;
}

/* Whether the part's colours are a better picture than those of the best part so far. */
static bool is_better(const struct exr_reader *r, const exr_attr_chlist_t *list, int part_count, int part,
                      struct exr_colors *colors) {
    const char *name = NULL;
    if (part_count > 1)
        exr_get_name(r->context, part, &name); /* absent: NULL */
    if (!r->stream->source->wants_color) {
        bool is_color = find_channel(list, "R") >= 0 && find_channel(list, "G") >= 0 && find_channel(list, "B") >= 0;
        *colors = (struct exr_colors){{-1, -1, -1, -1}, is_color ? 0 : EXR_NO_COLOR, -1};
    } else {
        exr_find_colors(list, name, colors);
    }
    return r->part < 0 || colors->rank < r->colors.rank;
}

/* Chooses the first part with R, G and B (of the best rank, for a photograph), else the first that is not deep. */
static enum status choose_part(struct exr_reader *r, struct error *err) {
    int part_count = 0;
    exr_result_t code = exr_get_count(r->context, &part_count);
    r->part = -1;
    for (int i = 0; code == EXR_ERR_SUCCESS && i < part_count; i++) {
        exr_storage_t storage;
        const exr_attr_chlist_t *list;
        struct exr_colors colors;
        code = exr_get_storage(r->context, i, &storage);
        if (code != EXR_ERR_SUCCESS || storage > EXR_STORAGE_TILED)
            continue;
        code = exr_get_channels(r->context, i, &list);
        if (code != EXR_ERR_SUCCESS)
            break;
        if (is_better(r, list, part_count, i, &colors)) {
            r->part = i;
            r->storage = storage;
            r->list = list;
            r->colors = colors;
        }
    }
    if (code != EXR_ERR_SUCCESS)
        return exr_stream_refuse(r->stream, code, err);
    if (r->part < 0)
        return error_set(err, STATUS_INPUT, "%s: the EXR holds only deep data; a flat picture was expected",
                         r->stream->source->name);
    return STATUS_OK;
}

/* Of a photograph only the picture's channels are read. */
static bool is_wanted(const struct exr_reader *r, int channel) {
    const int *index = r->colors.index;
    if (!r->stream->source->wants_color)
        return true;
    if (index[0] < 0)
        return strcmp(r->list->entries[channel].name.str, "Y") == 0;
    return channel == index[0] || channel == index[1] || channel == index[2] || channel == index[3];
}

static enum status check_colors(const struct exr_reader *r, struct error *err) {
    char name[2][sizeof((struct image *)NULL)->channel[0]];
    const struct exr_colors *c = &r->colors;
    if (!r->stream->source->wants_color || c->index[0] < 0 || c->rival < 0)
        return STATUS_OK;
    exr_stream_printable(r->list->entries[c->index[0]].name.str, name[0], sizeof name[0]);
    exr_stream_printable(r->list->entries[c->rival].name.str, name[1], sizeof name[1]);
    error_set(err, STATUS_INPUT, "%s: the EXR has several layers with colours, %s and %s among them",
              r->stream->source->name, name[0], name[1]);
    return error_hint(err, "save only the picture, as R, G and B");
}

/* Refuses channels that the picture cannot hold. */
static enum status check_channels(const struct exr_reader *r, struct error *err) {
    const exr_attr_chlist_t *list = r->list;
    const char *file = r->stream->source->name;
    int limit = r->stream->source->wants_color ? EXR_MAX_CHANNELS : IMAGE_MAX_CHANNELS - 2; /* grey becomes three */
    if (list->num_channels > limit)
        return error_set(err, STATUS_LIMIT, "%s: %d channels are more than the limit of %d", file, list->num_channels,
                         limit);
    bool half = true;
    for (int i = 0; i < list->num_channels; i++) {
        const exr_attr_chlist_entry_t *entry = &list->entries[i];
        char name[sizeof((struct image *)NULL)->channel[0]];
        exr_stream_printable(entry->name.str, name, sizeof name);
        if (entry->x_sampling != 1 || entry->y_sampling != 1)
            return error_set(err, STATUS_INPUT,
                             "%s: channel %s is subsampled %d x %d (luminance/chroma EXR); only "
                             "full-resolution channels can be read",
                             file, name, entry->x_sampling, entry->y_sampling);
        if (is_wanted(r, i) && strlen(entry->name.str) >= sizeof name)
            return error_set(err, STATUS_INPUT, "%s: the channel name %s... is too long", file, name);
        half = half && entry->pixel_type == EXR_PIXEL_HALF;
    }
    if (r->compression <= EXR_COMPRESSION_PXR24 || (half && r->compression <= EXR_COMPRESSION_B44A))
        return STATUS_OK;
    /* OpenEXRCore 3.1.5 has no DWA and mixes up the rows of B44's other channels. */
    error_set(err, STATUS_INPUT, "%s: this reader knows no EXR compression %s", file,
              r->compression <= EXR_COMPRESSION_B44A ? "B44 of channels other than half" : "DWAA or DWAB");
    return error_hint(err, "save the file with ZIP or PIZ compression");
}

/* The picture of a photograph; Y becomes all three. */
static uint32_t order_colors(struct exr_reader *r, const char **name) {
    uint32_t count = 0;
    r->grey = r->colors.index[0] >= 0 ? -1 : find_channel(r->list, "Y");
    for (int i = 0; i < r->list->num_channels; i++)
        r->target[i] = -1;
    for (; count < 3; count++)
        name[count] = image_rgba[count];
    if (r->grey >= 0)
        r->target[r->grey] = 0;
    for (uint32_t c = 0; c < 4; c++)
        if (r->colors.index[c] >= 0)
            r->target[r->colors.index[c]] = (int)c;
    if (r->colors.index[3] >= 0)
        name[count++] = image_rgba[3];
    return count;
}

/* Orders the channels: R, G, B, A first, then the others alphabetically. Fills name[] and returns their count. */
static uint32_t order_channels(struct exr_reader *r, const char **name) {
    const exr_attr_chlist_t *list = r->list;
    bool colour = find_channel(list, "R") >= 0 || find_channel(list, "G") >= 0 || find_channel(list, "B") >= 0;
    uint32_t count = 0;
    r->grey = colour ? -1 : find_channel(list, "Y");
    for (int i = 0; i < list->num_channels; i++)
        r->target[i] = -1;
    if (r->grey >= 0) {
        r->target[r->grey] = 0;
        for (; count < 3; count++)
            name[count] = image_rgba[count];
    }
    for (int k = 0; k < 4; k++) {
        int i = find_channel(list, image_rgba[k]);
        if (i < 0)
            continue;
        r->target[i] = (int)count;
        name[count++] = image_rgba[k];
    }
    for (int i = 0; i < list->num_channels; i++) {
        if (r->target[i] >= 0)
            continue;
        r->target[i] = (int)count;
        name[count++] = list->entries[i].name.str;
    }
    return count;
}

static int64_t side(int32_t min, int32_t max) { return (int64_t)max - min + 1; }

/* Checks the sizes against the file's length. */
static enum status check_plausible(const struct exr_reader *r, struct error *err) {
    const struct image_source *source = r->stream->source;
    int32_t chunk_count = 0;
    exr_result_t code = exr_get_chunk_count(r->context, r->part, &chunk_count);
    if (code != EXR_ERR_SUCCESS)
        return exr_stream_refuse(r->stream, code, err);
    uint64_t pixel_bytes = 0;
    for (int i = 0; i < r->list->num_channels; i++)
        pixel_bytes += r->list->entries[i].pixel_type == EXR_PIXEL_HALF ? 2 : 4;
    uint64_t bytes =
        pixel_bytes * (uint64_t)side(r->data.min.x, r->data.max.x) * (uint64_t)side(r->data.min.y, r->data.max.y);
    uint64_t ratio = r->compression == EXR_COMPRESSION_NONE ? 1 : MAX_RATIO;
    if (chunk_count < 1 || (uint64_t)chunk_count * 8 > source->size || bytes / ratio > source->size)
        return error_set(err, STATUS_INPUT,
                         "%s: damaged EXR: the file's %llu bytes cannot hold the picture that its "
                         "header promises",
                         source->name, (unsigned long long)source->size);
    return STATUS_OK;
}

/* The part of the display window that the file has pixels of. */
static void set_window(const struct exr_reader *r, struct image_info *info) {
    const exr_attr_box2i_t *data = &r->data, *display = &r->display;
    int32_t x0 = data->min.x > display->min.x ? data->min.x : display->min.x;
    int32_t y0 = data->min.y > display->min.y ? data->min.y : display->min.y;
    int32_t x1 = data->max.x < display->max.x ? data->max.x : display->max.x;
    int32_t y1 = data->max.y < display->max.y ? data->max.y : display->max.y;
    info->window =
        (struct image_window){(uint32_t)((int64_t)x0 - display->min.x), (uint32_t)((int64_t)y0 - display->min.y),
                              (uint32_t)side(x0, x1), (uint32_t)side(y0, y1)};
    info->stored_width = (uint32_t)side(data->min.x, data->max.x);
    info->stored_height = (uint32_t)side(data->min.y, data->max.y);
}

enum status exr_read_header(struct exr_reader *r, struct image *image, struct image_info *info, struct error *err) {
    enum status status = choose_part(r, err);
    if (status != STATUS_OK)
        return status;
    exr_result_t code = exr_get_data_window(r->context, r->part, &r->data);
    if (code == EXR_ERR_SUCCESS)
        code = exr_get_display_window(r->context, r->part, &r->display);
    if (code == EXR_ERR_SUCCESS)
        code = exr_get_compression(r->context, r->part, &r->compression);
    if (code != EXR_ERR_SUCCESS)
        return exr_stream_refuse(r->stream, code, err);
    status = check_channels(r, err);
    if (status == STATUS_OK)
        status = check_colors(r, err);
    if (status != STATUS_OK)
        return status;
    const char *name[IMAGE_MAX_CHANNELS];
    bool wants_color = r->stream->source->wants_color;
    if (wants_color && r->colors.index[0] < 0 && find_channel(r->list, "Y") < 0)
        return error_set(err, STATUS_INPUT, "%s: the EXR has no channels R, G and B, in no layer, and no Y",
                         r->stream->source->name);
    uint32_t channel_count = wants_color ? order_colors(r, name) : order_channels(r, name);
    const exr_attr_box2i_t *windows[2] = {&r->data, &r->display};
    for (int i = 0; i < 2; i++) { /* both have to pass; the display window is what stays */
        image_release(image);
        int64_t width = side(windows[i]->min.x, windows[i]->max.x);
        int64_t height = side(windows[i]->min.y, windows[i]->max.y);
        status = image_header(image, r->stream->source->name, width < 0 ? 0 : (uint64_t)width,
                              height < 0 ? 0 : (uint64_t)height, channel_count, name, err);
        if (status != STATUS_OK)
            return status;
    }
    if (r->data.min.x > r->display.max.x || r->data.max.x < r->display.min.x || r->data.min.y > r->display.max.y ||
        r->data.max.y < r->display.min.y)
        return error_set(err, STATUS_INPUT, "%s: the EXR's data window lies outside its display window",
                         r->stream->source->name);
    set_window(r, info);
    info->encoding = IMAGE_LINEAR;
    info->bits = 16;
    for (int i = 0; i < r->list->num_channels; i++)
        if (r->target[i] >= 0 && r->target[i] < 3 && r->list->entries[i].pixel_type != EXR_PIXEL_HALF)
            info->bits = 32;
    return check_plausible(r, err);
}
