/* image_codec.c -- see image_codec.h. */
#include "common/image_codec.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "common/mem.h"

const char *const image_rgba[4] = {"R", "G", "B", "A"};

enum status image_source_open(struct image_source *source, const char *path, struct error *err) {
    struct stat facts;
    enum status status = STATUS_OK;
    /* Without O_NONBLOCK a FIFO under a picture's name would block for ever. */
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (fd < 0)
        return error_set_errno(err, errno, "cannot open %s", path);
    if (fstat(fd, &facts) != 0)
        status = error_set_errno(err, errno, "cannot read %s", path);
    else if (!S_ISREG(facts.st_mode))
        status = error_set(err, STATUS_INPUT, "%s: not a regular file", path);
    else
        *source = (struct image_source){.name = path, .fd = fd, .size = (uint64_t)facts.st_size};
    if (status != STATUS_OK)
        close(fd);
    return status;
}

void image_source_close(struct image_source *source) { close(source->fd); }

/* Maps clipped channels of the file to the Rec. 709 channels they contribute most to (for wider spaces each to its
 * own). Their smaller contributions to other channels (at most 0.23 for Display P3) are not marked, though they are
 * underestimated, as in a camera, whose sensor clips before its matrix. */
static void find_clipped(struct image *image) {
    size_t count = (size_t)image->width * image->height;
    image->clipped = mem_alloc(count);
    for (size_t i = 0; i < count; i++) {
        const float *pixel = image->pixel + i * image->channel_count;
        image->clipped[i] = (uint8_t)((pixel[0] >= IMAGE_CLIP_SHARE) | (pixel[1] >= IMAGE_CLIP_SHARE) << 1 |
                                      (pixel[2] >= IMAGE_CLIP_SHARE) << 2);
    }
}

void image_color_by_exif(const struct image_info *info, struct color *color) {
    if (info->is_adobe_rgb)
        color_set_adobe_rgb(color, info->bits);
    else if (info->is_uncalibrated && color->warning[0] == '\0')
        snprintf(color->warning, sizeof color->warning,
                 "its EXIF says that its colours are not those of sRGB, and no profile says what they are");
}

void image_divide_by_alpha(struct image *image, float most) {
    size_t count = (size_t)image->width * image->height;
    for (size_t i = 0; i < count; i++) {
        float *pixel = image->pixel + 4 * i;
        for (int c = 0; c < 3 && pixel[3] > 0.0f; c++)
            pixel[c] = pixel[c] / pixel[3] > most ? most : pixel[c] / pixel[3]; /* NaN stays */
    }
}

void image_convert(struct image *image, struct image_info *info, struct color *color) {
    size_t ignored = 0;
    float clip[3] = {IMAGE_CLIP_SHARE, IMAGE_CLIP_SHARE, IMAGE_CLIP_SHARE};
    memcpy(info->color_space, color->name, sizeof info->color_space);
    memcpy(info->color_warning, color->warning, sizeof info->color_warning);
    if (!color->is_srgb) {
        find_clipped(image);
        color_convert(color, image->pixel, image->channel_count, (size_t)image->width * image->height,
                      &info->outside_count);
        color_convert(color, clip, 3, 1, &ignored);
        info->clip = fminf(clip[0], fminf(clip[1], clip[2]));
        info->encoding = IMAGE_CONVERTED;
    }
    color_release(color);
}

size_t image_source_read(struct image_source *source, uint64_t offset, void *buffer, size_t length) {
    if (offset >= source->size || length == 0)
        return 0; /* libraries ask for nothing, too, into a NULL buffer */
    if (length > source->size - offset)
        length = (size_t)(source->size - offset);
    if (source->memory) {
        memcpy(buffer, source->memory + offset, length);
        return length;
    }
    size_t done = 0;
    while (done < length) {
        ssize_t got = pread(source->fd, (char *)buffer + done, length - done, (off_t)(offset + done));
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
