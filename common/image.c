/* image.c -- see image.h: pictures in memory, which codec reads a file, and the conversions of
 * single values. */
#include "common/image.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/image_codec.h"
#include "common/mem.h"

const char *const image_rgba[4] = {"R", "G", "B", "A"};

static void set_header(struct image *image, uint32_t width, uint32_t height,
                       uint32_t channel_count, const char *const *channel) {
    *image = (struct image){.width = width, .height = height, .channel_count = channel_count};
    image->channel = mem_calloc(channel_count, sizeof *image->channel);
    for (uint32_t c = 0; c < channel_count; c++)
        strncpy(image->channel[c], channel[c], sizeof *image->channel - 1);
}

void image_allocate(struct image *image) {
    size_t pixel_count = (size_t)image->width * image->height;
    /* Fresh from the kernel, such memory costs nothing until a decoder gets that far: a header
     * that lies about a large picture is cheap. */
    image->pixel = mem_calloc(pixel_count, image->channel_count * sizeof(float));
}

void image_init(struct image *image, uint32_t width, uint32_t height, uint32_t channel_count,
                const char *const *channel) {
    set_header(image, width, height, channel_count, channel);
    image_allocate(image);
}

void image_release(struct image *image) {
    mem_free(image->channel);
    mem_free(image->pixel);
    *image = (struct image){0};
}

int image_channel(const struct image *image, const char *name) {
    for (uint32_t c = 0; c < image->channel_count; c++)
        if (strcmp(image->channel[c], name) == 0)
            return (int)c;
    return -1;
}

enum status image_header(struct image *image, const char *name, uint64_t width, uint64_t height,
                         uint32_t channel_count, const char *const *channel, struct error *err) {
    if (width == 0 || height == 0 || channel_count == 0)
        return error_set(err, STATUS_INPUT, "%s: the picture has no pixels", name);
    if (width > IMAGE_MAX_SIDE || height > IMAGE_MAX_SIDE || width * height > IMAGE_MAX_PIXELS)
        return error_set(err, STATUS_LIMIT,
                         "%s: %llu x %llu pixels are more than the limits of %d a side and %zu "
                         "altogether", name, (unsigned long long)width,
                         (unsigned long long)height, IMAGE_MAX_SIDE, IMAGE_MAX_PIXELS);
    if (channel_count > IMAGE_MAX_CHANNELS)
        return error_set(err, STATUS_LIMIT, "%s: %u channels are more than the limit of %d", name,
                         channel_count, IMAGE_MAX_CHANNELS);
    set_header(image, (uint32_t)width, (uint32_t)height, channel_count, channel);
    return STATUS_OK;
}

size_t image_source_read(struct image_source *source, uint64_t offset, void *buffer,
                         size_t length) {
    if (offset >= source->size)
        return 0;
    if (length > source->size - offset)
        length = (size_t)(source->size - offset);
    if (source->memory) {
        memcpy(buffer, source->memory + offset, length);
        return length;
    }
    size_t done = 0;
    while (done < length) {
        ssize_t got = pread(source->fd, (char *)buffer + done, length - done,
                            (off_t)(offset + done));
        if (got < 0 && errno == EINTR)
            continue;
        if (got < 0 && source->io_error == 0)
            source->io_error = errno;
        if (got <= 0)
            break;
        done += (size_t)got;
    }
    return done;
}

