/* photo_faults.c -- see photo_faults.h. */
#include "server/ingest/photo_faults.h"

#include <stdio.h>

#include "common/image_ceiling.h"

/* Share of a photograph's pixels from which it says nothing. None that shows a room is so: it is refused as one that
 * cannot be decoded. */
#define MOST 0.5
/* Shares of one photograph and of all from which more is said: a renderer's few pixels that failed are below, the sun's
 * disc (1e-4 of a picture of 60 degrees) and a bare bulb are, too. They choose words only. */
#define MANY_OF_ONE 1e-3
#define MANY_OF_ALL 3e-4
/* Share of the light of all photographs that is below 0 from which it is told: filters leave less. */
#define NEGATIVE_SHARE 0.01
/* Mean of all photographs below which a surface of a twentieth of it is rounded by more than half a percent: halves
 * below 6e-5 are multiples of 6e-8. */
#define COARSE 1e-4

static double share_of(size_t count, size_t of) { return of > 0 ? (double)count / (double)of : 0.0; }

void photo_faults_begin(struct photo_faults *faults, const char *file, const struct image *image,
                        const struct image_info *info) {
    size_t whole = (size_t)image->width * image->height;
    bool is_cut = info->window.width > 0;
    size_t inside = is_cut ? (size_t)info->window.width * info->window.height : whole;
    *faults = (struct photo_faults){
        .file = file, .pixel_count = inside, .outside = whole - inside, .is_linear = info->encoding == IMAGE_LINEAR};
}

enum status photo_faults_judge(const struct photo_faults *faults, struct error *err) {
    size_t bad = faults->not_finite + faults->beside - faults->outside;
    if (share_of(bad, faults->pixel_count) > MOST)
        return error_set(err, STATUS_INPUT, "%s: %.0f %% of its pixels are no numbers or infinite", faults->file,
                         100.0 * share_of(bad, faults->pixel_count));
    if (share_of(faults->bounds, faults->pixel_count) <= MOST)
        return STATUS_OK;
    error_set(err, STATUS_INPUT, "%s: %.0f %% of its pixels are at or above %.0f, the largest number of half precision",
              faults->file, 100.0 * share_of(faults->bounds, faults->pixel_count), (double)IMAGE_HALF_LARGEST);
    return error_hint(err, "multiply all photographs by a factor that brings the room to about 1");
}

/* Of all photographs together. */
struct totals {
    size_t pixels, bad, photographs, worst; /* worst: number of the photograph with the largest share */
    bool are_many;
};

static void add(struct totals *t, const struct photo_faults *faults, size_t i, size_t bad, double *worst_share) {
    double share = share_of(bad, faults[i].pixel_count);
    t->pixels += faults[i].pixel_count;
    t->bad += bad;
    t->photographs += bad > 0;
    t->are_many |= share > MANY_OF_ONE;
    if (share > *worst_share) {
        *worst_share = share;
        t->worst = i;
    }
}

/* A share in %, as people say it. */
static void print_percent(char text[static 32], double share) {
    snprintf(text, 32, share < 0.01 ? "%.2g" : "%.0f", 100.0 * share);
}

static void warn_of_nan(const struct photo_faults *faults, size_t count, struct findings *f) {
    struct totals t = {0};
    double worst = 0.0;
    for (size_t i = 0; i < count; i++)
        add(&t, faults, i, faults[i].not_finite + faults[i].beside - faults[i].outside, &worst);
    if (t.bad == 0)
        return;
    char percent[32];
    print_percent(percent, worst);
    bool are_many = t.are_many || share_of(t.bad, t.pixels) > MANY_OF_ALL;
    findings_warning(
        f,
        "%zu pixels of %zu photographs are no numbers or infinite, or lie beside such pixels at the end of "
        "what the file can hold: they are not used (%s %% of %s%s)%s",
        t.bad, t.photographs, percent, faults[t.worst].file, t.photographs > 1 ? ", the most" : "",
        are_many ? "; what wrote them failed there, and what lies between may be wrong as well: render or "
                   "merge them again, or exclude the place by masks"
                 : "");
}

static void warn_of_bounds(const struct photo_faults *faults, size_t count, struct findings *f) {
    struct totals t = {0};
    double worst = 0.0;
    for (size_t i = 0; i < count; i++)
        add(&t, faults, i, faults[i].bounds, &worst);
    if (t.bad == 0)
        return;
    char percent[32];
    print_percent(percent, worst);
    bool are_many = t.are_many || share_of(t.bad, t.pixels) > MANY_OF_ALL;
    findings_warning(f,
                     "%zu pixels of %zu photographs are at or above %.0f, the largest number of half precision, and "
                     "count as that bright at least (%s %% of %s%s)%s",
                     t.bad, t.photographs, (double)IMAGE_HALF_LARGEST, percent, faults[t.worst].file,
                     t.photographs > 1 ? ", the most" : "",
                     are_many ? "; what is so in all photographs becomes a lamp that lights the room: if nothing "
                                "shines there, make them again, or exclude it by masks"
                              : "");
}

static void warn_of_window(const struct photo_faults *faults, size_t count, struct findings *f) {
    size_t pixels = 0, photographs = 0;
    for (size_t i = 0; i < count; i++) {
        pixels += faults[i].outside;
        photographs += faults[i].outside > 0;
    }
    if (pixels > 0)
        findings_warning(f, "%zu pixels of %zu photographs lie outside of the EXRs' data windows and are not used",
                         pixels, photographs);
}

/* Of linear photographs. */
static void warn_of_scale(const struct photo_faults *faults, size_t count, struct findings *f) {
    double light = 0.0, negative = 0.0, channels = 0.0;
    for (size_t i = 0; i < count; i++) {
        if (!faults[i].is_linear)
            continue;
        light += faults[i].light;
        negative += faults[i].negative;
        channels += 3.0 * (double)faults[i].pixel_count;
    }
    if (negative > NEGATIVE_SHARE * light)
        findings_warning(f,
                         "pixels below 0, which count as 0, are %.2g %% of the light of the photographs: are they "
                         "linear light?",
                         100.0 * negative / (light + negative));
    if (light > 0.0 && light < COARSE * channels)
        findings_warning(f,
                         "the mean of all linear photographs is %.2g: half precision keeps so small values coarsely or "
                         "not at all; multiply all by a factor that brings the room to about 1",
                         light / channels);
}

void photo_faults_warn(const struct photo_faults *faults, size_t count, struct findings *f) {
    warn_of_window(faults, count, f);
    warn_of_nan(faults, count, f);
    warn_of_bounds(faults, count, f);
    warn_of_scale(faults, count, f);
}
