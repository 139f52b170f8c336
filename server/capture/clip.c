/* clip.c -- see clip.h. */
#include "server/capture/clip.h"

#include <string.h>

#include "common/image.h"

/* Pixels to either side; of these 25, pixels that must show the same surface, for a share of .3 to be three of them. */
#define WINDOW_RADIUS 2      /* to 3: no change */
#define WINDOW_MIN_PIXELS 9  /* to 11: no change */
#define SATURATED_SHARE 0.3f /* measured: with a tenth, bathroom loses .13 dB (8 bits); +25 %: no change */
/* Standard deviations that noise reaches below the clip: in one of 740 normal values it reaches farther. */
#define NOISE_DEVIATIONS 3.0f /* +25 %: no change */
#define BLOCK 256             /* columns that are looked at together */

struct clip_job {
    const struct views *views;
    const struct noise *noise;
    struct photograph *photo;
    uint32_t train;
};

/* Statistics of one channel over the pixels around one that show the same surface. */
struct neighbourhood {
    float count, saturated, unsaturated_sum;
};

static struct neighbourhood count_neighbourhood(const struct clip_job *job, long x0, long y0, int channel) {
    const struct camera *camera = &job->photo->camera;
    const uint8_t *owner = job->views->owner[job->train], *edge = job->views->edge[job->train];
    uint8_t own = owner[y0 * (long)camera->width + x0];
    struct neighbourhood a = {0.0f, 0.0f, 0.0f};
    for (long y = y0 > WINDOW_RADIUS ? y0 - WINDOW_RADIUS : 0; y <= y0 + WINDOW_RADIUS && y < (long)camera->height;
         y++) {
        for (long x = x0 > WINDOW_RADIUS ? x0 - WINDOW_RADIUS : 0; x <= x0 + WINDOW_RADIUS && x < (long)camera->width;
             x++) {
            size_t at = (size_t)(y * (long)camera->width + x);
            if (owner[at] != own || edge[at] == VIEWS_EDGE || (job->photo->mask && !job->photo->mask[at]))
                continue;
            float value = image_float_from_half(job->photo->pixel[at][channel]);
            bool saturates = photograph_clips(job->photo, at, channel, value);
            a.count += 1.0f;
            a.saturated += saturates;
            a.unsaturated_sum += saturates ? 0.0f : value;
        }
    }
    return a;
}

static bool is_saturated(const struct clip_job *job, long x, long y, int channel) {
    float clip = job->photo->clip;
    size_t at = (size_t)(y * (long)job->photo->camera.width + x);
    float value = image_float_from_half(job->photo->pixel[at][channel]);
    bool clips = photograph_clips(job->photo, at, channel, value);
    struct neighbourhood a = count_neighbourhood(job, x, y, channel);
    if (a.saturated == 0.0f || a.count < WINDOW_MIN_PIXELS)
        return clips;
    float noise = noise_deviation_of_value(job->noise, job->train, &job->photo->camera, (float)x, (float)y, clip);
    float threshold = clip - NOISE_DEVIATIONS * noise;
    if (a.saturated >= SATURATED_SHARE * a.count)
        return value >= threshold;
    return clips && a.unsaturated_sum / (a.count - a.saturated) < threshold;
}

/* In clips[x - first], for columns [first, end): whether a pixel of the column, in any channel, clips in the rows of
 * the window around `row`. */
static void find_clipped_columns(const struct photograph *photo, size_t row, size_t first, size_t end, bool *clips) {
    size_t width = photo->camera.width;
    memset(clips, 0, end - first);
    for (size_t y = row > WINDOW_RADIUS ? row - WINDOW_RADIUS : 0; y <= row + WINDOW_RADIUS && y < photo->camera.height;
         y++) {
        for (size_t x = first; x < end; x++) {
            size_t at = y * width + x;
            for (int c = 0; c < 3; c++)
                clips[x - first] |= photograph_clips(photo, at, c, image_float_from_half(photo->pixel[at][c]));
        }
    }
}

static uint8_t saturated_channels(const struct clip_job *job, long x, long y) {
    uint8_t channels = 0;
    for (int c = 0; c < 3; c++)
        channels |= (uint8_t)(is_saturated(job, x, y, c) << c);
    return channels;
}

/* Columns [first, end) of a row, BLOCK at the most. Where nothing clips in the window, nothing is saturated. */
static void mark_block(const struct clip_job *job, size_t row, size_t first, size_t end) {
    size_t width = job->photo->camera.width;
    size_t left = first > WINDOW_RADIUS ? first - WINDOW_RADIUS : 0;
    size_t right = end + WINDOW_RADIUS < width ? end + WINDOW_RADIUS : width;
    bool clips[BLOCK + 2 * WINDOW_RADIUS];
    find_clipped_columns(job->photo, row, left, right, clips);
    for (size_t x = first; x < end; x++) {
        bool any = false;
        for (size_t i = x > WINDOW_RADIUS ? x - WINDOW_RADIUS : 0; i <= x + WINDOW_RADIUS && i < width; i++)
            any |= clips[i - left];
        job->photo->saturated[row * width + x] = any ? saturated_channels(job, (long)x, (long)row) : 0;
    }
}

static void mark_row(void *user, size_t row, int thread) {
    (void)thread;
    const struct clip_job *job = user;
    size_t width = job->photo->camera.width;
    for (size_t y = row > WINDOW_RADIUS ? row - WINDOW_RADIUS : 0;
         y <= row + WINDOW_RADIUS && y < job->photo->camera.height; y++) {
        photograph_use(job->photo, y * width, width);
        views_use(job->views, job->train, y * width, width);
    }
    for (size_t x = 0; x < width; x += BLOCK)
        mark_block(job, row, x, x + BLOCK < width ? x + BLOCK : width);
}

void clip_mark(struct scene *scene, const struct views *views, const struct noise *noise, struct parallel *pool) {
    for (uint32_t t = 0; t < views->train_count; t++) {
        struct photograph *photo = &scene->photograph[views->train[t]];
        if (photo->is_hdr)
            continue;
        struct clip_job job = {views, noise, photo, t};
        if (!photo->saturated)
            photo->saturated =
                spill_take(photo->spill, (size_t)photo->camera.width * photo->camera.height, sizeof *photo->saturated);
        parallel_for(pool, photo->camera.height, mark_row, &job);
    }
}