static enum status read_source(struct image_source *source, bool probe, struct image *image,
                               struct image_info *info, struct error *err) {
    static const struct {
        const char *magic;
        size_t length;
        enum status (*read)(struct image_source *, bool, struct image *, struct image_info *,
                            struct error *);
    } codecs[] = {
        {"\x76\x2f\x31\x01", 4, image_read_exr},
        {"\x89PNG", 4, image_read_png}, /* libpng explains what is wrong with the other four */
        {"\xff\xd8\xff", 3, image_read_jpeg},
        {"#?", 2, image_read_hdr},
    };
    struct image_info unwanted;
    if (!info)
        info = &unwanted;
    *image = (struct image){0};
    *info = (struct image_info){.orientation = 1};
    char start[8];
    size_t length = image_source_read(source, 0, start, sizeof start);
    enum status status = STATUS_INPUT;
    size_t i = 0, codec_count = sizeof codecs / sizeof codecs[0];
    while (i < codec_count && (length < codecs[i].length ||
                               memcmp(start, codecs[i].magic, codecs[i].length) != 0))
        i++;
    if (i < codec_count)
        status = codecs[i].read(source, probe, image, info, err);
    else if (source->size == 0)
        error_set(err, status, "%s: the file is empty", source->name);
    else
        error_set(err, status, "%s: not a picture in EXR, PNG, JPEG or Radiance HDR format",
                  source->name);
    /* What a decoder takes for a short file may be a failing disk. */
    if (source->io_error)
        status = error_set_errno(err, source->io_error, "cannot read %s", source->name);
    if (status != STATUS_OK)
        image_release(image);
    return status;
}

static enum status read_path(const char *path, bool probe, struct image *image,
                             struct image_info *info, struct error *err) {
    *image = (struct image){0};
    /* Without O_NONBLOCK a FIFO under a picture's name would block for ever. */
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (fd < 0)
        return error_set_errno(err, errno, "cannot open %s", path);
    struct stat facts;
    enum status status;
    if (fstat(fd, &facts) != 0)
        status = error_set_errno(err, errno, "cannot read %s", path);
    else if (!S_ISREG(facts.st_mode))
        status = error_set(err, STATUS_INPUT, "%s: not a regular file", path);
    else {
        struct image_source source = {.name = path, .fd = fd, .size = (uint64_t)facts.st_size};
        status = read_source(&source, probe, image, info, err);
    }
    close(fd);
    return status;
}

enum status image_read(const char *path, struct image *image, struct image_info *info,
                       struct error *err) {
    return read_path(path, false, image, info, err);
}

enum status image_probe(const char *path, struct image *image, struct image_info *info,
                        struct error *err) {
    return read_path(path, true, image, info, err);
}

enum status image_read_memory(const char *name, const void *data, size_t size,
                              struct image *image, struct image_info *info, struct error *err) {
    struct image_source source = {.name = name, .memory = data, .fd = -1, .size = size};
    return read_source(&source, false, image, info, err);
}

float image_srgb_to_linear(float value) {
    return value <= 0.04045f ? value / 12.92f : powf((value + 0.055f) / 1.055f, 2.4f);
}

float image_linear_to_srgb(float value) {
    return value <= 0.0031308f ? value * 12.92f : 1.055f * powf(value, 1.0f / 2.4f) - 0.055f;
}

uint16_t image_half_from_float(float value) {
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    uint32_t sign = bits >> 16 & 0x8000, magnitude = bits & 0x7fffffff;
    if (magnitude > 0x7f800000) /* not a number: keep what fits of the payload, never infinity */
        return (uint16_t)(sign | 0x7e00 | (magnitude >> 13 & 0x1ff));
    if (magnitude >= 0x477ff000) /* 65520 and up rounds to infinity */
        return (uint16_t)(sign | 0x7c00);
    if (magnitude < 0x33000000) /* below half of the smallest subnormal */
        return (uint16_t)sign;
    uint32_t mantissa = magnitude, shift = 13;
    if (magnitude < 0x38800000) { /* subnormal: make the implicit bit explicit */
        mantissa = (magnitude & 0x7fffff) | 0x800000;
        shift = 126 - (magnitude >> 23);
    } else {
        mantissa -= 0x38000000; /* rebias the exponent from 127 to 15 */
    }
    uint32_t kept = mantissa >> shift, rest = mantissa & ((1u << shift) - 1);
    uint32_t middle = 1u << (shift - 1);
    kept += rest > middle || (rest == middle && (kept & 1)); /* may carry into the exponent */
    return (uint16_t)(sign | kept);
}

float image_float_from_half(uint16_t half) {
    return image_half_to_float(half);
}
