/* enlarge_room ROOM OUT FACTOR COPIES -- a room of `unbaked demo-room --sdr` with pictures FACTOR times as wide and
 * high, each under COPIES names: as large a capture as one likes, within minutes and little of the disk. For
 * many_photographs.sh. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "common/file.h"
#include "common/image.h"
#include "common/json.h"
#include "common/mem.h"
#include "common/parallel.h"

struct room {
    const char *from, *to;
    uint32_t factor;
    int copies;
    cJSON *frames;
    enum status *status; /* [frame_count], as the next */
    struct error *err;
};

/* Bilinear, the border repeated. */
static void enlarge(const struct image *small, uint32_t factor, struct image *large) {
    image_init_rgb(large, small->width * factor, small->height * factor);
    for (uint32_t y = 0; y < large->height; y++) {
        for (uint32_t x = 0; x < large->width; x++) {
            float u = fmaxf(((float)x + 0.5f) / (float)factor - 0.5f, 0.0f);
            float v = fmaxf(((float)y + 0.5f) / (float)factor - 0.5f, 0.0f);
            uint32_t column = (uint32_t)u, row = (uint32_t)v;
            uint32_t right = column + 1 < small->width ? column + 1 : column;
            uint32_t below = row + 1 < small->height ? row + 1 : row;
            float s = u - (float)column, t = v - (float)row;
            for (uint32_t c = 0; c < 3; c++) {
                const float *from = small->pixel + c;
                size_t stride = small->channel_count, width = small->width;
                float above =
                    (1.0f - s) * from[(row * width + column) * stride] + s * from[(row * width + right) * stride];
                float under =
                    (1.0f - s) * from[(below * width + column) * stride] + s * from[(below * width + right) * stride];
                large->pixel[((size_t)y * large->width + x) * 3 + c] = (1.0f - t) * above + t * under;
            }
        }
    }
}

static char *copy_name(const char *name, int copy) {
    const char *dot = strrchr(name, '.');
    return mem_printf("%.*s_%d%s", (int)(dot - name), name, copy, dot);
}

static enum status write_copies(const struct room *room, const char *name, const struct image *large,
                                struct error *err) {
    char *first_name = copy_name(name, 0), *first = file_join(room->to, first_name);
    enum status status = image_write_png(first, large, 1.0f, err);
    for (int k = 1; k < room->copies && status == STATUS_OK; k++) {
        char *own_name = copy_name(name, k), *own = file_join(room->to, own_name);
        if (link(first, own) != 0 && errno != EEXIST)
            status = error_set_errno(err, errno, "cannot link %s", own);
        mem_free(own);
        mem_free(own_name);
    }
    mem_free(first);
    mem_free(first_name);
    return status;
}

static void enlarge_frame(void *user, size_t index, int thread) {
    const struct room *room = user;
    const char *name = cJSON_GetStringValue(
        cJSON_GetObjectItemCaseSensitive(cJSON_GetArrayItem(room->frames, (int)index), "file_path"));
    struct image small, large;
    char *path = file_join(room->from, name);
    (void)thread;
    room->status[index] = image_read_stored(path, &small, &room->err[index]);
    mem_free(path);
    if (room->status[index] != STATUS_OK)
        return;
    /* image_write_png writes linear values as sRGB */
    for (size_t i = 0; i < (size_t)small.width * small.height * small.channel_count; i++)
        small.pixel[i] = image_srgb_to_linear(small.pixel[i]);
    enlarge(&small, room->factor, &large);
    image_release(&small);
    room->status[index] = write_copies(room, name, &large, &room->err[index]);
    image_release(&large);
}

static void scale(cJSON *object, const char *name, double factor) {
    cJSON *number = cJSON_GetObjectItemCaseSensitive(object, name);
    if (number)
        cJSON_SetNumberValue(number, number->valuedouble * factor);
}

static enum status write_cameras(const struct room *room, cJSON *cameras, struct error *err) {
    static const char *const lengths[] = {"w", "h", "fl_x", "fl_y", "cx", "cy"};
    for (size_t i = 0; i < sizeof lengths / sizeof *lengths; i++)
        scale(cameras, lengths[i], room->factor);
    cJSON *all = cJSON_CreateArray();
    const cJSON *frame;
    cJSON_ArrayForEach(frame, room->frames) {
        for (int k = 0; k < room->copies; k++) {
            cJSON *own = cJSON_Duplicate(frame, true);
            char *name = copy_name(cJSON_GetStringValue(cJSON_GetObjectItemCaseSensitive(own, "file_path")), k);
            cJSON_ReplaceItemInObjectCaseSensitive(own, "file_path", cJSON_CreateString(name));
            mem_free(name);
            cJSON_AddItemToArray(all, own);
        }
    }
    cJSON_ReplaceItemInObjectCaseSensitive(cameras, "frames", all);
    char *text = json_text(cameras), *path = file_join(room->to, "transforms.json");
    enum status status = file_replace(path, text, strlen(text), err);
    mem_free(path);
    mem_free(text);
    return status;
}

int main(int argc, char **argv) {
    if (argc != 5) {
        fprintf(stderr, "usage: enlarge_room ROOM OUT FACTOR COPIES\n");
        return 2;
    }
    struct room room = {argv[1], argv[2], (uint32_t)atoi(argv[3]), atoi(argv[4]), NULL, NULL, NULL};
    struct error err = {0};
    cJSON *cameras = NULL;
    char *from = file_join(room.from, "transforms.json"), *images = file_join(room.to, "images");
    enum status status = json_read(from, (size_t)1 << 24, &cameras, &err);
    if (status == STATUS_OK)
        status = file_make_dirs(images, &err);
    if (status == STATUS_OK) {
        room.frames = cJSON_GetObjectItemCaseSensitive(cameras, "frames");
        size_t count = (size_t)cJSON_GetArraySize(room.frames);
        room.status = mem_calloc(count, sizeof *room.status);
        room.err = mem_calloc(count, sizeof *room.err);
        struct parallel *pool = parallel_new(0);
        parallel_for(pool, count, enlarge_frame, &room);
        parallel_free(pool);
        for (size_t i = 0; i < count && status == STATUS_OK; i++) {
            status = room.status[i];
            err = room.err[i];
        }
    }
    if (status == STATUS_OK)
        status = write_cameras(&room, cameras, &err);
    if (status != STATUS_OK)
        fprintf(stderr, "enlarge_room: %s\n", err.message);
    mem_free(room.err);
    mem_free(room.status);
    cJSON_Delete(cameras);
    mem_free(images);
    mem_free(from);
    return status != STATUS_OK;
}
