/* oidn.c -- under the name libOpenImageDenoise.so.2, in the place of that library: version 2.99.1, whose filter makes
 * each colour the mean of the picture. It refuses to work without albedo and normals of the same size, and for other
 * than HDR. */
#include <stdbool.h>
#include <stddef.h>
#include <string.h>

/* Declared where they are used, by their types (server/relight/denoise.c). */
#pragma GCC diagnostic ignored "-Wmissing-prototypes"

enum { COLOR, ALBEDO, NORMAL, OUTPUT, IMAGES, FLOAT3 = 3 };

struct picture {
    char *data;
    size_t width, height, pixel_stride, row_stride;
};
static struct {
    struct picture image[IMAGES];
    bool is_hdr;
    const char *error;
} state;

void *oidnNewDevice(int type) { return type == 1 ? &state : NULL; }
void oidnCommitDevice(void *device) { (void)device; }
void oidnReleaseDevice(void *device) { (void)device; }
void oidnSetDeviceInt(void *device, const char *name, int value) { (void)device, (void)name, (void)value; }
int oidnGetDeviceInt(void *device, const char *name) { return device && strcmp(name, "version") == 0 ? 29901 : 0; }

int oidnGetDeviceError(void *device, const char **message) {
    *message = device ? state.error : "no device for processors";
    return *message ? 1 : 0;
}

void *oidnNewFilter(void *device, const char *type) {
    (void)device;
    memset(&state, 0, sizeof state);
    state.error = strcmp(type, "RT") == 0 ? NULL : "no such filter";
    return &state;
}
void oidnCommitFilter(void *filter) { (void)filter; }
void oidnReleaseFilter(void *filter) { (void)filter; }
void oidnSetFilterBool(void *filter, const char *name, bool value) {
    (void)filter;
    state.is_hdr = state.is_hdr || (strcmp(name, "hdr") == 0 && value);
}

void oidnSetSharedFilterImage(void *filter, const char *name, void *data, int format, size_t width, size_t height,
                              size_t offset, size_t pixel_stride, size_t row_stride) {
    static const char *const names[IMAGES] = {"color", "albedo", "normal", "output"};
    (void)filter;
    for (int i = 0; i < IMAGES && format == FLOAT3; i++)
        if (strcmp(name, names[i]) == 0)
            state.image[i] = (struct picture){(char *)data + offset, width, height, pixel_stride, row_stride};
}

static float *at(const struct picture *p, size_t pixel) {
    return (float *)(void *)(p->data + pixel / p->width * p->row_stride + pixel % p->width * p->pixel_stride);
}

void oidnExecuteFilter(void *filter) {
    const struct picture *color = &state.image[COLOR];
    size_t count = color->width * color->height;
    (void)filter;
    for (int i = 0; i < IMAGES; i++)
        if (!state.image[i].data || state.image[i].width != color->width || state.image[i].height != color->height)
            state.error = "a picture is missing";
    if (!state.is_hdr)
        state.error = "not HDR";
    for (int c = 0; c < 3 && !state.error; c++) {
        double mean = 0.0, length = 0.0;
        for (size_t i = 0; i < count; i++) {
            const float *albedo = at(&state.image[ALBEDO], i), *normal = at(&state.image[NORMAL], i);
            mean += (double)at(color, i)[c] / (double)count;
            length += (double)(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]) / (double)count;
            if (!(albedo[c] >= 0.0f && albedo[c] <= 1.0f))
                state.error = "albedo is none";
        }
        if (!(length > 0.5 && length < 1.01)) /* 1, less where samples of a pixel hit several surfaces */
            state.error = "normals are none";
        for (size_t i = 0; i < count; i++)
            at(&state.image[OUTPUT], i)[c] = (float)mean;
    }
}
