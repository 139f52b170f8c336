/* held_out_means.h -- the figures of held-out views in the mean. */
#ifndef UNBAKE_RECONSTRUCT_HELD_OUT_MEANS_H
#define UNBAKE_RECONSTRUCT_HELD_OUT_MEANS_H

#include "server/state/reconstruction.h"

/* Mean over the views that have a value; a view without valid pixels has none. */
struct metric_mean {
    double sum, count;
};

struct held_out_means {
    struct metric_mean msre, noise_left, render_noise, photograph_noise, psnr_db, ssim; /* noise_left: of squares */
    struct metric_mean at_outlines, outline_share, brightness_error;
};

void held_out_means_add(struct held_out_means *means, const struct held_out *view);

/* Root of the mean square of what whole views are too bright or too dark by, relative; 0 of no views. */
double held_out_means_brightness(const struct held_out_means *means);

/* Adds "metrics" to the report. */
void held_out_means_report(const struct held_out_means *means, size_t view_count, const struct reconstruct_hooks *hooks,
                           cJSON *report);

#endif
