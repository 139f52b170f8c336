/* denoise.c -- see denoise.h. */
#include "server/relight/denoise.h"

#include <assert.h>
#include <dlfcn.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "common/mem.h"

/* Of the library's header. */
enum { OIDN_DEVICE_CPU = 1, OIDN_FORMAT_FLOAT3 = 3 };

/* The functions that are used; the last three had other names in 1.x. */
struct oidn {
    void *(*new_device)(int type);
    void (*commit_device)(void *device);
    void (*release_device)(void *device);
    int (*get_error)(void *device, const char **message);
    void *(*new_filter)(void *device, const char *type);
    void (*set_image)(void *filter, const char *name, void *data, int format, size_t width, size_t height,
                      size_t offset, size_t pixel_stride, size_t row_stride);
    void (*commit_filter)(void *filter);
    void (*execute)(void *filter);
    void (*release_filter)(void *filter);
    int (*get_int)(void *device, const char *name);
    void (*set_int)(void *device, const char *name, int value);
    void (*set_bool)(void *filter, const char *name, bool value);
};

struct denoiser {
    void *library, *device;
    struct oidn call;
    char version[64];
};

static void *open_library(void) {
    static const char *const names[] = {"libOpenImageDenoise.so.2", DENOISE_LIBRARY_DIR "/libOpenImageDenoise.so.2",
                                        "libOpenImageDenoise.so.1", "libOpenImageDenoise.so.0"};
    void *library = NULL;
    for (size_t i = 0; i < sizeof names / sizeof *names && !library; i++)
        library = dlopen(names[i], RTLD_NOW | RTLD_LOCAL);
    return library;
}

/* The function by its name in 2.x, else in 1.x. */
static void *find(void *library, const char *name, const char *older) {
    void *found = dlsym(library, name);
    return found || !older ? found : dlsym(library, older);
}

static bool find_functions(struct denoiser *d) {
    const struct {
        void *to;
        const char *name, *older;
    } wanted[] = {
        {&d->call.new_device, "oidnNewDevice", NULL},
        {&d->call.commit_device, "oidnCommitDevice", NULL},
        {&d->call.release_device, "oidnReleaseDevice", NULL},
        {&d->call.get_error, "oidnGetDeviceError", NULL},
        {&d->call.new_filter, "oidnNewFilter", NULL},
        {&d->call.set_image, "oidnSetSharedFilterImage", NULL},
        {&d->call.commit_filter, "oidnCommitFilter", NULL},
        {&d->call.execute, "oidnExecuteFilter", NULL},
        {&d->call.release_filter, "oidnReleaseFilter", NULL},
        {&d->call.get_int, "oidnGetDeviceInt", "oidnGetDevice1i"},
        {&d->call.set_int, "oidnSetDeviceInt", "oidnSetDevice1i"},
        {&d->call.set_bool, "oidnSetFilterBool", "oidnSetFilter1b"},
    };
    for (size_t i = 0; i < sizeof wanted / sizeof *wanted; i++) {
        void *found = find(d->library, wanted[i].name, wanted[i].older);
        if (!found)
            return false;
        memcpy(wanted[i].to, &found, sizeof found);
    }
    return true;
}

static enum status check_device(const struct denoiser *d, struct error *err) {
    const char *message = NULL;
    if (d->call.get_error(d->device, &message) == 0)
        return STATUS_OK;
    return error_set(err, STATUS_UNAVAILABLE, "%s: %s", denoiser_version(d), message ? message : "unknown error");
}

enum status denoiser_open(int threads, struct denoiser **result, struct error *err) {
    struct denoiser *d = mem_calloc(1, sizeof *d);
    enum status status = STATUS_OK;
    *result = NULL;
    snprintf(d->version, sizeof d->version, "Open Image Denoise");
    d->library = open_library();
    if (!d->library || !find_functions(d)) {
        status = error_set(err, STATUS_UNAVAILABLE, "the library Open Image Denoise is not installed");
        error_hint(err, "deploy/install-deps.sh oidn installs it");
        goto out;
    }
    d->device = d->call.new_device(OIDN_DEVICE_CPU);
    if (d->device) {
        if (threads > 0)
            d->call.set_int(d->device, "numThreads", threads);
        d->call.commit_device(d->device);
    }
    status = check_device(d, err);
    if (status == STATUS_OK) {
        int version = d->call.get_int(d->device, "version"); /* 10000 major + 100 minor + patch */
        snprintf(d->version, sizeof d->version, "Open Image Denoise %d.%d.%d", version / 10000, version / 100 % 100,
                 version % 100);
        *result = d;
        d = NULL;
    }
out:
    denoiser_free(d);
    return status;
}

void denoiser_free(struct denoiser *d) {
    if (!d)
        return;
    if (d->device)
        d->call.release_device(d->device);
    if (d->library)
        dlclose(d->library);
    mem_free(d);
}

const char *denoiser_version(const struct denoiser *d) { return d->version; }

/* Names channels of `image` to the filter, from `first` on; *image must stay until it has run. */
static void give(const struct denoiser *d, void *filter, const char *name, const struct image *image, uint32_t first) {
    size_t pixel = image->channel_count * sizeof *image->pixel;
    d->call.set_image(filter, name, image->pixel, OIDN_FORMAT_FLOAT3, image->width, image->height,
                      first * sizeof *image->pixel, pixel, pixel * image->width);
}

enum status denoiser_run(const struct denoiser *d, struct image *picture, uint32_t first, const struct image *guide,
                         struct error *err) {
    int color = image_channel(guide, "base_color.R"), normal = image_channel(guide, "normal.X");
    assert(color >= 0 && normal >= 0 && guide->width == picture->width && guide->height == picture->height);
    void *filter = d->call.new_filter(d->device, "RT");
    give(d, filter, "color", picture, first);
    give(d, filter, "albedo", guide, (uint32_t)color);
    give(d, filter, "normal", guide, (uint32_t)normal);
    give(d, filter, "output", picture, first);
    d->call.set_bool(filter, "hdr", true);
    d->call.commit_filter(filter);
    d->call.execute(filter);
    enum status status = check_device(d, err);
    d->call.release_filter(filter);
    return status;
}
