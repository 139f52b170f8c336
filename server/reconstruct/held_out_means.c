/* held_out_means.c -- see held_out_means.h. */
#include "server/reconstruct/held_out_means.h"

#include <math.h>

#include "common/json.h"

static void mean_add(struct metric_mean *mean, double value) {
    if (isnan(value))
        return;
    mean->sum += value;
    mean->count += 1.0;
}

void held_out_means_add(struct held_out_means *means, const struct held_out *view) {
    mean_add(&means->msre, view->msre);
    mean_add(&means->at_outlines, view->msre_at_outlines);
    mean_add(&means->outline_share, view->outline_share);
    mean_add(&means->brightness_error, view->brightness_error);
    mean_add(&means->noise_left, view->msre_noise_left * view->msre_noise_left);
    mean_add(&means->render_noise, view->msre_render_noise);
    mean_add(&means->photograph_noise, view->msre_photograph_noise);
    mean_add(&means->psnr_db, view->psnr_db);
    mean_add(&means->ssim, view->ssim);
}

double held_out_means_brightness(const struct held_out_means *means) {
    const struct metric_mean *mean = &means->brightness_error;
    return mean->count > 0.0 ? sqrt(fmax(mean->sum / mean->count, 0.0)) : 0.0;
}

void held_out_means_report(const struct held_out_means *means, size_t view_count, const struct reconstruct_hooks *hooks,
                           cJSON *report) {
    cJSON *metrics = cJSON_AddObjectToObject(report, "metrics");
    double count = means->msre.count;
    json_add_int(metrics, "held_out_views", (int64_t)view_count);
    if (count == 0.0)
        return;
    json_add_number(metrics, "msre", means->msre.sum / count);
    json_add_number(metrics, "msre_noise_left", sqrt(means->noise_left.sum) / means->noise_left.count);
    json_add_number(metrics, "msre_render_noise", means->render_noise.sum / means->render_noise.count);
    json_add_number(metrics, "msre_photograph_noise", means->photograph_noise.sum / means->photograph_noise.count);
    json_add_number(metrics, "msre_at_outlines", means->at_outlines.sum / means->at_outlines.count);
    json_add_number(metrics, "outline_share", means->outline_share.sum / means->outline_share.count);
    json_add_number(metrics, "brightness_error", held_out_means_brightness(means));
    json_add_number(metrics, "psnr_db", means->psnr_db.sum / means->psnr_db.count);
    json_add_number(metrics, "ssim", means->ssim.sum / means->ssim.count);
    hooks->metric(hooks->user, "msre", 0, means->msre.sum / count);
}
