/* evaluate_command.c -- see evaluate_command.h. */
#include "server/evaluate/evaluate_command.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "common/mem.h"
#include "server/evaluate/evaluate.h"

const struct command_option evaluate_flags[] = {
    {"spp", 0, OPTION_TEXT, "N",
     "paths per pixel of the re-rendered views, up to four times where noise asks for it; 0: none, no MSRE (64)"},
    {"samples", 0, OPTION_TEXT, "N", "first hits per pixel of the parameters (16)"},
    {"max-depth", 0, OPTION_TEXT, "N", "segments of a path (16)"},
    {"pictures", 0, OPTION_TEXT, "DIR", "write side-by-sides there: truth | recovered, photograph | re-render"},
    {"json", 0, OPTION_FLAG, NULL, "print a JSON object instead of a table"},
    {"threads", 0, OPTION_TEXT, "N", "0: one per processor (0)"},
    COMMAND_HELP_FLAG,
    {0},
};

static void print_table(const struct evaluation *v) {
    const struct score *s = &v->score;
    printf("recovered against true, over %zu held-out views\n", v->view_count);
    printf("  %-22s %6.2f dB   (%.1f %% of the pixels; with unseen surface %.2f dB)\n", "base colour",
           score_psnr_db(s->base_color_seen),
           s->plain_pixels ? 100.0 * (double)s->seen_pixels / (double)s->plain_pixels : 0.0,
           score_psnr_db(s->base_color_all));
    if (v->coverage.count)
        printf("  %-22s %6.1f %% of errors within one standard deviation of confidence.exr, %.1f %% within two\n",
               "its confidence", 100.0 * score_share(v->coverage.within_one, v->coverage.count),
               100.0 * score_share(v->coverage.within_two, v->coverage.count));
    if (v->plain.pixels)
        printf("  %-22s %6.4f   (%.2f %% of the pixels are off their surroundings by more than %.2f)\n",
               "plain surface, spread", plain_surface_spread(&v->plain),
               100.0 * score_share(v->plain.specks, v->plain.pixels), (double)PLAIN_SURFACE_SPECK);
    printf("  %-22s %6.2f dB   (off by %.3f)\n", "roughness", score_psnr_db(s->roughness),
           sqrt(score_mean(s->roughness)));
    printf("  %-22s %6.2f dB   (off by %.3f)\n", "specular", score_psnr_db(s->specular), sqrt(score_mean(s->specular)));
    printf("  %-22s %zu of %zu found, %zu missed, %zu false\n", "emitters", v->emitters.found, v->emitters.count,
           v->emitters.missed, v->emitters.unfounded);
    printf("  %-22s %6.3f of 1, log error %.2g\n", "emission, overlap", score_emission_iou(s),
           score_mean(s->emission_log));
    if (isfinite(v->msre))
        printf("  %-22s %6.4f +- %.4f   (free of the re-renders' noise but for %.4f)\n", "MSRE of re-renders", v->msre,
               v->msre_deviation, v->msre_noise_left);
    if (v->smooth.count > 0)
        printf("  %-22s %6.4f of which the photographs' own noise is %.4f (%.1f %% of the pixels)\n",
               "  in smooth areas", v->smooth.render / (double)v->smooth.count,
               v->smooth.noise / (double)v->smooth.count, 100.0 * (double)v->smooth.count / (double)s->pixels);
    if (v->floor.count > 0)
        printf("  %-22s %6.4f of which the photographs' own noise is %.4f (by the errors of the truth's renders)\n",
               v->floor.count == 1 ? "  in one view" : "  in some views", v->floor.msre / (double)v->floor.count,
               v->floor.floor / (double)v->floor.count);
}

int evaluate_command(int argc, char **argv) {
    struct evaluate_settings s = evaluate_default_settings();
    uint32_t threads = 0;
    const struct number_flag numbers[] = {
        {"spp", 0, 1 << 20, .count = &s.spp},
        {"samples", 16, 4096, .count = &s.samples},
        {"max-depth", 2, 32, .count = &s.max_depth},
        {"threads", 0, 1024, .count = &threads},
    };
    struct evaluation evaluation;
    struct options a;
    struct error err;
    int code = arguments_begin(&a, argc, argv, evaluate_flags, numbers, sizeof numbers / sizeof *numbers, 2);
    if (code >= 0)
        return code;
    s.pictures_dir = options_text(&a, "pictures", s.pictures_dir);
    struct parallel *pool = parallel_new((int)threads);
    enum status status = evaluate_outputs(a.word[0], a.word[1], &s, pool, &evaluation, &err);
    parallel_free(pool);
    bool as_json = options_flag(&a, "json");
    options_release(&a);
    if (status != STATUS_OK) {
        fprintf(stderr, "unbaked evaluate: %s%s%s\n", err.message, *err.hint ? "; " : "", err.hint);
        return EXIT_FAILURE;
    }
    if (as_json) {
        cJSON *root = evaluate_to_json(&evaluation);
        char *text = json_text(root);
        puts(text);
        mem_free(text);
        cJSON_Delete(root);
    } else {
        print_table(&evaluation);
    }
    return EXIT_SUCCESS;
}
